"""The fixture `inject` and what the how-to on faults says of it; the page's commands run in tests/test_docs.py."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bench import catalogue
from bench.catalogue import Entry
from bench.errors import ConfigError
from bench.link import fault_injection
from bench.record.outcomes import Outcome
from bench.run.runner import RunResult

PAGE = (Path(__file__).parent.parent / "docs" / "how-to" / "inject-faults.md").read_text(encoding="utf-8")
TINY = Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply")
Inject = Callable[..., RunResult]


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> str:
    """The small procedure in the catalogue."""
    monkeypatch.setattr(catalogue, "PROCEDURES", (TINY,))
    return TINY.name


def test_the_test_in_the_how_to_passes(inject: Inject) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    found: dict[str, Any] = {}
    exec(block, found)
    (test,) = [f for name, f in found.items() if name.startswith("test_")]
    test(inject)


def test_a_run_with_faults_is_one_with_findings(inject: Inject, tiny: str, tmp_path: Path) -> None:
    result = inject("duplicate=0.1@1", "drop=0.05@1", procedure=tiny, seed=2, plan=("seconds=0.4",))
    codes = {f.code for f in result.record.findings}
    assert {"faults-injected", "frames-duplicated", "samples-lost", "step-incomplete"} <= codes
    assert result.record.seed == 2
    assert result.directory.parent == tmp_path / "runs"


def test_without_faults_it_is_a_run_like_any_other(inject: Inject, tiny: str) -> None:
    result = inject(procedure=tiny)
    assert (result.outcome, result.record.findings) == (Outcome.DONE, ())


def test_no_fault_is_refused_before_the_start(inject: Inject, tiny: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'drop'"):
        inject("dorp=0.1", procedure=tiny)
    assert not (tmp_path / "runs").exists()


def test_the_how_to_names_every_kind() -> None:
    assert set(re.findall(r"^\| `([a-z-]+)` \|.*\| (?:share.*|s|–) \|$", PAGE, re.MULTILINE)) == set(
        fault_injection.KINDS
    )
