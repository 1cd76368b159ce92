"""A lift that is lost on a rig with slow telemetry (500 Hz), whose last samples come after the step is over: it is explained."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding

STAND = str(Path(__file__).resolve().parents[2] / "examples/plain-stand/stand.toml")


def wrong(run: Simulated) -> list[tuple[str, str]]:
    """Errors by code and place, without what make-safe found standing."""
    found = [f for f in run.results if isinstance(f, Finding) and f.effect is Effect.ERROR]
    return [(f.code, f.where) for f in found if f.code != "controller-fault"]


@pytest.mark.parametrize("procedure", ["bearing-model", "tracking"])
def test_a_lift_that_exchanged_coils_make_fail_is_explained(procedure: str, tmp_path: Path) -> None:
    run = simulated_run(procedure, STAND, 3, {}, tmp_path / "lost.mcap", {"exchange_coils.y_vorn": 1.0})
    assert [code for code, _ in wrong(run)] == ["lift-lost"]
