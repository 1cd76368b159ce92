"""The table of rig-file.md that says what procedures need is made of their `requires`, and current."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench import catalogue
from bench.cli import capabilities_page

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "rig-file.md"


@pytest.fixture(scope="module")
def table() -> str:
    return capabilities_page.table(capabilities_page.rigs())


def test_the_page_has_the_table_of_today() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == capabilities_page.written(text), (
        "run: python -m bench.cli.capabilities_page docs/reference/rig-file.md"
    )


def test_every_procedure_has_a_line_and_a_rig_that_runs_it(table: str) -> None:
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| [")]
    assert len(rows) == len(catalogue.PROCEDURES)
    assert all("needed" in row for row in rows)


def test_what_some_rigs_lack_is_used(table: str) -> None:
    """A controller with no choice of law runs the steps as it is set; without set points it runs none."""
    (row,) = (line for line in table.splitlines() if line.startswith("| [step]"))
    said = dict(zip(capabilities_page.COLUMNS, row.strip("| ").split(" | ")[1:], strict=True))
    assert said["set_points"] == "needed"
    assert said["settings.law"] == said["mark"] == "used"
    assert said["injection"] == "–"


def test_a_page_without_a_place_for_it_is_refused() -> None:
    with pytest.raises(ValueError, match="found no lines"):
        capabilities_page.written("# Rig file\n")
