"""The bare model: what leaves its place while the currents are held, in two modes at once.

The mean u of both planes' readings and half their difference d obey

    (u, d)'' = L (u, d) + f,    L = T A T^-1,  A = [[K/m, k/m], [k/J_t, K_t/J_t]],

where (u, d) = T (x, beta): x of the centre of mass, beta the tilt. K is the sum of both planes' negative stiffness, K_t that of
tilt, k = sum K_j s_j couples them (planes that differ, a centre of mass off their middle). With probes in planes +-l about a
middle from which the centre of mass is c away, T = [[1, -c], [0, l]], so

    K/m = L_uu + (c/l) L_du

whatever the forces, the start, a gain common to the probes and the bearing planes may be. The forces are constant, and go with
the held currents: f = B i + f_0, B and f_0 alike in all shots, without knowing them. The solution

    cosh(t sqrt L) z0 + sinh(t sqrt L)/sqrt L z0' + (cosh(t sqrt L) - 1)/L f

holds even functions of the root alone: power series of L t^2, whatever its eigenvalues. L is fitted to all shots, with z0
and z0' of each and B and f_0 of all projected out (Golub and Pereyra, 1973).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
TERMS = 30
ROUNDS = 40
CLOSE = 1e-7  # of L: it is found
STARTS = 4  # of a shot: place and rate of two modes


@dataclass(frozen=True)
class Shot:
    """Of one hold: u and d (n, 2) m, and what is constant meanwhile and pushes (p,), such as the mean held currents."""

    z: Array
    held: Array


@dataclass(frozen=True)
class Release:
    """`square` L (2, 2) 1/s^2 and its `covariance` (4, 4) by rows; `pushed` B and f_0 (2, p + 1), with the
    covariance of each row (2, p + 1, p + 1); fitted `curves` (n, 2) of each shot; of u and d the rms of what is `left`, and of
    the readings' `noise` by third differences, m; `dof`."""

    square: Array
    covariance: Array
    pushed: Array
    pushed_covariance: Array
    curves: tuple[Array, ...]
    left: tuple[float, float]
    noise: tuple[float, float]
    dof: int


def basis(square: Array, t: Array) -> tuple[Array, Array]:
    """What each start (n, 2, 4) and each force (n, 2, 2) gives of u and d at times (n,)."""
    power, c, s, f = np.eye(2), np.zeros((t.size, 2, 2)), np.zeros((t.size, 2, 2)), np.zeros((t.size, 2, 2))
    term = np.ones_like(t)  # t^2k/(2k)!
    for k in range(TERMS):
        c += term[:, None, None] * power
        s += (term * t / (2 * k + 1))[:, None, None] * power
        term = term * t * t / ((2 * k + 1) * (2 * k + 2))
        f += term[:, None, None] * power
        power = power @ square
    end = max(float(t[-1]), 1e-9)
    return np.concatenate([c, s / end], axis=2), f


def release(shots: Sequence[Shot], step_s: float, start: float) -> Release:
    """L of shots sampled every so many s; `start` 1/s is about its root.

    Raises:
        AnalysisError: too few shots or samples, or none that tells it.
    """
    few = min((len(s.z) for s in shots), default=0)
    if len(shots) < 8 or few < 4 * STARTS:
        raise AnalysisError(f"found {len(shots)} shots that tell anything; expected 8 or more, of {4 * STARTS} samples")
    problem = _Problem(tuple(shots), step_s, _noise(shots))
    size, before = start**2, np.inf
    square: Array = np.array([size, 0.0, 0.0, size])
    for _ in range(ROUNDS):
        left, slopes = problem.slopes(square, 1e-5 * size)
        step = np.linalg.lstsq(slopes, left, rcond=None)[0]
        step *= min(1.0, 0.3 * size / max(float(np.abs(step).max()), 1e-300))
        square = square + step
        if not np.isfinite(square).all() or np.abs(square).max() > 20 * size:
            break
        if np.abs(step).max() < CLOSE * size or abs(before - left @ left) < 1e-12 * (left @ left):
            return problem.solved(square)
        before = float(left @ left)
    raise AnalysisError("the shots do not tell how fast they leave their place: the fit does not settle")


def _noise(shots: Sequence[Shot]) -> Array:
    """Of u and d, by third differences: nothing is left of a smooth curve, of white noise 1 + 9 + 9 + 1 times its square."""
    found = np.concatenate([np.diff(s.z, n=3, axis=0) for s in shots])
    noise = np.sqrt(np.mean(found**2, axis=0) / 20)
    if not (noise > 0).all():
        raise AnalysisError("the readings do not move at all")
    return np.asarray(noise)


@dataclass(frozen=True)
class _Problem:
    """All shots, in units of their noise."""

    shots: tuple[Shot, ...]
    step_s: float
    noise: Array

    def left(self, square: Array) -> Array:
        """What no start, no force and this L explain (N,): without the starts of each, then without what the forces give."""
        y, x = self.parts(square)
        return np.asarray(y - x @ self.told(y, x)[0])

    @staticmethod
    def told(y: Array, x: Array) -> tuple[Array, Array]:
        """Terms of few columns x of many rows, and the inverse of their normal matrix."""
        scale = np.sqrt((x**2).sum(axis=0))
        scale = np.where(scale > 0, scale, 1.0)
        inverse = np.linalg.pinv((x / scale).T @ (x / scale), rcond=1e-12) / np.outer(scale, scale)
        return inverse @ (x.T @ y), inverse

    def parts(self, square: Array) -> tuple[Array, Array]:
        """Readings (N,), and what the forces of all give of them (N, 2 (p + 1)), both without the starts of each."""
        lengths = {len(s.z) for s in self.shots}
        starts, forces = basis(square.reshape(2, 2), self.step_s * np.arange(max(lengths), dtype=np.float64))
        planes = {n: np.linalg.qr((starts[:n] / self.noise[:, None]).reshape(2 * n, STARTS))[0] for n in lengths}
        given = {n: (forces[:n] / self.noise[:, None]).reshape(2 * n, 2) for n in lengths}
        given = {n: g - planes[n] @ (planes[n].T @ g) for n, g in given.items()}
        rows, columns = [], []
        for s in self.shots:
            n = len(s.z)
            y = (s.z / self.noise).reshape(-1)
            rows.append(y - planes[n] @ (planes[n].T @ y))
            columns.append((given[n][:, :, None] * np.append(s.held, 1.0)).reshape(2 * n, -1))
        return np.concatenate(rows), np.concatenate(columns)

    def slopes(self, square: Array, by: float) -> tuple[Array, Array]:
        """What is left (N,), and how that goes with L, the other way round (N, 4)."""
        each = [(self.left(square - by * e) - self.left(square + by * e)) / (2 * by) for e in np.eye(4)]
        return self.left(square), np.column_stack(each)

    def solved(self, square: Array) -> Release:
        """With its covariance, by what is left."""
        left, slopes = self.slopes(square, 1e-5 * float(np.abs(square).max()))
        forces = 2 * (len(self.shots[0].held) + 1)
        dof = left.size - STARTS * len(self.shots) - forces - 4
        variance = float(left @ left) / dof
        covariance: Array = np.asarray(np.linalg.inv(slopes.T @ slopes) * variance, np.float64)
        told, inverse = self.told(*self.parts(square))
        half = forces // 2
        each_row = np.array([inverse[:half, :half], inverse[half:, half:]]) * variance
        ends = np.cumsum([len(s.z) for s in self.shots])[:-1]
        each = np.split(left.reshape(-1, 2) * self.noise, ends)
        rms = np.sqrt(left.size / dof * np.mean(np.concatenate(each) ** 2, axis=0))
        curves = tuple(s.z - r for s, r in zip(self.shots, each, strict=True))
        noises = (float(rms[0]), float(rms[1])), (float(self.noise[0]), float(self.noise[1]))
        return Release(square.reshape(2, 2), covariance, told.reshape(2, half), each_row, curves, *noises, dof)
