"""How a shaft is turned for its response to unbalance: laws and settings of the controller, slow roll, dwells, stop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from procedures.amb_rotor import lift
from procedures.synchronous.dwells import DWELL, RECORDED, SLOW

Law = Literal["PID", "CCS", "CAC"]
Variant = Literal["off", "corrected", "literal"]
CODES: dict[Law, float] = {"PID": 0.0, "CCS": 1.0, "CAC": 2.0}
POLES = {"k1": 2e5, "k2_ccs": 400.0, "k2_cac": 400.0}  # T 3.5, with the observer
SETTINGS: dict[Variant, dict[str, float]] = {
    "off": {"observer": 0.0, "compensate": 0.0, "integral": 1.0},
    "corrected": {"observer": 1.0, "compensate": 3.0, "integral": 0.0},
    "literal": {"observer": 2.0, "compensate": 3.0, "integral": 0.0},
}
MARGIN_S = 0.1  # of a dwell beside its capture
STANDS_S = 1.0  # the controller knows half a second after the last pulse that the shaft stands


class Rolling(Protocol):
    """The part of a plan that lift and slow roll need."""

    @property
    def law(self) -> Law: ...
    @property
    def slow_rad_s(self) -> float: ...
    @property
    def slow_s(self) -> float: ...
    @property
    def settle_s(self) -> float: ...


class Dwelling(Rolling, Protocol):
    """The part of a plan that dwells need."""

    @property
    def speeds_rad_s(self) -> Sequence[float]: ...
    @property
    def variants(self) -> tuple[Variant, ...]: ...
    @property
    def dwell_s(self) -> float: ...
    @property
    def capture_s(self) -> float: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def repeat(self) -> bool: ...

    def at(self, speed: float) -> tuple[Variant, ...]:
        """Variants at a speed in rad/s."""
        ...


def rolled(rig: Rig, plan: Rolling, record: Recorder) -> bool:
    """Lifted, nudged, under the plan's law, and rolled slowly; False where the run ends here."""
    if not lift.probed(rig, record):
        return False
    put(rig, {"law": CODES[plan.law], **SETTINGS["off"]})
    if plan.slow_rad_s:
        if not lift.turned(rig, record, plan.slow_rad_s, plan.settle_s):
            finished(rig)
            return False
        with record.step(SLOW, **_labels(rig, plan.slow_rad_s, "off")):
            rig.clock.sleep(plan.slow_s)
    return True


def repeated(rig: Rig, plan: Dwelling, record: Recorder) -> None:
    """The lowest speed once more, with the first setting."""
    speed = min(plan.speeds_rad_s)
    if plan.repeat and lift.turned(rig, record, speed, plan.settle_s):
        put(rig, SETTINGS[plan.variants[0]])
        rig.clock.sleep(plan.settle_s)
        _dwell(rig, plan, record, speed, plan.variants[0], -1)


def finished(rig: Rig) -> None:
    """Nothing compensated, the drive stopped, the shaft standing under the PID."""
    put(rig, SETTINGS["off"])
    if rig.drive is not None:
        rig.drive.stop()
        rig.drive.coast()
    rig.levitation.set("law", CODES["PID"])
    rig.clock.sleep(STANDS_S)


def dwelt(rig: Rig, plan: Dwelling, record: Recorder) -> bool:
    """All dwells, the slowest first; False if a speed is not reached."""
    number = 0
    for speed in sorted(plan.speeds_rad_s):
        put(rig, SETTINGS[plan.variants[0]])
        if not lift.turned(rig, record, speed, plan.settle_s):
            return False
        for variant in plan.at(speed):
            put(rig, SETTINGS[variant])
            rig.clock.sleep(plan.settle_s)
            _dwell(rig, plan, record, speed, variant, number)
            number += 1
    return True


def _dwell(rig: Rig, plan: Dwelling, record: Recorder, speed: float, variant: Variant, number: int) -> None:
    with record.step(DWELL, **_labels(rig, speed, variant, number)):
        if rig.capture is not None:
            rig.capture.arm(RECORDED, seconds=plan.capture_s, rate_hz=plan.rate_hz)
            rig.capture.wait(plan.capture_s + 5.0)
        rig.clock.sleep(max(plan.dwell_s - plan.capture_s, MARGIN_S))
    if rig.capture is not None:
        rig.capture.upload(dwell=number, speed_rad_s=speed, variant=variant)


def _labels(rig: Rig, speed: float, variant: Variant, number: int = 0) -> dict[str, float | str | bool]:
    driven = rig.drive.speed_rad_s if rig.drive is not None else 0.0
    return {"speed_rad_s": speed, "variant": variant, "driven_rad_s": driven, "number": number, "again": number < 0}


def put(rig: Rig, values: Mapping[str, float]) -> None:
    """Write parameters of the controller."""
    for name, value in values.items():
        rig.levitation.set(name, value)
