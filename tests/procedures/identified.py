"""The chain up to the motor's force constant on one virtual rig, for its tests and for those of what comes after it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.procedure.rig import Rig
from bench.uncertainty import Estimate

SEED = 2026
CALIBRATE = {"settle_s": 0.5, "average_s": 0.3, "angles": 9}
WEIGH = {"levels_A": [-2, -1, 0, 1, 2], "ramp_A_s": 5, "settle_s": 0.25, "average_s": 0.2}


@dataclass(frozen=True)
class Identified:
    """Both runs and their calibrations."""

    amb: Simulated
    motor: Simulated
    known: dict[str, Calibration]


_AMB: dict[int, Simulated] = {}
_MADE: dict[int, Identified] = {}


def calibrated(folder: Path, seed: int = SEED) -> Simulated:
    """The AMB calibration alone; made once, as below."""
    if seed not in _AMB:
        _AMB[seed] = simulated_run("amb-calibration", "tsbs12", seed, CALIBRATE, folder / "amb.mcap")
    return _AMB[seed]


def identification(folder: Path, seed: int = SEED) -> Identified:
    """The runs at their short plans; made once for all tests (`groups.py`), by the first that asks, in its folder."""
    if seed not in _MADE:
        amb = calibrated(folder, seed)
        known = {"amb-calibration": amb.calibration()}
        motor = simulated_run("force-constant", "tsbs12", seed, WEIGH, folder / "motor.mcap", None, known)
        _MADE[seed] = Identified(amb, motor, known | {"force-constant": motor.calibration()})
    return _MADE[seed]


def identified(folder: Path, seed: int = SEED) -> dict[str, Calibration]:
    """Both calibrations."""
    return dict(identification(folder, seed).known)


def swung(rig: Rig, angle: float) -> None:
    """To an angle and back home at once, which leaves something in the angle's integrator."""
    rig.levitation.set("angle_ref", angle)
    rig.clock.sleep(0.2)
    rig.rotation.point(0.0)


def scaled(known: Mapping[str, Calibration], factor: float) -> dict[str, Calibration]:
    """The same with the motor's force constant times a factor."""
    motor = known["force-constant"]
    values = {name: e * factor for name, e in motor.values.items()}
    return {**known, "force-constant": replace(motor, values=values)}


def estimates(run: Simulated) -> dict[str, Estimate]:
    return {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured)}


def serious(run: Simulated) -> list[Finding]:
    """Findings that keep a run from passing."""
    return [f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def notes(run: Simulated) -> dict[str, str]:
    return {f.code: f.text for f in run.results if isinstance(f, Finding) and f.effect is Effect.NOTE}
