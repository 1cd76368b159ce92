"""The shaft's angle by its mark: from what the controller tells of it to pulses with their times.

A controller tells the count of the mark's edges and, of the last one, either the angle since, at a speed, or its time on the
device's clock. Between two edges the angle goes on by their spacing (`bench.analysis.tachometer`): at a sample that was read at
t it is 2 pi (t - t_edge) times the turns in a second, and more where the shaft speeds up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.analysis.tachometer import Tachometer, age, counted, fresh, tachometer
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.roles import AGE, ANGLE, EDGE, PULSES, SPEED, is_bound, resolution_s, resolved, wraps_at

Array = npt.NDArray[np.float64]
LSB_RAD = 2 * np.pi / 65536  # of the angle in the telemetry


def by_angle(rig: RigFile) -> bool:
    """Whether the angle since the mark is told; else the time of its last edge must be."""
    return is_bound(rig, ANGLE) and is_bound(rig, SPEED)


def needed(rig: RigFile) -> tuple[str, ...]:
    """Roles that must be bound."""
    return (ANGLE, SPEED, PULSES) if by_angle(rig) else (EDGE, PULSES)


def told(rig: RigFile) -> tuple[str, ...]:
    """Roles that are read."""
    return (ANGLE, SPEED, PULSES) if by_angle(rig) else (AGE, PULSES)


def tachometer_of(rig: RigFile, t: Array, data: Mapping[str, Array]) -> Tachometer:
    """Of samples at times `t` (n,) s and what they tell by role.

    Raises:
        AnalysisError: too few pulses, or a count that runs backwards.
    """
    if by_angle(rig):  # as it was when the last reading was made, a tick before the sample's time
        tick = rig.devices["controller"].tick_s
        return tachometer(*counted(t - tick, data[PULSES], age(data[ANGLE], data[SPEED])))
    pulses = counted(t, data[PULSES], data[AGE], round(wraps_at(rig, resolved(rig, [PULSES])[0])))
    return replace(tachometer(*pulses, resolution_s(rig)), fresh=fresh(t, data[PULSES], data[AGE]))


def of_clock(tachos: Sequence[Tachometer], tick_s: float, where: str = "") -> Iterator[Finding]:
    """An edge that a sample of the telemetry counts first came since the sample before: by one clock no two of them differ in
    age by more than the samples are apart, and by a tick where count and time are not read at once. Ticks that are not as long
    as the rig file says let the ages drift, and every phase with them."""
    seen = [tacho.fresh for tacho in tachos if tacho.fresh is not None]
    if not seen:
        return
    least, most, apart = min(f.least for f in seen), max(f.most for f in seen), max(f.apart for f in seen)
    if most - least > apart + tick_s:
        text = (f"at the first sample that counts it an edge of the mark is {least * 1e6:.0f} to {most * 1e6:.0f} µs old, and "
                f"samples are {apart * 1e6:.0f} µs apart: its time and the telemetry's ticks do not run alike, and every phase "
                "drifts. Is devices.controller.tick_s told by all its digits (15 kHz: 6.666666666666667e-5), and does the "
                "signal of mark.edge have the unit that the DBC says?")  # fmt: skip
        yield Finding("mark-clock", text, where, Effect.ERROR)


def angle_u(rig: RigFile, rad_s: float) -> float:
    """Standard uncertainty of the angle at a speed, rad: half a step of the angle, or a step of the edge's time, which may be
    rounded or cut off."""
    if by_angle(rig):
        return LSB_RAD / float(np.sqrt(12))
    return abs(rad_s) * resolution_s(rig) / float(np.sqrt(3))
