"""Every misbehaviour of the table ends as the table says. `make faults` runs them all, `make ci-long` a dozen."""

from __future__ import annotations

import re
from pathlib import Path

import misbehaving
import pytest
from misbehaviours import KINDS, NO_RUN, NOISE, PASS, STATUS, Kind, page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"
QUIET_S = 30.0


def marked(kind: Kind) -> object:
    marks = [pytest.mark.faults, pytest.mark.timeout(900), *([pytest.mark.long] if kind.long else [])]
    return pytest.param(kind, id=kind.name, marks=marks)


@pytest.mark.parametrize("kind", [marked(kind) for kind in KINDS])
def test_a_misbehaviour_ends_as_the_table_says(kind: Kind, mischief: Path, tmp_path: Path) -> None:
    end = misbehaving.ended(mischief, tmp_path / "1", kind.wire, kind.switches.split())
    for again in ("2", "3"):
        if end.stalled:  # this computer's doing, and no misbehaviour of ours
            end = misbehaving.ended(mischief, tmp_path / again, kind.wire, kind.switches.split())
    outcomes = kind.outcome.split(" or ")
    assert end.outcome in ([""] if kind.outcome == NO_RUN else outcomes), end
    assert any(end.status in STATUS[outcome] for outcome in outcomes), end
    assert set(kind.findings) <= set(end.findings), end
    assert re.search(kind.says, " ".join(end.printed.split())), end
    assert "Traceback" not in end.printed
    if end.outcome == PASS:
        assert set(end.findings) - NOISE <= {*kind.findings, *kind.also}, end
    assert end.quiet_s < QUIET_S, end


def test_the_page_is_the_table() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), (
        "run: python tests/firmware/misbehaviours.py > docs/reference/faults.md"
    )


def test_names_are_unique_and_a_dozen_are_run_by_ci() -> None:
    assert len({kind.name for kind in KINDS}) == len(KINDS)
    assert sum(kind.long for kind in KINDS) >= 12
