"""How the shaft turns during a step: its angle and speed at each sample, by whatever the rig's mark tells.

A step needs them for two things: orders of the shaft are taken out of its response, and the speed is held against the plan's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.roles import AGE, ANGLE, PULSES, SPEED, is_bound
from procedures.synchronous import mark

Samples = dict[str, npt.NDArray[Any]]
TURN = 2 * np.pi


def marked(rig: RigFile) -> tuple[str, ...]:
    """Roles that are read to tell it; none where the rig lacks one of them."""
    if not all(is_bound(rig, role) for role in mark.needed(rig)):
        return ()
    return (ANGLE, SPEED) if mark.by_angle(rig) else mark.told(rig)


def with_angle(rig: RigFile, data: Samples) -> Samples:
    """`data` of a step with the angle, whole turns counted, and the speed; a shaft that rests where the rig tells neither, as
    one that shows too few edges of its mark does but for its mean speed."""
    if ANGLE in data:
        return data
    t, count = data["t_ns"] * 1e-9, len(data["t_ns"])
    rests = {ANGLE: np.zeros(count), SPEED: np.zeros(count)}
    if PULSES not in data or count < 2:
        return rests | data
    try:
        tacho = mark.tachometer_of(rig, t, data)
    except AnalysisError:
        return rests | {SPEED: np.full(count, TURN * float(np.ptp(data[PULSES])) / float(t[-1] - t[0]))} | data
    told = {ANGLE: tacho.angle(t), SPEED: tacho.speed(t)}
    return _carried_on(t, told) | {name: x for name, x in data.items() if name not in (AGE, PULSES)}


def _carried_on(t: npt.NDArray[np.float64], told: Samples) -> Samples:
    """Before the first edge of the mark and after the last one: at the speed there."""
    known = np.flatnonzero(np.isfinite(told[ANGLE]))
    if not len(known):
        return {name: np.zeros(len(t)) for name in told}
    at = known[np.clip(np.searchsorted(known, np.arange(len(t))), 0, len(known) - 1)]
    speed = told[SPEED][at]
    return {ANGLE: told[ANGLE][at] + speed * (t - t[at]), SPEED: speed}
