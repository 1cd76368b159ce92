"""A lift that is lost on a rig with slow telemetry (500 Hz), whose last samples come after the step is over, is explained; what
the rest on the rings shows before is told, and the shaft not lifted."""

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


@pytest.mark.parametrize("procedure", ["bearing-model", "tracking", "step", "amb-calibration"])
def test_a_lift_that_exchanged_coils_make_fail_is_explained(procedure: str, tmp_path: Path) -> None:
    run = simulated_run(procedure, STAND, 3, {}, tmp_path / "lost.mcap", {"exchange_coils.y_vorn": 1.0})
    assert [code for code, _ in wrong(run)] == ["lift-lost"]


@pytest.mark.parametrize("procedure", ["step", "amb-calibration"])
@pytest.mark.parametrize(
    ("truth", "code", "where"),
    [
        ({"probe_sign.y_vorn": -1.0}, "sensor-polarity", "LageYVorn"),
        ({"rings.vorn.clearance": 1e-4}, "ring-too-near", "vorn"),
    ],
)
def test_a_shaft_whose_rest_shows_what_is_wrong_is_not_lifted(
    procedure: str, truth: dict[str, float], code: str, where: str, tmp_path: Path
) -> None:
    run = simulated_run(procedure, STAND, 3, {}, tmp_path / "rest.mcap", truth)
    assert wrong(run)[:1] == [(code, where)]
    assert "not lifted" in next(f.text for f in run.results if isinstance(f, Finding) and f.code == code)
    assert "LEVITATE" not in {e["name"] for e in run.recording.events("command")}
    assert not run.recording.all_steps()


def test_a_shaft_that_a_motor_draws_aside_is_lifted_as_it_lies(tmp_path: Path) -> None:
    """Magnets of tsbs12's motor hold its shaft to any side of the rings: no rest says which way a probe counts."""
    quick = {"settle_s": 0.4, "average_s": 0.2}
    run = simulated_run("amb-calibration", "tsbs12", 3, quick, tmp_path / "drawn.mcap")
    assert wrong(run) == []
    assert len(run.recording.all_steps())
