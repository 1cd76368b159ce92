"""From the sensitivity at the lines to its greatest value with an interval."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.analysis.rational import Rational, Top, averaged, fitted, orders, top
from bench.analysis.responses import Response, image_distance
from bench.uncertainty import Estimate, Influence
from procedures.sensitivity.margins import UNEXPLAINED, hides, margins, merged
from procedures.sensitivity.steps import HALF, MODE, REFINED, SCAN, SURVEY, WIRING, Taken, name_speed, shared_noise

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FINEST, COARSEST = 1.0, 4.0  # Hz, of a refined grid: four periods must fit into the controller's memory
IN_WIDTH = 6  # lines in the half-power width of a refined peak, at least
REACH = (
    2 / 3
)  # of that width, to either side: farther out the next resonance bends the curve, and few poles do not follow
LEAST = 6  # steps to either side of it, at least
RIVAL = 0.85  # of the greatest: another maximum that is refined too
CANDIDATES = 3
FEWEST = 8  # lines that a resonance is looked for in
NEAR = 0.3  # of a frequency: how far the lines reach that a first look is fitted to


@dataclass(frozen=True)
class Candidate:
    """Where a greatest sensitivity may be, Hz, and the half-power width of its resonance."""

    hz: float
    width: float

    def lines(self, speed: float) -> tuple[float, float, int]:
        """First line, step and number of a grid about it, six lines or more in its width. Where the shaft turns the
        grid is shifted away from what its orbit makes of the injection, lines at n times the speed less the line's own."""
        step = min(max(binary(self.width / IN_WIDTH), FINEST), COARSEST)
        reach = max(REACH * self.width, LEAST * step)
        first = max(step * math.floor((self.hz - reach) / step), step)
        if speed and step >= COARSEST:
            turns = speed / (2 * math.pi * step)
            first += step * max((0.25, 0.5, 0.75, 0.0), key=lambda share: image_distance(share, turns))
        return first, step, min(math.floor((self.hz + reach - first) / step) + 1, 128)


@dataclass(frozen=True)
class Peak:
    """A peak that was refined: the lines about it with the likeliest model, its greatest value by all that explain them, least
    coherence where |S| is above 0.7 of it; `change`, relative, of |S| there at half the amplitude, with its standard
    uncertainty."""

    taken: Taken
    model: Rational
    top: Top
    coherence: float
    change: float
    u_change: float


@dataclass(frozen=True)
class Result:
    """One axis at one speed: `curve`, all lines in order; the peaks, the greatest first; estimates by name; lines about bending
    modes that hide how far the gain may rise."""

    axis: str
    speed: float
    taken: tuple[Taken, ...]
    curve: Response
    peaks: tuple[Peak, ...]
    estimates: Mapping[str, Estimate] = field(repr=False)
    hidden: tuple[Taken, ...] = ()

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.axis}, {name_speed(self.speed)}"

    @property
    def excluded(self) -> list[float]:
        """Lines in Hz that were left out beside the shaft's orders."""
        return sorted({float(hz) for t in self.taken for hz in t.excluded})


def binary(x: float) -> float:
    """The greatest power of two that is not above `x`: lines on such a grid repeat after whole samples."""
    return float(2.0 ** math.floor(math.log2(x)))


def candidates(
    seen: Sequence[Response], octaves: bool = False, about_modes: Sequence[Response] = ()
) -> list[Candidate]:
    """Where a survey peaks, the greatest first, and those that come near it; `octaves`: its lines stand that far apart.
    A lightly damped mode peaks between the lines `about_modes`: there their model is asked."""
    if not seen:
        return []
    hz, z, power = merged([(r, shared_noise(r, octaves)) for r in seen])
    tops = [t for r in about_modes if (t := mode_top(r, shared_noise(r))) is not None and t.inside]
    free = np.ones(hz.size, bool)
    for r in about_modes:
        free &= (hz < r.hz[0]) | (hz > r.hz[-1])
    size = np.where(free, np.abs(z) - np.sqrt(power), 0.0)
    out: list[Candidate] = []
    while free.any() and len(out) < CANDIDATES:
        k = int(np.flatnonzero(free)[size[free].argmax()])
        if out and size[k] + 3 * math.sqrt(power[k]) < RIVAL * size.max():
            break
        found = _looked(hz, z, power, k)
        out.append(found)
        free &= np.abs(hz - found.hz) > 2 * found.width
        free[k] = False
    lasting = [t for t in tops if t.value > RIVAL * size.max() and math.isfinite(t.width)]
    return [*out, *(Candidate(t.at, t.width) for t in lasting)]


def mode_top(r: Response, power: Array) -> Top | None:
    """The greatest abs of the model of lines about a bending mode; None of too few."""
    if r.hz.size < FEWEST:
        return None
    return top(fitted(r.hz, r.values, power, math.inf), float(r.hz[0]), float(r.hz[-1]))


def _looked(hz: Array, z: Complex, power: Array, k: int) -> Candidate:
    """A first look at the resonance about line `k`: by a model of the lines near it."""
    reach = max(NEAR * hz[k], hz[min(k + 6, hz.size - 1)] - hz[k])
    near = np.abs(hz - hz[k]) <= reach
    if near.sum() < FEWEST:
        return Candidate(float(hz[k]), float(NEAR * hz[k]))
    model = fitted(hz[near], z[near], power[near], math.inf)
    at = top(model, float(hz[near][0]), float(hz[near][-1]))
    if not at.inside:  # at an end of its lines, of which none is greater than `k`, or which is refined already
        return Candidate(float(hz[k]), float(NEAR * hz[k]))
    step = float(np.diff(hz[near]).min())
    width = min(max(model.width(at.at), step / 2), 0.6 * at.at)
    return Candidate(at.at, width if math.isfinite(width) else NEAR * at.at)


def results(taken: Sequence[Taken]) -> list[Result]:
    """By axis and speed, in the order in which they were taken."""
    groups: dict[tuple[str, float], list[Taken]] = {}
    for t in taken:
        groups.setdefault((t.axis, t.speed), []).append(t)
    return [_result(axis, speed, some) for (axis, speed), some in groups.items()]


def _result(axis: str, speed: float, taken: Sequence[Taken]) -> Result:
    found = sorted(found_peaks(taken), key=lambda p: -p.top.value)
    where = f"{axis}/{name_speed(speed)}"
    estimates: dict[str, Estimate] = {}
    if found:
        best = found[0]
        dof = best.taken.dof
        estimates["s_max"] = _typed(
            best.top.value, best.top.u, "1", f"{where}/s_max", "noise of the lines, at the peak", dof
        )
        estimates["s_max_hz"] = _typed(
            best.top.at, best.top.u_at, "Hz", f"{where}/s_max_hz", "scatter of the peak's place", dof
        )
    wide = [t for t in taken if t.kind == SURVEY or (t.kind == REFINED and t.step_hz == 0)]  # lines of sines are few
    modes = [t for t in taken if t.kind == MODE]
    estimates |= margins(wide, where, modes)
    hidden: list[Taken] = []
    if told := estimates.get("gain_increase"):
        hidden = [t for t in modes if hides(t, 1 / told.value, UNEXPLAINED / len(modes))]
    if hidden:
        del estimates["gain_increase"]
    return Result(axis, speed, tuple(taken), joined_curve(taken), tuple(found), estimates, tuple(hidden))


def _typed(value: float, u: float, unit: str, identity: str, name: str, dof: float) -> Estimate:
    return Estimate.of(value, Influence(f"scatter/{identity}", name, u, unit, "A", "normal", max(dof, 1.0)))


def found_peaks(taken: Sequence[Taken]) -> Iterator[Peak]:
    """What was refined, each with its model."""
    for t in taken:
        if t.kind != REFINED or t.response.hz.size < FEWEST:
            continue
        r = t.response
        models = orders(r.hz, r.values, t.noise, t.dof)
        at = averaged(models, float(r.hz[0]), float(r.hz[-1]))
        high = np.abs(r.values) > 0.7 * at.value
        half = next((h for h in taken if h.kind == HALF and h.about == t.about), None)
        change, u = _change(t, half, high) if half is not None else (0.0, math.inf)
        yield Peak(t, models[0], at, float(r.coherence[high].min()) if high.any() else 0.0, change, u)


def _change(t: Taken, half: Taken, high: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """How much greater |S| is at half the amplitude, relative, over the lines about the peak; with its standard uncertainty."""
    if half.response.hz.shape != t.response.hz.shape or not high.any():
        return 0.0, math.inf
    a, b = t.response.values[high], half.response.values[high]
    noise = (t.noise[high] + half.noise[high]) / np.abs(a) ** 2 / 2
    return float(np.real(b / a - 1).mean()), float(np.sqrt(noise.sum()) / noise.size)


def joined_curve(taken: Sequence[Taken]) -> Response:
    """All lines at the full amplitude; where passes overlap, the finest of them."""
    some = [t for t in taken if t.kind not in (WIRING, HALF)]
    finer: Mapping[str, tuple[str, ...]] = {SURVEY: (SCAN, MODE, REFINED), SCAN: (MODE, REFINED)}
    parts = []
    for t in some:
        r = t.response
        covered = np.zeros(r.hz.size, bool)
        for other in (o.response.hz for o in some if o.kind in finer.get(t.kind, ()) and o.response.hz.size):
            covered |= (r.hz >= other[0]) & (r.hz <= other[-1])
        parts.append(r.at(~covered))
    hz = np.concatenate([r.hz for r in parts])
    order = np.argsort(hz, kind="stable")
    values, covariance, coherence = (
        np.concatenate([getattr(r, n) for r in parts])[order] for n in ("values", "covariance", "coherence")
    )
    return Response(hz[order], values, covariance, coherence, min(r.dof for r in parts))
