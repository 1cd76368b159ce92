"""The truth of a tracking test of a rig's twin by set points: the same machine without noise and rounding follows the same
staircase, and is looked at tick by tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.twin.quiet import Floating, Sight, floating
from sim_backend.motion import Numbers, OrbitAsked

Array = npt.NDArray[np.float64]
GROW, GROW_S = 25, 0.04  # steps in which the reference grows
REVOLUTIONS = 3  # that are looked at, after one
OF_STEP, LEAST_S = 0.125, 3e-3  # positions are averaged over a share of a step of the staircase
FINE = 20000  # points of the ellipse


def orbit(rig: RigFile, drawn: Truth, asked: OrbitAsked) -> dict[str, float]:
    """Every quantity of a tracking test by set points but the distance to the rings; nothing of a path of the controller."""
    if asked.at is None:
        return {}
    slew = rig.capabilities.set_points.slew
    settings: Mapping[str, float] = {**asked.settings, **({slew: 0.0} if slew else {})}
    made = floating(rig, drawn, settings)
    sight = Sight(rig, made.plant.params, drawn.values)
    trace, told = _followed(made, asked, asked.at)
    found = sight.centre(trace)
    dt, turns = made.plant.tick_s, np.arange(len(trace)) * 2j * np.pi * asked.hz * made.plant.tick_s
    whole = round(REVOLUTIONS / asked.hz / dt)
    begin = len(trace) - whole
    wave = np.exp(-turns[begin:])
    out: dict[str, float] = {}
    for axis, x, of in zip("yz", found, told, strict=False):
        ratio = (wave @ x[begin:]) / (wave @ of[begin:])
        out |= {f"amplitude_ratio_{axis}": float(abs(ratio)), f"phase_lag_{axis}": -float(np.angle(ratio))}
    window = max(LEAST_S, OF_STEP / (asked.hz * asked.points))
    held = np.array([_averaged(x, window / dt)[-whole:] for x in found])
    off = _outside(held[0], held[1], asked.y, asked.z)
    out |= {"contour_peak": float(np.abs(off).max()), "contour_rms": float(np.sqrt((off**2).mean()))}
    return out | {f"tilt_{axis}": float(np.abs(x).max()) for axis, x in zip(("psi", "theta"), held[2:], strict=True)}


def _followed(made: Floating, asked: OrbitAsked, at: Callable[[float, float], Numbers]) -> tuple[Array, Array]:
    """Readings of the ticks (n, m), and the set points of y and z (2, n) m as they stood at each."""
    plant = made.plant
    for part in range(1, GROW + 1):
        made.write(at(0.0, asked.z * part / GROW))
        plant.run(round(GROW_S / plant.tick_s))
    plant.run(round(asked.settle_s / plant.tick_s))
    count = asked.points * (REVOLUTIONS + 1)
    ends = np.rint(np.arange(count + 1) / (asked.hz * asked.points) / plant.tick_s).astype(int)
    traces, told = [], []
    for k, ticks in enumerate(np.diff(ends)):
        turn = 2 * math.pi * k / asked.points
        point = asked.y * math.sin(turn), asked.z * math.cos(turn)
        made.write(at(*point))
        traces.append(plant.run(int(ticks), 1)[1])
        told.append(np.repeat(np.array(point)[:, None], int(ticks), axis=1))
    return np.concatenate(traces), np.concatenate(told, axis=1)


def _averaged(x: Array, ticks: float) -> Array:
    """Means over so many ticks, which need not be whole."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    ends = np.arange(math.ceil(ticks), len(total)).astype(np.float64)
    begins = np.interp(ends - ticks, np.arange(len(total)), total)
    return np.asarray((total[math.ceil(ticks) :] - begins) / ticks)


def _outside(y: Array, z: Array, half_y: float, half_z: float) -> Array:
    """How far points (n,) are outside an ellipse, below zero inside it: the distance to the nearest of FINE points of it."""
    from scipy.spatial import cKDTree  # what follows nothing starts without it

    turn = np.linspace(0, 2 * math.pi, FINE, endpoint=False)
    far = cKDTree(np.column_stack([half_y * np.sin(turn), half_z * np.cos(turn)])).query(np.column_stack([y, z]))[0]
    return np.asarray(np.where((y / half_y) ** 2 + (z / half_z) ** 2 > 1, far, -far))
