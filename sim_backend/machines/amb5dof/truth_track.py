"""The truth of a tracking test on the AMB stand: the same machine without noise and quantisation follows the same reference."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from sim_backend.core import TICK_S
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.machines.amb5dof.plant import COILS, TRACE
from sim_backend.machines.amb5dof.truth_step import RADIAL, floating

Array = npt.NDArray[np.float64]
REST_S = 3e-3  # averages at rest are over this
REVOLUTIONS = 4
POSITIVE, NEGATIVE = ([TRACE.index(f"i_{c}") for c in COILS[:8] if c.endswith(side)] for side in "pn")


def truth(
    p: AmbParams, settings: Mapping[str, float], *, hz: float, y: float, z: float, ratio: float = 1.0, speed: float = 0.0,
    settle_s: float = 3.0,
) -> dict[str, float]:  # fmt: skip
    """Every quantity of a tracking test but the distance to the rings, by its definition: `settings` hold the law; `speed` in
    rad/s; the averages are over a turn of the shaft, at rest over 3 ms."""
    plant = floating(p, settings, speed, settle_s)
    for name, value in (("hz", hz), ("y", y), ("z", z), ("ratio", ratio), ("phase", 0.0), ("ramp_s", 0.5), ("on", 1.0)):
        plant.set(f"ellipse_{name}", value)
    plant.run(round((settle_s + 0.5) / TICK_S))
    window = 2 * math.pi / speed if speed else REST_S
    ticks = round((REVOLUTIONS / hz + 2 * window) / TICK_S)
    trace = plant.run(ticks, 1)[1]
    phase = np.asarray(plant.phase - 2 * math.pi * hz * TICK_S * np.arange(ticks - 1, -1, -1), np.float64)
    wanted = np.array([y * np.sin(phase), z * np.cos(ratio * phase)])
    at = trace[:, RADIAL].T / np.array(p.position_gain)[:4, None]
    found = _centre(p, at)
    error = _averaged(np.concatenate([found[:2] - wanted, found[2:], at - np.tile(wanted, (2, 1))]), window)
    peaks = np.abs(error).max(axis=1)
    names = ("error_peak_y", "error_peak_z", "tilt_psi", "tilt_theta")
    out = dict(zip(names, peaks[:4].tolist(), strict=True)) | {"error_peak_plane": float(peaks[4:].max())}
    for k, (axis, size, turns, lead) in enumerate((("y", y, 1.0, 0.0), ("z", z, ratio, math.pi / 2))):
        out[f"error_rms_{axis}"] = float(np.sqrt((error[k] ** 2).mean()))
        amplitude, behind = _sine(turns * phase, found[k])
        out[f"amplitude_ratio_{axis}"] = amplitude / size
        out[f"phase_lag_{axis}"] = -math.remainder(behind - lead, 2 * math.pi)
    for name, columns in (("upper_current", POSITIVE), ("lower_current", NEGATIVE)):
        means = (trace[:, columns] - _told(p, columns)[0]) / _told(p, columns)[1]
        out[name] = float(means.mean(axis=0).max())
    return out


def _told(p: AmbParams, columns: list[int]) -> tuple[Array, Array]:
    """Offsets and gains of the current sensors in these columns of the trace."""
    coils = [c - TRACE.index(f"i_{COILS[0]}") for c in columns]
    return np.array(p.current_offset)[coils], np.array(p.current_gain)[coils]


def _centre(p: AmbParams, at: Array) -> Array:
    """y, z, psi, theta (4, n) of the centre of mass, as T (2.17), with the true lengths."""
    yi, zi, yo, zo = at
    theta, psi = (yo - yi) / (p.l_is + p.l_os), (zi - zo) / (p.l_is + p.l_os)
    return np.array([yi + p.l_is * theta, zo + p.l_os * psi, psi, theta])


def _averaged(x: Array, window: float) -> Array:
    """Means over a window, whose last tick counts in part where it is no whole number of them."""
    whole = int(window / TICK_S)
    kernel = np.concatenate((np.ones(whole), [window / TICK_S - whole]))
    return np.array([np.convolve(row, kernel / kernel.sum(), "valid") for row in x])


def _sine(phase: Array, x: Array) -> tuple[float, float]:
    """Amplitude and phase of what goes with sin(phase + ...)."""
    whole = (phase[-1] - phase) < 2 * math.pi * math.floor((phase[-1] - phase[0]) / (2 * math.pi))
    a = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(phase)])[whole]
    s, c, _ = np.linalg.lstsq(a, x[whole], rcond=None)[0]
    return math.hypot(s, c), math.atan2(c, s)
