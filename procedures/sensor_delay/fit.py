"""The bare model: phases of positions against the currents that push, all of them at once.

A shaft that magnets hold by currents i of all planes and directions obeys, without damping, M x'' - K x = B i with real
matrices: at a frequency x = G i, G real, whatever couples the planes, turns the directions or scales the readings. A probe that
tells its position a time tau late reads x e^(-j w tau). Sines into every loop in turn give phasors X (probes, sines) and
I (currents, sines), and each row of

    H = X I^-1 = diag(e^(-j w tau)) G

has one phase: half of that of the sum of its squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.position_loops.lines import without_trend
from procedures.shared.leastsquares import Fit, linear

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
BESIDE = 12  # bins on either side of a line that tell its noise


@dataclass(frozen=True)
class Line:
    """At `hz`: `phase` (probes,) rad by which each reading is behind, with standard uncertainties `u`; how far the currents of
    the sines are from each other's, `condition`; degrees of freedom of the noise."""

    hz: float
    phase: Array
    u: Array
    condition: float
    dof: float


def line(hz: float, positions: Sequence[Array], currents: Sequence[Array], periods: int) -> Line:
    """Of as many sines as there are probes: of each readings (probes, n) and (currents, n) in whole periods."""
    of_x, left_x = _phasors(positions, periods)
    of_i, left_i = _phasors(currents, periods)
    condition = float(np.linalg.cond(of_i))
    inverse = np.linalg.pinv(of_i)
    answer = of_x @ inverse
    n = left_x.shape[-1]
    bins = np.arange(max(2, periods - BESIDE), min(periods + BESIDE + 1, n // 2))
    bins = bins[bins % periods != 0]
    beside = (np.fft.rfft(left_x)[..., bins] - np.einsum("pc,scb->spb", answer, np.fft.rfft(left_i)[..., bins])) * 2 / n
    u_x = np.sqrt(np.mean(np.abs(beside) ** 2, axis=-1) / 2).T  # (probes, sines), either part
    weight = 1 / np.maximum((u_x**2) @ (np.abs(inverse) ** 2), 1e-300)  # (probes, currents)
    phase = -np.angle((weight * answer**2).sum(axis=1)) / 2
    size = (weight * np.abs(answer) ** 2).sum(axis=1)
    slope = (weight * np.conj(answer)) @ inverse.T  # (probes, sines)
    u = np.sqrt(((u_x * np.abs(slope)) ** 2).sum(axis=1)) / size
    return Line(hz, phase, u, condition, 2.0 * bins.size)


def _phasors(sines: Sequence[Array], periods: int) -> tuple[Complex, Array]:
    """(channels, sines), and what is left of each (sines, channels, n)."""
    found = [[without_trend(one, periods) for one in channels] for channels in sines]
    phasors = np.array([[phasor for phasor, _ in channels] for channels in found]).T
    return phasors, np.array([[left for _, left in channels] for channels in found])


@dataclass(frozen=True)
class Delay:
    """Fitted of a probe: `seconds`, standard uncertainty `u`, and by how much a low-pass in the place of a delay would differ,
    `bend` s."""

    seconds: float
    u: float
    bend: float
    fit: Fit


def delay(hz: npt.ArrayLike, phase: npt.ArrayLike, u: npt.ArrayLike) -> Delay:
    """Of `phase` (n,) rad behind, at `hz` (n,): phase = w tau, or its tangent for a low-pass of first order."""
    w, seen, scatter = (np.asarray(a, np.float64) for a in (hz, phase, u))
    w = 2 * np.pi * w
    found = linear(w[:, None], seen, scatter**2)
    low_pass = linear(w[:, None], np.tan(seen), (scatter / np.cos(seen) ** 2) ** 2)
    return Delay(float(found.terms[0]), float(found.u[0]), abs(float(low_pass.terms[0] - found.terms[0])), found)
