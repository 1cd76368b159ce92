"""The truth of a set-point step on the AMB stand: the response of the linearised loop of `sim_backend.amb_linear`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from sim_backend import amb_linear
from sim_backend.amb_quantities import offsets
from sim_backend.core import TICK_S
from sim_backend.core.amb_params import AmbParams

Array = npt.NDArray[np.float64]


def along(p: AmbParams, axis: str) -> AmbParams:
    """The same machine about where its sensors read zero, with what its z axes have in its y axes for `axis` "z"."""
    yi, zi, yo, zo = offsets(p)
    if axis == "y":
        return dataclasses.replace(p, offset=(yi, zi, yo, zo))
    swap = (1, 1, 3, 3, 4)
    return dataclasses.replace(
        p,
        beta=tuple(p.beta[k] for k in swap),
        offset=(zi, zi, zo, zo),
        gravity_y=p.gravity_z,
        position_gain=tuple(p.position_gain[k] for k in swap),
    )


def response(p: AmbParams, settings: Mapping[str, float], law: str, axis: str, ticks: int = 3000) -> Array:
    """What the sensors read of the centre of mass (with the controller's lengths) after a unit step of its set point."""
    return np.asarray(both(p, settings, law, axis, ticks)[0])


def both(p: AmbParams, settings: Mapping[str, float], law: str, axis: str, ticks: int = 3000) -> Array:
    """(2, ticks): as `response`, and half of what the outboard reading is ahead of the inboard one."""
    p, a, b = _system(p, settings, law, axis)
    per = np.array([[1, -p.l_is], [1, p.l_os]]) * np.array([[p.position_gain[0]], [p.position_gain[2]]])
    read = np.array([_read(p, settings), (per[1] - per[0]) / 2])
    x, out = np.zeros(amb_linear.SIZE), np.zeros((2, ticks))
    for k in range(ticks):
        out[:, k] = read @ x[:2]
        x = a @ x + b
    return out


def truth(p: AmbParams, settings: Mapping[str, float], law: str, axis: str) -> dict[str, float]:
    """`damping` and `frequency` (Hz) of the oscillation that carries most of the step, `overshoot` over the whole step,
    `rise_time` s, `bandwidth` Hz (where the closed loop from set point to reading is 3 dB down)."""
    y = response(p, settings, law, axis)
    fine = np.arange(len(y)) * TICK_S
    top = int(np.argmax(y))
    rising = y[: top + 1]
    rise = float(np.interp(0.9, rising, fine[: top + 1]) - np.interp(0.1, rising, fine[: top + 1]))
    q, a, b = _system(p, settings, law, axis)
    values, vectors = np.linalg.eig(a)
    weight = (_read(q, settings) @ vectors[:2]) * np.linalg.solve(vectors, b) / np.where(values == 1, 1e-9, 1 - values)
    best = max((k for k in range(len(values)) if values[k].imag > 1e-6), key=lambda k: abs(weight[k]))
    s = np.log(values[best]) / TICK_S
    hz = np.arange(5.0, 500.0, 0.5)
    gain = np.abs(
        [_read(q, settings) @ np.linalg.solve(np.exp(2j * np.pi * f * TICK_S) * np.eye(len(a)) - a, b)[:2] for f in hz]
    )
    low = np.flatnonzero(gain < math.sqrt(0.5))
    return {
        "damping": float(-s.real / abs(s)),
        "frequency": float(abs(s) / (2 * math.pi)),
        "overshoot": float(y[top]) - 1,
        "rise_time": rise,
        "bandwidth": float(hz[low[0]]) if len(low) else 500.0,
    }


def _system(p: AmbParams, settings: Mapping[str, float], law: str, axis: str) -> tuple[AmbParams, Array, Array]:
    p = along(p, axis)
    s = dict(settings)
    if axis == "z":
        for b in "io":
            s[f"model_beta_y{b}"], s[f"model_offset_y{b}"] = s[f"model_beta_z{b}"], s[f"model_offset_z{b}"]
        s["model_gravity_y"] = s["model_gravity_z"]
    tick = amb_linear.loop(p, s, law)
    zero = np.zeros(amb_linear.SIZE)
    return p, np.array([tick(unit, 0.0) for unit in np.eye(amb_linear.SIZE)]).T, tick(zero, 1.0)


def _read(p: AmbParams, settings: Mapping[str, float]) -> Array:
    l_is, l_os = settings["model_l_is"], settings["model_l_os"]
    share = np.array([l_os, l_is]) / (l_is + l_os)
    per = np.array([[1, -p.l_is], [1, p.l_os]]) * np.array([[p.position_gain[0]], [p.position_gain[2]]])
    return np.asarray(share @ per)
