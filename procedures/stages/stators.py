"""Phases of reluctance motors that a controller lets carry a current one by one: where they are, and when they are aligned.

The poles of a stator of n phases stand 2 pi/(2 n) apart; its phases follow each other so, in the order of its motor's currents,
and the first is aligned at the angle zero. The rotor's poles repeat all that. Stators pull towards their own end: those of the
motors that stand on the far side to the far end.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.rigfile.stage import StageAxis, axes_of
from bench.rigfile.toleranced import Toleranced

POLES = "rotor_poles"


@dataclass(frozen=True)
class Phase:
    """One phase: `value` of the parameter that chooses it, channels of its `current` and `voltage`, its motor and which one
    that is (`stator`), the angle at which it is `aligned`, rad, and to which `side` its stator draws."""

    name: str
    value: float
    current: str
    voltage: str
    motor: str
    stator: int
    aligned: float
    side: int


def phases(rig: RigFile) -> tuple[Phase, ...]:
    """Those whose motor the rig file has, motor by motor."""
    can = rig.capabilities.phase_test
    if can is None:
        return ()
    names = [motor for motor, one in rig.motors.items() if set(one.currents) & set(can.currents.values())]
    sides = _sides(rig, names)
    by_channel = {channel: name for name, channel in can.currents.items()}
    out = []
    for stator, motor in enumerate(names):
        channels = rig.motors[motor].currents
        for k, channel in enumerate(channels):
            name = by_channel.get(channel)
            if name is not None and name in can.phases:
                aligned = k * math.pi / len(channels)
                out.append(
                    Phase(
                        name,
                        can.phases[name],
                        channel,
                        can.voltages.get(name, ""),
                        motor,
                        stator,
                        aligned,
                        sides[motor],
                    )
                )
    return tuple(out)


def _sides(rig: RigFile, motors: list[str]) -> Mapping[str, int]:
    """By where they stand; in the file's order from the near end to the far one where it does not say."""
    places, at = Places(rig), {}
    for k, motor in enumerate(motors):
        stated = rig.motors[motor].at
        if isinstance(stated, Toleranced | str):
            at[motor] = places.number(stated, f"motors.{motor}.at").number.value
        else:
            at[motor] = float(k)
    middle = sum(at.values()) / max(len(at), 1)
    return {motor: 1 if value > middle else -1 for motor, value in at.items()}


def poles(rig: RigFile) -> int:
    """Of the rotor; 0 where the rig file does not say."""
    number = rig.machine.get(POLES)
    return 0 if number is None else round(number.value)


def axis(rig: RigFile, measures: str) -> StageAxis | None:
    """The positioned axis that measures "stroke" or "angle"."""
    return next((a for a in axes_of(rig).values() if a.measures == measures), None)


def lacks(rig: RigFile, stators: int = 1) -> tuple[str, ...]:
    """What a test of phases finds missing beside `POLES` of `machine`, a line each."""
    found, out = phases(rig), []
    if len({p.motor for p in found}) < stators:
        out.append(
            f"motors: found phases of {len({p.motor for p in found})} motors that can be tested; expected {stators}"
        )
    out += [
        f"encoders: found none that measures {m} and is positioned" for m in ("stroke", "angle") if axis(rig, m) is None
    ]
    return tuple(out)
