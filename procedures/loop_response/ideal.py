"""What a loop would be with an actuator that gives at once what it is asked for, and an observer that is right: computed from
the rig file's gains and masses, not measured."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import InjectedLoop
from bench.rigfile.places import Places
from bench.uncertainty import Estimate
from procedures.loop_response import fit
from procedures.loop_response.injection import ability, told
from procedures.loop_response.plan import Plan
from procedures.shared.certificates import certified

Array = npt.NDArray[np.float64]
RANGE_HZ = (1.0, 2e4)
STEP = 1e-3  # of a number, by which its influence is told


def gain(hz: npt.ArrayLike, inertia: float, stiffness: float, kp: float, ki: float, kd: float) -> Array:
    """|y/r| with the reference's rate fed: |C/(M s^2 - K + C)|, C = k_D s + k_P + k_I/s, of `hz` (m,); M kg or kg m^2, the
    negative stiffness K N/m or N m/rad, gains per m or rad."""
    s = 2j * np.pi * np.asarray(hz, np.float64)
    law = kd * s + kp + ki / s
    out: Array = np.abs(law / (inertia * s * s - stiffness + law))
    return out


def numbers(rig: RigFile, plan: Plan, axis: str) -> tuple[Estimate, Estimate, tuple[float, float, float]] | None:
    """What a loop moves, the negative stiffness that it holds against, and its gains; None where they are not told."""
    loop: InjectedLoop = ability(rig).loops[axis]
    gains = [told(rig, plan, name) for name in (loop.kp, loop.ki, loop.kd)]
    if not loop.inertia or any(g is None for g in gains):
        return None
    known = Places(rig).known
    inertia = certified(loop.inertia, known[loop.inertia]) * loop.share
    stiffness = certified(loop.stiffness, known[loop.stiffness]) if loop.stiffness else Estimate.exact(0.0, "N/m")
    kp, ki, kd = (g for g in gains if g is not None)
    return inertia, stiffness, (kp, ki, kd)


def bandwidth(rig: RigFile, plan: Plan, axis: str) -> Estimate | None:
    """Where |y/r| would fall through -3 dB, Hz, with what mass and stiffness are uncertain by; None where it cannot be told."""
    found = numbers(rig, plan, axis)
    if found is None:
        return None
    inertia, stiffness, gains = found
    at = _falls(inertia.value, stiffness.value, gains)
    if not math.isfinite(at):
        return None
    out = Estimate.exact(at, "Hz")
    for k, one in enumerate((inertia, stiffness)):
        if not one.value:
            continue
        moved = [x.value * (1 + STEP * (j == k)) for j, x in enumerate((inertia, stiffness))]
        out = out + (one - one.value) * ((_falls(moved[0], moved[1], gains) - at) / (STEP * one.value))
    return out


def of_values(rig: RigFile, plan: Plan, axis: str, values: Mapping[str, float]) -> float | None:
    """The same of numbers that are known, by the rig file's tables and names: `machine.mass`; None where it cannot be told."""
    found, loop = numbers(rig, plan, axis), ability(rig).loops[axis]
    if found is None:
        return None
    inertia = values[loop.inertia.replace("/", ".")] * loop.share
    stiffness = values[loop.stiffness.replace("/", ".")] if loop.stiffness else 0.0
    return _falls(inertia, stiffness, found[2])


def _falls(inertia: float, stiffness: float, gains: tuple[float, float, float]) -> float:
    return fit.falls_at(lambda hz: gain(hz, inertia, stiffness, *gains), *RANGE_HZ)


def misfit(rig: RigFile, plan: Plan, axis: str, shares: npt.ArrayLike) -> float:
    """By which share a cubic through the ideal curve, at lines that stand `shares` (m,) of its bandwidth, misses that: how
    much interpolating may be wrong by. 0 where the ideal curve is not told."""
    found, at = numbers(rig, plan, axis), bandwidth(rig, plan, axis)
    if found is None or at is None:
        return 0.0
    hz = np.asarray(shares, np.float64) * at.value
    sizes = gain(hz, found[0].value, found[1].value, *found[2])
    return abs(fit.crossing(hz, sizes, 1e-3 * sizes).hz / at.value - 1)
