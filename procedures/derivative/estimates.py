"""From captures to estimates: the estimator's response at each line, its band, what it makes of a constant and of noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from procedures.derivative import fit
from procedures.derivative.plan import Plan
from procedures.derivative.steps import OFFSET, QUIET, Taken, lines_of
from procedures.one_axis.bank import Bank, aligned

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Line:
    """One injected sine: what was found of it, and the weights' own error."""

    taken: Taken
    found: fit.Places
    own_error: float


@dataclass(frozen=True)
class Result:
    """Lines by frequency, estimates by line and for the whole, the weights asked for, and how far each capture's velocity is
    from what these make of its own positions, a share of the rms."""

    bank: Bank
    lines: tuple[Line, ...]
    by_line: Mapping[str, Mapping[str, Estimate]]
    whole: Mapping[str, Estimate]
    mismatch: Mapping[str, float]


def evaluate(taken: Sequence[Taken], asked: Bank, plan: Plan, harmonic_hz: float) -> Result:
    """Every estimate.

    Raises:
        AnalysisError: a capture is too short.
    """
    lines = [_line(t, asked, plan, harmonic_hz) for t in lines_of(taken)]
    by_line = {line.taken.where: _of_line(line) for line in lines}
    mismatch = {t.where: aligned(asked.rows, t.y, t.v)[1] for t in taken}
    whole = (
        _edges(lines, asked, plan)
        | _false_derivative(taken, asked, plan)
        | _noise_gain(taken, asked, plan, harmonic_hz)
    )
    return Result(asked, tuple(lines), by_line, whole, mismatch)


def _line(t: Taken, asked: Bank, plan: Plan, harmonic_hz: float) -> Line:
    found = fit.places(t.y, t.v, t.hz, harmonic_hz, asked.spacing, t.tick_s, plan.blocks)
    return Line(t, found, float(asked.error(np.array([t.hz]))[0]))


def _of_line(line: Line) -> dict[str, Estimate]:
    where, each = line.taken.where, line.found.gain
    mean, count = complex(each.mean()), len(each)
    turned = each * np.conj(mean) / abs(mean)
    gain = _typed(abs(mean), turned.real.std(ddof=1) / math.sqrt(count), "1", f"gain/{where}", count)
    phase = _typed(
        float(np.angle(mean)), turned.imag.std(ddof=1) / math.sqrt(count) / abs(mean), "rad", f"phase/{where}", count
    )
    out = {"gain": gain, "phase": phase}
    for name, (value, u) in (("error", line.found.error), ("sideband", line.found.sideband)):
        out[name] = _typed(value, u, "1", f"{name}/{where}", count)
    return out


def _typed(value: float, u: float, unit: str, identity: str, count: int) -> Estimate:
    return Estimate.of(
        value, Influence(f"scatter/{identity}", "scatter of the stretches", float(u), unit, "A", "normal", count - 1)
    )


def _edges(lines: Sequence[Line], asked: Bank, plan: Plan) -> dict[str, Estimate]:
    """Where the error crosses the limit, and what it is at `at_hz`: the weights' own curve, times the ratio of the measured
    error to it, which goes evenly over the logarithm of the frequency from one line to the next."""
    hz = np.array([line.taken.hz for line in lines])
    pairs = [line.found.error for line in lines]
    if len(lines) < 2 or min(value for value, _ in pairs) <= 0:
        return {}  # one is lost in its noise
    ratios = [
        _typed(value, u, "1", f"error/{line.taken.where}", plan.blocks) * (1 / line.own_error)
        for line, (value, u) in zip(lines, pairs, strict=True)
    ]
    fine = np.geomspace(hz[0], hz[-1], 4001)
    own = asked.error(fine)
    middle = np.array([r.value for r in ratios])
    curve = own * np.exp(np.interp(np.log(fine), np.log(hz), np.log(np.maximum(middle, 1e-12))))
    out: dict[str, Estimate] = {}
    inside = np.flatnonzero(curve < plan.limit)
    for name, k, step in (
        ("edge_low", inside[0] - 1 if len(inside) else -1, 1),
        ("edge_high", inside[-1] if len(inside) else len(fine), 1),
    ):
        if 0 <= k < len(fine) - step:
            share = (math.log(plan.limit) - math.log(curve[k])) / (math.log(curve[k + 1]) - math.log(curve[k]))
            at = float(fine[k] * (fine[k + 1] / fine[k]) ** share)
            slope = (math.log(curve[k + 1]) - math.log(curve[k])) / (fine[k + 1] - fine[k])
            out[name] = _by_ratios(ratios, hz, at, at, -1 / slope, "Hz")
    if hz[0] <= plan.at_hz <= hz[-1]:
        value = float(np.interp(math.log(plan.at_hz), np.log(fine), curve))
        out["error_at"] = _by_ratios(ratios, hz, plan.at_hz, value, value, "1")
    return out


def _by_ratios(ratios: Sequence[Estimate], hz: Array, at: float, value: float, per: float, unit: str) -> Estimate:
    """A value that goes by `per` with the logarithm of the ratio at a frequency."""
    k = int(np.clip(np.searchsorted(hz, at) - 1, 0, len(hz) - 2))
    share = math.log(at / hz[k]) / math.log(hz[k + 1] / hz[k])
    out = Estimate.exact(value, unit)
    for ratio, weight in ((ratios[k], 1 - share), (ratios[k + 1], share)):
        out = out + (ratio - ratio.value) * (per * weight / ratio.value)
    return out


def _false_derivative(taken: Sequence[Taken], asked: Bank, plan: Plan) -> dict[str, Estimate]:
    """Difference of the mean velocities at two set points over that of the mean positions, by stretches."""
    sides = sorted((t for t in taken if t.kind == OFFSET), key=lambda t: t.at)
    if len(sides) < 2:
        return {}
    (low, low_v), (high, high_v) = ((_means(t.y, asked, plan), _means(t.v, asked, plan)) for t in (sides[0], sides[-1]))
    each = (high_v - low_v) / (high - low)
    return {
        "false_derivative": _typed(
            float(each.mean()), each.std(ddof=1) / math.sqrt(len(each)), "1/s", "false_derivative", len(each)
        )
    }


def _means(x: Array, asked: Bank, plan: Plan) -> Array:
    length = len(x) // plan.blocks // asked.spacing * asked.spacing
    return np.asarray((x[: plan.blocks * length].reshape(plan.blocks, length) * fit.endless(length)).mean(axis=1))


def _noise_gain(taken: Sequence[Taken], asked: Bank, plan: Plan, harmonic_hz: float) -> dict[str, Estimate]:
    quiet = [t for t in taken if t.kind == QUIET]
    if not quiet:
        return {}
    t = quiet[0]
    each = fit.noise(t.y, t.v, harmonic_hz, asked.spacing, t.tick_s, plan.blocks, asked.power)
    return {
        "noise_gain": _typed(
            float(each.mean()), each.std(ddof=1) / math.sqrt(len(each)), "1/s", "noise_gain", len(each)
        )
    }
