"""Steps as the controller's messages can hold them.

A set point that a signal of 0.05 um holds as 10.00 um for 9.976 um ends 0.24 % beside the step that was asked for, an eighth of
the band of 2 %: of an integrator of 0.13 s that is 16 ms of settling time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.check_binding import signal_at
from procedures.amb_rotor.conventions import conventions
from procedures.step.plan import Plan
from procedures.step.position import leans

OFF = 1e-5  # of a step: 0.3 ms of settling time with the slowest integrator (0.58 s into 2 %)


def grain(rig: RigFile, parameter: str) -> float:
    """The step from one value that a parameter's signal can hold to the next, SI; 0 of one that holds all."""
    path = rig.parameters[parameter].signal
    signal = signal_at(rig.messages, path) if path else None
    if signal is None or signal.is_float or signal.unit not in units.UNITS:
        return 0.0
    return abs(signal.scale) * units.UNITS[signal.unit].factor


def held(value: float, of: float) -> float:
    """The nearest multiple of a grain; the value itself where that is all that differs."""
    near = round(value / of) * of if of else value
    return value if abs(near - value) <= OFF * abs(value) else near


def check_sizes(rig: RigFile, plan: Plan) -> Iterator[str]:
    """Sizes that the set points of an axis do not hold. Not of axes that lean: nothing is told there that hangs on it."""
    machine = conventions(rig)
    for axis in plan.axes:
        if not machine.can_point(axis) or leans(rig, axis):
            continue
        for size in plan.sizes_m:
            for name, value in machine.point(axis, size).items():
                step = grain(rig, name) if name in rig.parameters else 0.0
                if (near := held(value, step)) != value:
                    most = max(step, abs(near)) * math.copysign(1.0, value)
                    yield (f"sizes_m: found {size * 1e6:.6g} um along {axis}, for which {name} is sent as {near * 1e6:.6g} um; "
                           f"expected what its signal holds, as {most / value * size * 1e6:.6g} um "
                           f"(steps of {step * 1e6:.3g} um)")  # fmt: skip
                    break


def planned(rig: RigFile) -> Mapping[str, Any]:
    """The default sizes as the set points of every axis hold them, where they do not hold those of the plan."""
    machine, usual = conventions(rig), Plan.model_fields["sizes_m"].default
    axes = [a for a in Plan.model_fields["axes"].default if machine.can_point(a) and not leans(rig, a)]
    grains = [grain(rig, n) for a in axes for n in machine.point(a, 1.0) if n in rig.parameters]
    sizes = tuple(held(size, max(grains, default=0.0)) for size in usual)
    return {} if sizes == usual or min(sizes) <= 0 else {"sizes_m": sizes}
