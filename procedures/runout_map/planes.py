"""Planes of bearings that a rig has: what reads each, what pushes it, what pulls it, and which motor that is."""

from __future__ import annotations

from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.places import Places

ACROSS = 2  # axes of a plane


@dataclass(frozen=True)
class Plane:
    """Channels of `positions` and `currents` in x and y; place of the negative `stiffness`; the `motor` that has it, which
    names the plane (or its number, where none does)."""

    name: str
    positions: tuple[str, ...]
    currents: tuple[str, ...]
    stiffness: str
    motor: str


def planes(rig: RigFile) -> tuple[Plane, ...]:
    """Both, in the rig's order; none where the rig does not tell."""
    can = rig.capabilities.hold
    if can is None or len(can.axes) != ACROSS or rig.shaft is None:
        return ()
    axes, known, out = tuple(can.axes.values()), Places(rig).known, []
    for k in range(2):
        stiffness = axes[0].stiffness[k]
        motor = next((n for n, m in rig.motors.items() if m.stiffness == stiffness and stiffness in known), "")
        out.append(Plane(motor or str(k + 1), tuple(a.positions[k] for a in axes), tuple(a.currents[k] for a in axes),
                         stiffness, motor))  # fmt: skip
    return tuple(out)
