"""The algebraic derivative as FIR weights: what a firmware's degree, spacing and rule make of positions. T chapter 4.

n samples after a reset, tau = n T, the estimate is a sum of weights times the samples since then. Two filters that are reset in
turn, one spacing eps = P T apart, take turns at n = P .. 2 P - 1: P rows, and a response that is periodic with eps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Rule = Literal["euler", "first-off", "exact"]
LITERAL = ("without the sign of (4.15)", "with + in (4.11)")
ALIGNED = 4000  # samples that the place in the period is found from
GAUSS = 8  # points of an interval: exact for the polynomials here


def coefficient(degree: int, p: int) -> float:
    """a_1p of T (4.15) with its factor (-1)^(n-p): K!^2/(p!^2 (K - p)!) for p <= K - 2, else K (K - 1)."""
    if p == degree - 1:
        return float(degree * (degree - 1))
    return factorial(degree) ** 2 / (factorial(p) ** 2 * factorial(degree - p))


def euler_weights(degree: int, n: int, tick_s: float) -> Array:
    """Weights (n + 1,), 1/s, of (4.13) by explicit Euler with (4.14), newest sample last.

    eta' = N eta + b(t) y with the nilpotent N, so that eta_1 after n steps is T sum_k sum_j C(n - 1 - k, j) T^j b_j(t_k) y_k,
    b_j(t) = a_1,(K-2-j) (-t)^(K-2-j).
    """
    t, left = np.arange(n) * tick_s, np.arange(n - 1, -1, -1, dtype=np.float64)
    sums, ways = np.zeros(n), np.ones(n)
    for j in range(degree - 1):
        if j:
            ways = ways * (left - j + 1) / j
        p = degree - 2 - j
        sums += np.where(left >= j, ways, 0.0) * tick_s**j * coefficient(degree, p) * (-t) ** p
    tau = n * tick_s
    out = np.zeros(n + 1)
    out[:n] = -tick_s * sums / (-tau) ** degree
    out[n] = coefficient(degree, degree - 1) / tau
    return out


def first_off_weights(degree: int, n: int, tick_s: float) -> Array:
    """The same, of positions from which the first sample after the reset is taken off."""
    out = euler_weights(degree, n, tick_s)
    out[0] -= out.sum()
    return out


def exact_weights(degree: int, n: int, tick_s: float) -> Array:
    """Weights (n + 1,) of the same estimate with its integral taken exactly of positions that are straight between samples,
    and then the least change that makes them exact for polynomials of degree K - 1."""
    x, share = np.polynomial.legendre.leggauss(GAUSS)
    u = (x + 1) / 2
    at = (np.arange(n)[:, None] + u) / n
    w = np.zeros_like(at)
    for p in range(degree - 1):
        left = degree - 2 - p
        w += coefficient(degree, p) * (1 - at) ** left / factorial(left) * (-at) ** p
    w *= -((-1.0) ** degree) * share / 2 / n
    out = np.zeros(n + 1)
    out[:-1] += (w * (1 - u)).sum(axis=1)
    out[1:] += (w * u).sum(axis=1)
    out[-1] += coefficient(degree, degree - 1)
    powers = np.vander((np.arange(n + 1) - n) / n, degree, increasing=True)
    wanted = np.zeros(degree)
    wanted[1] = 1.0
    out += np.linalg.lstsq(powers.T, wanted - powers.T @ out, rcond=None)[0]
    return np.asarray(out / (n * tick_s))


RULES: dict[Rule, Callable[[int, int, float], Array]] = {
    "euler": euler_weights, "first-off": first_off_weights, "exact": exact_weights}  # fmt: skip


@dataclass(frozen=True)
class Bank:
    """What takes turns: `rows` (P, 2 P) 1/s for P .. 2 P - 1 samples since the reset, newest sample last, at every `tick_s`."""

    rows: Array
    tick_s: float

    @property
    def spacing(self) -> int:
        """P, samples from reset to reset."""
        return len(self.rows)

    def responses(self, hz: npt.NDArray[Any]) -> Complex:
        """(P, m): the output for exp(j w t) over its derivative j w exp(j w t), by samples since the reset."""
        w = 2 * np.pi * np.asarray(hz, np.float64)
        lag = (np.arange(self.rows.shape[1]) - self.rows.shape[1] + 1) * self.tick_s
        return np.asarray((self.rows @ np.exp(1j * np.outer(lag, w))) / (1j * w))

    def error(self, hz: Array) -> Array:
        """RMS error over the derivative's rms (m,): over all samples since the reset, sidebands at hz +- n/eps included."""
        return np.asarray(np.sqrt((np.abs(self.responses(hz) - 1) ** 2).mean(axis=0)))

    @property
    def false_derivative(self) -> float:
        """Mean output per constant position, 1/s."""
        return float(self.rows.sum(axis=1).mean())

    @property
    def noise_gain(self) -> float:
        """RMS output per rms of white noise, 1/s."""
        return float(np.sqrt((self.rows**2).sum(axis=1).mean()))

    def power(self, hz: npt.NDArray[Any]) -> Array:
        """Mean square of the output per mean square of a sine at `hz` (m,), 1/s^2."""
        return np.asarray((np.abs(self.responses(hz)) ** 2).mean(axis=0) * (2 * np.pi * hz) ** 2)

    def applied(self, y: Array, at: int) -> Array:
        """Output (n - 2 P + 1,) for positions `y` (n,) from sample 2 P - 1 on; `at` is the row of that sample."""
        length, many = self.rows.shape[1], self.spacing
        windows = np.lib.stride_tricks.sliding_window_view(y, length)
        out = np.empty(len(windows))
        for k in range(min(many, len(windows))):
            out[k::many] = windows[k::many] @ self.rows[(at + k) % many]
        return out


@lru_cache(maxsize=32)
def bank(degree: int, spacing: int, rule: Rule, tick_s: float) -> Bank:
    """What a firmware with these does."""
    rows = np.zeros((spacing, 2 * spacing))
    for row, n in zip(rows, range(spacing, 2 * spacing), strict=True):
        row[2 * spacing - 1 - n :] = RULES[rule](degree, n, tick_s)
    return Bank(rows, tick_s)


def younger(degree: int, spacing: int, rule: Rule, tick_s: float) -> Bank:
    """What one does whose filters take turns the wrong way round in (4.17): always the one that was just reset,
    for which a firmware has no exact weights."""
    rows = np.zeros((spacing, 2 * spacing))
    for row, n in zip(rows[1:], range(1, spacing), strict=True):
        row[2 * spacing - 1 - n :] = RULES["first-off" if rule == "first-off" else "euler"](degree, n, tick_s)
    return Bank(rows, tick_s)


def literal(degree: int, spacing: int, rule: Rule, tick_s: float, which: str) -> Bank:
    """What one does that has an equation as it is printed (LITERAL): a_1,(K-1) is K (K + 1) without the sign of (4.15), and
    -K (K - 1) with the + of (4.11)."""
    right = bank(degree, spacing, rule, tick_s)
    more = 2.0 * degree if which == LITERAL[0] else -2.0 * degree * (degree - 1)
    rows = right.rows.copy()
    extra = more / (np.arange(spacing, 2 * spacing) * tick_s)
    rows[:, -1] += extra
    if rule == "first-off":
        rows[np.arange(spacing), np.arange(spacing - 1, -1, -1)] -= extra
    return Bank(rows, tick_s)


def aligned(rows: Array, y: Array, v: Array) -> tuple[int, float]:
    """In which row of a bank (P, L) the sample L - 1 is, and how far the velocity (n,) is from what the rows then make of the
    positions (n,), a share of the rms of either that is greater; of the first samples."""
    many, length = rows.shape
    y, v = y[: ALIGNED + length], v[: ALIGNED + length]
    every = np.lib.stride_tricks.sliding_window_view(y, length) @ rows.T
    told, k = v[length - 1 :], np.arange(len(every))
    off = [float(((every[k, (k + at) % many] - told) ** 2).mean()) for at in range(many)]
    at = int(np.argmin(off))
    scale = max(float((told**2).mean()), float((every[k, (k + at) % many] ** 2).mean()), 1e-30)
    return at, float(np.sqrt(off[at] / scale))
