"""How a shaft is turned for its response to unbalance: laws and settings of the controller, slow roll, dwells, stop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import AmbRotor, Law, Variant, conventions
from procedures.synchronous.dwells import DWELL, SLOW, captured_channels

MARGIN_S = 0.1  # of a dwell beside its capture


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
    select(rig, plan.law)
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
    machine = conventions(rig.file)
    if plan.repeat and lift.turned(rig, record, speed, plan.settle_s):
        put(rig, machine.variants[plan.variants[0]])
        rig.clock.sleep(plan.settle_s)
        _dwell(rig, machine, plan, record, speed, plan.variants[0], -1)


def finished(rig: Rig) -> None:
    """Nothing compensated, the drive stopped, the shaft standing under the PID."""
    machine = conventions(rig.file)
    put(rig, machine.variants["off"])
    if rig.drive is not None:
        rig.drive.stop()
        rig.drive.coast()
    put(rig, machine.select("PID"))
    rig.clock.sleep(machine.stands_s)


def dwelt(rig: Rig, plan: Dwelling, record: Recorder) -> bool:
    """All dwells, the slowest first; False if a speed is not reached."""
    machine, number = conventions(rig.file), 0
    for speed in sorted(plan.speeds_rad_s):
        put(rig, machine.variants[plan.variants[0]])
        if not lift.turned(rig, record, speed, plan.settle_s):
            return False
        for variant in plan.at(speed):
            put(rig, machine.variants[variant])
            rig.clock.sleep(plan.settle_s)
            _dwell(rig, machine, plan, record, speed, variant, number)
            number += 1
    return True


def _dwell(
    rig: Rig, machine: AmbRotor, plan: Dwelling, record: Recorder, speed: float, variant: Variant, number: int
) -> None:
    with record.step(DWELL, **_labels(rig, speed, variant, number)):
        if rig.capture is not None:
            rig.capture.arm(captured_channels(machine), seconds=plan.capture_s, rate_hz=plan.rate_hz)
            rig.capture.wait(plan.capture_s + 5.0)
        rig.clock.sleep(max(plan.dwell_s - plan.capture_s, MARGIN_S))
    if rig.capture is not None:
        rig.capture.upload(dwell=number, speed_rad_s=speed, variant=variant)


def _labels(rig: Rig, speed: float, variant: Variant, number: int = 0) -> dict[str, float | str | bool]:
    driven = rig.drive.speed_rad_s if rig.drive is not None else 0.0
    return {"speed_rad_s": speed, "variant": variant, "driven_rad_s": driven, "number": number, "again": number < 0}


def select(rig: Rig, law: Law) -> None:
    """Have the controller go by a law, nothing compensated."""
    machine = conventions(rig.file)
    put(rig, {**machine.select(law), **machine.variants["off"]})


def put(rig: Rig, values: Mapping[str, float]) -> None:
    """Write parameters of the controller."""
    for name, value in values.items():
        rig.levitation.set(name, value)
