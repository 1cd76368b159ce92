"""Steps as the controller's messages hold them.

A set point of 9.976 um goes out as 10.00 um by a signal of 0.05 um: the shaft ends 0.24 % beside the step that was asked for,
an eighth of the band of 2 %, and settles sooner or later than in the band about that; with an integrator of 0.13 s by 16 ms.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.check_binding import signal_at
from bench.rigfile.messages import Signal
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.stations import COORDINATES
from procedures.step.plan import Plan

COARSE = 0.01  # of a step, by which its set points may differ from what was asked for
EQUAL = 1e-9  # of a step: how numbers are written


def grain(rig: RigFile, parameter: str) -> float:
    """The step from one value that a parameter's signal can hold to the next, SI; 0 of one that holds all."""
    signal = _signal(rig, parameter)
    return 0.0 if signal is None else abs(signal.scale) * units.UNITS[signal.unit].factor


def held(rig: RigFile, parameter: str, value: float) -> float:
    """A value as the parameter's signal holds it, SI: by the very arithmetic of the codec, which decides what is a tie."""
    signal = _signal(rig, parameter)
    if signal is None:
        return value
    factor = units.UNITS[signal.unit].factor
    return (round((value / factor - signal.offset) / signal.scale) * signal.scale + signal.offset) * factor


def sent(rig: RigFile, axis: str, value: float) -> float:
    """Where along an axis the set points for `value` (m) hold the shaft at its centre of mass, as they are sent. Those of two
    bearings that are turned against each other, 20 um and 14.142, are rounded by different shares of themselves: the shaft then
    tilts too, and its centre of mass is off by the lever of each."""
    machine = conventions(rig)
    each = machine.point(axis, 1.0)
    at = {name: held(rig, name, share * value) for name, share in each.items()}
    ways = [at[name] / share for name, share in each.items()]
    if max(ways) - min(ways) <= EQUAL * abs(value):
        return sum(share * at[name] for name, share in each.items()) / sum(share**2 for share in each.values())
    parameters = machine.can.set_points.axes
    moved = [at.get(parameters.get(one, ""), 0.0) for one in machine.stations.axes]
    return float(np.linalg.solve(machine.stations.pulls, moved)[COORDINATES.index(axis)])


def asked_over_sent(rig: RigFile, axis: str, begin: float, step: float) -> float:
    """The step that was asked for over the one that was sent; 1 where the signals hold it."""
    made = sent(rig, axis, begin + step) - sent(rig, axis, begin)
    return 1.0 if abs(made - step) <= EQUAL * abs(step) else step / made


def check_sizes(rig: RigFile, plan: Plan) -> Iterator[str]:
    """Sizes that the set points of an axis cannot be sent nearly as."""
    machine = conventions(rig)
    for axis in (a for a in plan.axes if machine.can_point(a)):
        for size in plan.sizes_m:
            made = sent(rig, axis, size)
            if abs(made - size) > COARSE * abs(size):
                grains = ", ".join(f"{name} {grain(rig, name) * 1e6:.3g} um" for name in machine.point(axis, 1.0))
                yield (f"sizes_m: found {size * 1e6:.6g} um along {axis}, which is sent as {made * 1e6:.6g} um; expected what "
                       f"the signals hold within {COARSE:.0%} ({grains})")  # fmt: skip


def _signal(rig: RigFile, parameter: str) -> Signal | None:
    """Of whole numbers, that a parameter goes out by."""
    path = rig.parameters[parameter].signal if parameter in rig.parameters else ""
    signal = signal_at(rig.messages, path) if path else None
    return None if signal is None or signal.is_float or signal.unit not in units.UNITS else signal
