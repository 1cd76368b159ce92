"""Following an ellipse with the centre of mass: what positions of two planes, read as means of ten ticks, say of it.

The reference is y = A sin(2 pi f (t - t_0)), z = B cos(2 pi n f (t - t_0)), an ellipse where n = 1. A sample of the
telemetry is the mean of n readings, the last of them one tick before its time. A sine's mean is a sine, smaller by sin(n
x/2)/(n sin(x/2)), x = 2 pi f tick, and later by (n + 1)/2 ticks: both are applied to the reference, so that like is
compared with like.

t_0 is not in the telemetry. The reference of z begins with a jump, and the coil currents of z answer it after two ticks
with the amplifiers' lag: where that answer begins is read from four samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.amb_rotor.geometry import Facts, centre, left
from procedures.tracking.points import Points, contour

Array = npt.NDArray[np.float64]
OF_STEP = 0.125  # of a reference of set points
SMOOTH_S = 3e-3  # of peaks at rest: the error of a sine of 10 Hz loses a thousandth


@dataclass(frozen=True)
class Wave:
    """The reference: `hz`, half axes `y`, `z` in m, `ratio` turns of z in one of y; and how it is sampled: `ticks` of `tick` s
    in a sample."""

    hz: float
    y: float
    z: float
    tick: float
    ticks: int
    ratio: int = 1
    spaced: int = 0  # ticks from one sample to the next, where a sample is a reading and no mean of them all

    @property
    def period(self) -> float:
        """From one sample to the next, s."""
        return self.tick * (self.spaced or self.ticks)

    @property
    def axes(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Of y and z: Hz, amplitude m, and by how much its sine leads, rad."""
        return (self.hz, self.y, 0.0), (self.ratio * self.hz, self.z, math.pi / 2)

    def shrinks(self, hz: float) -> float:
        """Amplitude of a sample's mean over that of the sine."""
        x = 2 * math.pi * hz * self.tick
        return math.sin(self.ticks * x / 2) / (self.ticks * math.sin(x / 2))

    @property
    def late(self) -> float:
        """How long before a sample's time its middle lies, s."""
        return (self.ticks + 1) / 2 * self.tick

    def at(self, t: Array, t_0: float) -> Array:
        """The reference as samples at t (n,) s would show it, (2, n) m."""
        since = 2 * math.pi * (t - self.late - t_0)
        return np.array([self.shrinks(hz) * size * np.sin(hz * since + lead) for hz, size, lead in self.axes])


@dataclass(frozen=True)
class Path:
    """One law's orbit: `t` (n,) s, `readings` (probes, n) m, `turn_s` of a turn of the shaft, 0 at rest; `points` where the
    reference is a staircase of set points."""

    wave: Wave
    t: Array
    readings: Array
    turn_s: float
    points: Points | None = None

    @property
    def smooth_s(self) -> float:
        """Over how long peaks and rms are averaged: a turn of the shaft, or a part of a step of the reference."""
        step = 0.0 if self.points is None else OF_STEP * float(np.median(np.diff(self.points.t)))
        return self.turn_s or max(SMOOTH_S, step)


def averaged(t: Array, x: Array, window: float) -> Array:
    """Running means of x (k, n) over a window about each sample; NaN where it reaches beyond the record."""
    step = np.diff(t, prepend=t[0] - np.median(np.diff(t)))
    edges = np.concatenate([[t[0] - step[0]], t])
    middle = t - step / 2
    out = np.empty_like(x)
    for row, values in zip(out, x, strict=True):
        total = np.concatenate([[0.0], np.cumsum(values * step)])
        row[:] = np.interp(middle + window / 2, edges, total) - np.interp(middle - window / 2, edges, total)
    out /= window
    out[:, (middle - window / 2 < edges[0]) | (middle + window / 2 > edges[-1])] = np.nan
    return out


def errors(path: Path, f: Facts) -> Array:
    """Error of y, z in m and the tilts psi, theta in rad, averaged over a turn of the shaft: (4, n)."""
    found = centre(path.readings, f)
    found[:2] -= path.wave.at(path.t, f.t_0)
    return averaged(path.t, found, path.smooth_s)


def positions(path: Path, f: Facts) -> Array:
    """y, z of the centre of mass in m and the tilts in rad, averaged as `errors`: (4, n)."""
    return averaged(path.t, centre(path.readings, f), path.smooth_s)


def plane_errors(path: Path, f: Facts) -> Array:
    """Errors at the n probes in m, averaged as `errors`: (n, samples)."""
    at = path.readings / np.array(f.gains)[:, None]
    return averaged(path.t, at - f.matrix[:, :2] @ path.wave.at(path.t, f.t_0), path.smooth_s)


def revolutions(path: Path) -> list[npt.NDArray[np.bool_]]:
    """Which samples belong to each whole revolution of the reference.

    Raises:
        AnalysisError: there are fewer than four.
    """
    first = path.t[0] + path.smooth_s
    count = math.floor((path.t[-1] - path.smooth_s - first) * path.wave.hz + 1e-9)
    if count < 4:
        raise AnalysisError(f"found {count} whole revolutions of the reference; expected four or more")
    return [(path.t >= first + k / path.wave.hz) & (path.t < first + (k + 1) / path.wave.hz) for k in range(count)]


@dataclass(frozen=True)
class Turns:
    """Each whole revolution of the reference (m of them): `errors` (m, 4, k) of y, z in m and the tilts psi, theta in rad at k
    equal parts of it, `planes` (m, n, k) m at the sensors, `follows` (m, 2) what y and z do over what they should at the
    reference's frequency, and `left` (m,) m to the rings. Revolutions are alike: noise is what differs between them."""

    errors: Array
    planes: Array
    follows: npt.NDArray[np.complex128]
    left: Array

    def without(self, some: npt.NDArray[np.bool_]) -> Turns:
        """The other revolutions."""
        return Turns(self.errors[~some], self.planes[~some], self.follows[~some], self.left[~some])


def turns(path: Path, f: Facts) -> Turns:
    """The revolutions of a path."""
    per = revolutions(path)
    room = left(path.readings, f)
    stepped = path.points is not None
    both = positions(path, f) if stepped else np.concatenate([errors(path, f), plane_errors(path, f)])
    period = path.wave.period
    parts = np.arange(round(1 / path.wave.hz / period)) * period
    grid = np.array([path.t[m][0] for m in per])[:1] + np.arange(len(per))[:, None] / path.wave.hz + parts
    folded = np.array([np.interp(grid, path.t, row) for row in both]).transpose(1, 0, 2)
    return Turns(
        folded[:, :4],
        folded[:, 4:],
        followed(path, f)[1],
        np.array([float(room[m].min()) for m in per]),
    )


def followed(path: Path, f: Facts) -> tuple[Array, npt.NDArray[np.complex128]]:
    """Of each whole revolution of the reference: its middle (m,) s, and what y and z do over what they should (m, 2).

    Raises:
        AnalysisError: there are fewer than four.
    """
    per, q = revolutions(path), centre(path.readings, f)
    follows = [[_follows(path, f, q[k, m], m, axis) for k, axis in enumerate(path.wave.axes)] for m in per]
    return np.array([path.t[m].mean() for m in per]), np.array(follows)


def _follows(path: Path, f: Facts, x: Array, m: npt.NDArray[np.bool_], axis: tuple[float, float, float]) -> complex:
    if path.points is not None:
        return _follows_points(path.points, path, f, x, m, path.wave.axes.index(axis))
    hz, size, lead = axis
    turn = 2 * math.pi * hz * (path.t[m] - path.wave.late - f.t_0) + lead
    sine, cosine, _ = np.linalg.lstsq(np.column_stack([np.sin(turn), np.cos(turn), np.ones_like(turn)]), x, rcond=None)[
        0
    ]
    return complex(sine, cosine) / (size * path.wave.shrinks(hz))


def _follows_points(points: Points, path: Path, f: Facts, x: Array, m: npt.NDArray[np.bool_], axis: int) -> complex:
    """The first harmonic of what was read over that of the staircase."""
    hz, t = path.wave.hz, path.t[m] - path.wave.late
    turn = 2 * math.pi * hz * t
    cosine, sine, _ = np.linalg.lstsq(np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(turn)]), x, rcond=None)[
        0
    ]
    begin = float(t[0])
    asked = points.harmonic(begin, begin + 1 / hz, hz, f.t_0)[axis]
    return complex(complex(cosine, -sine) / asked / path.wave.shrinks(hz))


def of_points(turns: Turns, wave: Wave) -> dict[str, float]:
    """As `quantities`, where the reference is a staircase: how far the mean revolution is off the ellipse, along its normal, in
    the place of errors in time."""
    mean, follows = turns.errors.mean(axis=0), turns.follows.mean(axis=0)
    off = contour(mean[0], mean[1], wave.y, wave.z)
    spread = float(turns.errors[:, :2].var(axis=0, ddof=1).mean()) / len(turns.errors)
    out = {"contour_peak": float(np.abs(off).max()),
           "contour_rms": math.sqrt(max(float((off**2).mean()) - spread, 0.0))}  # fmt: skip
    out |= dict(zip(("tilt_psi", "tilt_theta"), np.abs(mean[2:]).max(axis=1).tolist(), strict=True))
    for k, axis in enumerate("yz"):
        out[f"amplitude_ratio_{axis}"], out[f"phase_lag_{axis}"] = abs(follows[k]), -float(np.angle(follows[k]))
    return out | {"ring_distance": float(turns.left.min())}


def quantities(turns: Turns) -> dict[str, float]:
    """Of the mean revolution: peaks and rms of the errors, peaks of the tilts, ratio of the amplitudes, phase lag rad; and the
    least that is left to the rings in any. The peak of a mean is freed of what noise adds to the peak of each."""
    mean, planes, follows = (x.mean(axis=0) for x in (turns.errors, turns.planes, turns.follows))
    names = ("error_peak_y", "error_peak_z", "tilt_psi", "tilt_theta")
    out = dict(zip(names, np.abs(mean).max(axis=1).tolist(), strict=True))
    out["error_peak_plane"] = float(np.abs(planes).max())
    spread = turns.errors.var(axis=0, ddof=1).mean(axis=1) / len(turns.errors)
    for k, axis in enumerate("yz"):
        out[f"error_rms_{axis}"] = math.sqrt(max(float((mean[k] ** 2).mean() - spread[k]), 0.0))
        out[f"amplitude_ratio_{axis}"], out[f"phase_lag_{axis}"] = abs(follows[k]), -float(np.angle(follows[k]))
    return out | {"ring_distance": float(turns.left.min())}
