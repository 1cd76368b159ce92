"""Frequency responses at the lines of a periodic injection, and the sensitivity of a loop.

The record is cut into periods of the injection. Its lines lie on the bins of a period, so that no window is needed and
nothing of one line is in another. What turns with the shaft is not periodic with it: it is taken out first. Each period gives
one value per line; their scatter about the response is its covariance. Of a line that stands alone the bins beside it tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Complex, rows
from bench.analysis.vectors import parts
from bench.errors import AnalysisError

ON_BIN = 1e-6  # of a bin: how far a line may be from one


@dataclass(frozen=True)
class Lines:
    """Per period and line: `hz` (m,), `values` (p, c, m) complex amplitudes 0-pk of c channels in p periods."""

    hz: Array
    values: Complex


@dataclass(frozen=True)
class Response:
    """Complex `values` (m,) at `hz` (m,), the covariance (m, 2, 2) of their real and imaginary parts with `dof` degrees of
    freedom; `coherence` (m,) of the two channels over the periods."""

    hz: Array
    values: Complex
    covariance: Array
    coherence: Array
    dof: float

    @property
    def u_abs(self) -> Array:
        """Standard uncertainty of abs(values), (m,)."""
        unit = parts((self.values / np.maximum(np.abs(self.values), 1e-300))[:, None])
        return np.asarray(np.sqrt(np.maximum(np.einsum("mi,mij,mj->m", unit, self.covariance, unit), 0.0)))

    def at(self, chosen: npt.ArrayLike) -> Response:
        """Some of its lines: a mask or indices."""
        k = np.asarray(chosen)
        return Response(self.hz[k], self.values[k], self.covariance[k], self.coherence[k], self.dof)


def without_orders(x: npt.ArrayLike, angle: npt.ArrayLike, orders: Sequence[float] = (1.0, 2.0)) -> Array:
    """Data (c, n) less their mean and the synchronous part at the measured `angle` (n,) rad, by least squares.

    Raises:
        AnalysisError: the angle is not known at every sample.
    """
    theta = np.asarray(angle, np.float64)
    data = rows(x, theta.size)
    if not np.isfinite(theta).all():
        raise AnalysisError("response: the shaft's angle is not known at every sample; cut the record to where it is")
    columns = [np.ones(theta.size), *(f(n * theta) for n in orders for f in (np.cos, np.sin))]
    design = np.array(columns)
    terms = np.linalg.solve(design @ design.T, design @ data.T)
    out: Array = data - terms.T @ design
    return out


def lines(x: npt.ArrayLike, rate: float, period: int, hz: npt.ArrayLike) -> Lines:
    """Amplitudes of `x` (c, n) at lines `hz` (m,) in each whole period of `period` samples.

    Raises:
        AnalysisError: a line is not on a bin of the period or not below half of `rate`, or there is no whole period.
    """
    data, wanted = rows(x), np.atleast_1d(np.asarray(hz, np.float64))
    bins = wanted * period / rate
    places = np.rint(bins).astype(np.intp)
    if (
        (np.abs(bins - places) > ON_BIN * np.maximum(bins, 1)).any()
        or (places < 1).any()
        or (places >= period / 2).any()
    ):
        raise AnalysisError(f"response: lines of {wanted} Hz do not lie on the bins of {period} samples at {rate} Hz")
    count = data.shape[1] // period
    if count < 1:
        raise AnalysisError(f"response: found {data.shape[1]} samples; expected a period of {period} or more")
    cut = data[:, : count * period].reshape(len(data), count, period)
    found = np.fft.rfft(cut, axis=2)[:, :, places] * (2 / period)
    return Lines(wanted, np.swapaxes(found, 0, 1))


def clear_of_orders(
    hz: npt.ArrayLike, speed: float, width_hz: float, orders: Sequence[float] = (1.0, 2.0)
) -> npt.NDArray[np.bool_]:
    """Which lines (m,) are farther than `width_hz` from the orders of a shaft at `speed` rad/s: the others tell nothing."""
    away = np.abs(np.asarray(hz, np.float64)[:, None] - np.asarray(orders) * speed / (2 * math.pi))
    return np.asarray((away > width_hz).all(axis=1))


def image_distance(share: float, turns: float, orders: Sequence[float] = (1.0, 2.0, 3.0, 4.0)) -> float:
    """How far, in steps, lines at `share`, 1 + `share`, ... steps stand from their images: a loop that varies with an orbit
    answers a line f also at n times the speed less f. `turns` is the shaft's speed in steps."""
    off = [(2 * share - n * turns) % 1.0 for n in orders]
    return min(min(x, 1 - x) for x in off)


def response(found: Lines, of: int, to: int, estimator: Literal["H1", "H2", "ratio"] = "H1") -> Response:
    """The response of channel `of` to channel `to` over the periods.

    H1 = sum(Y X*)/sum(X X*) is right where X has no noise, H2 = sum(Y Y*)/sum(X Y*) where Y has none; the ratio of the means is
    right for both where every period has the same injection. Covariance by the scatter of Y - H X over the periods, over the
    mean of X; with p periods it has p - 1 degrees of freedom.

    Raises:
        AnalysisError: fewer than three periods, or a line on which channel `to` has nothing.
    """
    x, y = found.values[:, to], found.values[:, of]
    p = len(x)
    if p < 3:
        raise AnalysisError(f"response: found {p} periods; expected three or more")
    xx, yy, yx = (np.abs(x) ** 2).sum(axis=0), (np.abs(y) ** 2).sum(axis=0), (y * x.conj()).sum(axis=0)
    if (xx == 0).any() or (estimator == "ratio" and (np.abs(x.mean(axis=0)) == 0).any()):
        raise AnalysisError("response: a line carries no injection")
    if estimator == "H1":
        h = yx / xx
    elif estimator == "H2":
        h = yy / yx.conj()
    else:
        h = y.mean(axis=0) / x.mean(axis=0)
    weight = (x.mean(axis=0) / np.abs(x.mean(axis=0)) ** 2) if estimator == "ratio" else None
    shares = (y - h * x) * (1 / x.mean(axis=0) / p if weight is not None else x.conj() / xx)
    moved = parts(shares[..., None])
    covariance = np.einsum("pmi,pmj->mij", moved, moved) * p / (p - 1)
    coherence = np.abs(yx) ** 2 / np.maximum(xx * yy, 1e-300)
    return Response(found.hz, h, covariance, coherence, float(p - 1))


def single_response(x: npt.ArrayLike, rate: float, period: int, hz: float, of: int, to: int) -> Response:
    """The response of channel `of` to channel `to` of `x` (c, n) where all periods have one line, at `hz`; H1.

    Covariance by the bins of the whole record to either side, half as far as where a harmonic may stand, one period's bin
    away: what is periodic is in none of them. Each is a degree of freedom, p or p - 1 of p periods. The scatter of the periods
    says twice too much where noise is far greater at other frequencies: what leaks from there into one, the next takes back.

    Raises:
        AnalysisError: as `lines` and `response`.
    """
    data = rows(x)
    r = response(lines(data, rate, period, hz), of, to)
    count = data.shape[1] // period
    found = np.fft.rfft(data[:, : count * period], axis=1)
    at = round(hz * period / rate) * count
    beside = np.r_[at - count // 2 : at, at + 1 : min(at + count // 2, (count * period - 1) // 2) + 1]
    noise = found[of, beside] - r.values * found[to, beside]
    power = float((np.abs(noise) ** 2).mean() / np.abs(found[to, at]) ** 2)
    return replace(r, covariance=power / 2 * np.eye(2)[None], dof=float(beside.size))


def complementary(sensitivity: Response) -> Response:
    """T = 1 - S: the closed loop from the injection to what is before it, with the sign turned (ISO 14839-3: Gc = -V2/E)."""
    s = sensitivity
    return Response(s.hz, 1 - s.values, s.covariance, s.coherence, s.dof)


def loop(sensitivity: Response) -> Response:
    """The open loop L = 1/S - 1; covariance by its derivative -1/S^2."""
    s = sensitivity
    slope = -1 / s.values**2
    turn = np.array([[slope.real, -slope.imag], [slope.imag, slope.real]]).transpose(2, 0, 1)
    moved = turn @ s.covariance @ turn.transpose(0, 2, 1)
    return Response(s.hz, 1 / s.values - 1, moved, s.coherence, s.dof)


def guaranteed_margins(peak: float) -> tuple[float, float, float]:
    """What max abs(S) guarantees: gain factors up S/(S - 1) and down S/(S + 1), phase margin 2 asin(1/(2 S)) in degrees."""
    if not peak > 1:
        raise AnalysisError(f"margins: found a sensitivity peak of {peak}; expected more than 1")
    return peak / (peak - 1), peak / (peak + 1), math.degrees(2 * math.asin(1 / (2 * peak)))
