"""From captures to estimates: rise and fall of the large step, what goes across, the small step's band, the supply."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import CurrentStep
from bench.uncertainty import Estimate, Influence
from procedures.current_step import fit
from procedures.current_step.fit import Edge
from procedures.current_step.plan import Plan
from procedures.current_step.steps import LARGE, SMALL, Taken, place_of
from procedures.shared.certificates import certified, certified_gain

Array = npt.NDArray[np.float64]
LEAD_S = 0.5e-3  # of a response before its step
ACROSS_RISES = 3  # rise times after a step: up to then the current across is looked at
TOP = 1.2
"""Of the time in which the -3 dB of a loop turns by one radian: what a parabola through its top reaches to on either side at
most. A loop of second order, of natural frequency w (at most that of -3 dB) and damping d, has at its top a fourth derivative
of w^2 (4 d^2 - 1) times the second; least squares over m samples T are then off by (w m T)^2/140, 1 %, of what the parabola
falls to its edge."""
FASTER = 4  # times as fast: what goes across comes of single half-bridges, whose own loops lie inside of the current's


@dataclass(frozen=True)
class Limits:
    """What a step made of the half-bridges: greatest amplitude of their currents, A, and greatest voltage of one of them, V,
    with the limits of both (NaN: not known), for how long one had 95 % of the voltage, s, and the filter's stated
    inductance, H."""

    current: float
    current_limit: float
    voltage: float
    voltage_limit: float
    voltage_off: float  # share that the voltage may be off: the filter's inductance is stated so well
    voltage_s: float
    inductance: float

    @property
    def current_touched(self) -> bool:
        """The controller's limit of the inductors' currents acted."""
        return self.current >= 0.95 * self.current_limit

    @property
    def voltage_touched(self) -> bool:
        """A half-bridge gave all that it can."""
        return self.voltage >= (0.97 - self.voltage_off) * self.voltage_limit


@dataclass(frozen=True)
class Place:
    """One place: its captures of large and small steps with their edges, estimates by quantity, limits of both kinds of step,
    the responses to the large step (repeats, n) `along` and `across` from 0 to 1, that of the small one (n,), and where in
    them the step begins, samples."""

    name: str
    step: CurrentStep
    large: tuple[Taken, ...]
    edges: Mapping[str, tuple[tuple[Edge, Edge], ...]]
    limits: Mapping[str, Limits]
    estimates: Mapping[str, Estimate]
    along: Array
    across: Array
    small: Array
    lead: int

    @property
    def tick_s(self) -> float:
        """From sample to sample."""
        return self.large[0].tick_s


def evaluate(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> tuple[Place, ...]:
    """Every place, in the plan's order.

    Raises:
        AnalysisError: a step does not pass its levels, or a response has no frequency of -3 dB.
    """
    return tuple(_place(name, [t for t in taken if t.place == name], rig, plan) for name in plan.steps_at)


def _place(name: str, taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Place:
    step = place_of(rig, name)
    large, small = ([t for t in taken if t.kind == kind] for kind in (LARGE, SMALL))
    if len(large) < 4 or len(small) < 4:
        raise AnalysisError(
            f"{name}: found {len(large)} large and {len(small)} small steps; expected 4 or more of each"
        )
    tick_s = large[0].tick_s
    before, after = round(LEAD_S / tick_s), round(plan.response_s / tick_s)
    edges = {kind: tuple(_edges(t) for t in some) for kind, some in ((LARGE, large), (SMALL, small))}
    ups = np.array([fit.unit(t.along, e[0], before, after) for t, e in zip(large, edges[LARGE], strict=True)])
    downs = np.array([fit.unit(t.along, e[1], before, after) for t, e in zip(large, edges[LARGE], strict=True)])
    across = np.array([_across(t, e[0], before, after) for t, e in zip(large, edges[LARGE], strict=True)])
    pairs = np.array([
        0.5 * (fit.unit(t.along, e[0], before, after) + fit.unit(t.along, e[1], before, after))
        for t, e in zip(small, edges[SMALL], strict=True)
    ])  # fmt: skip
    count = _count(rig, step.along)
    found = {"rise_time": _time("rise_time", name, ups, tick_s, count / plan.size_A),
             "fall_time": _time("fall_time", name, downs, tick_s, count / plan.size_A)}  # fmt: skip
    found["rise_bandwidth"] = 1 / (found["rise_time"] * 3.0)
    found["bandwidth_small"] = _band(name, pairs, tick_s)
    longest = TOP / (2 * math.pi * found["bandwidth_small"].value * tick_s)
    found["overshoot"] = _peak("overshoot", name, ups - 1, longest)
    shown = before + round(ACROSS_RISES * found["rise_time"].value / tick_s)
    found["across"] = _peak("across", name, across[:, :shown], longest / FASTER, either_way=True)
    found |= _design(rig, step) | _supply(rig, step, large)
    whole = [t for t in small if len(t.currents) == len(step.currents)]
    limits = {kind: _limits(some, rig, step, found) for kind, some in ((LARGE, large), (SMALL, whole))}
    return Place(name, step, tuple(large), edges, limits, found, ups, across, pairs.mean(axis=0), before)


def _edges(t: Taken) -> tuple[Edge, Edge]:
    found = fit.edges(t.along, t.size, t.tick_s)
    if found is None:
        raise AnalysisError(f"{t.place}: found no step of {t.size:g} A and back")
    return found


def _across(t: Taken, edge: Edge, before: int, after: int) -> Array:
    q = fit.cut(t.across, edge, before, after)
    return np.asarray((q - q[: before - round(fit.GUARD_S / t.tick_s)].mean()) / edge.size)


def _count(rig: RigFile, channel: str) -> float:
    return 0.0 if rig.capture is None else rig.capture.channels[channel].scale


def _scatter(value: float, u: float, unit: str, identity: str, dof: int) -> Estimate:
    return Estimate.of(value, Influence(f"scatter/{identity}", "scatter of the repeats", u, unit, "A", "normal", dof))


def _by_mean(each: Array, of: Callable[[Array], float]) -> tuple[float, float]:
    """A number of the mean of repeats (r, n), and its standard uncertainty by the jackknife: of single repeats a crossing is
    early where noise crosses first."""
    total, count = each.sum(axis=0), len(each)
    less = [of((total - one) / (count - 1)) for one in each]
    return of(total / count), math.sqrt((count - 1) * float(np.var(less)))


def _known(u: float, unit: str, identity: str, name: str, source: str) -> Estimate:
    return Estimate.of(0.0, Influence(identity, name, u, unit, "B", "rectangular", source=source))


def _time(quantity: str, name: str, each: Array, tick_s: float, count: float) -> Estimate:
    """From 10 to 90 % of the mean of the repeats, s; `count` is what the capture rounds to, of the step."""
    value, u = _by_mean(each, fit.rise)
    mean, identity = each.mean(axis=0), f"{quantity}/{name}"
    at = fit.passed(mean)
    slopes = [float(mean[k] - mean[k - 1]) / tick_s for k in at]
    out = _scatter(value * tick_s, u * tick_s, "s", identity, len(each) - 1)
    bend = abs(fit.straight(mean) - value) * tick_s
    out = out + _known(bend / math.sqrt(3), "s", f"sampling/{identity}", "between two samples",
                       "what a cubic and a straight line between samples differ by")  # fmt: skip
    rounded = count / math.sqrt(12) * math.hypot(*(1 / s for s in slopes)) / math.sqrt(len(each))
    return out + _known(rounded, "s", f"count/{identity}", "the capture's count", "scale of the channel")


def _peak(quantity: str, name: str, each: Array, longest: float, *, either_way: bool = False) -> Estimate:
    """The greatest value of the mean of the repeats, by parabolas of up to `longest` samples on either side."""
    top, identity = fit.farthest(each, max(round(longest), 1), either_way), f"{quantity}/{name}"
    out = _scatter(max(top.value, 0.0), top.u, "1", identity, len(each) - 2)
    return out + _known(top.above / math.sqrt(3), "1", f"place/{identity}", "which sample is the highest",
                        "what the top of all repeats is above one half where the other half is highest")  # fmt: skip


def _band(name: str, pairs: Array, tick_s: float) -> Estimate:
    """-3 dB of the mean of the small steps, up and back."""
    value, u = _by_mean(pairs, lambda h: fit.bandwidth(h, tick_s))
    return _scatter(value, u, "Hz", f"bandwidth_small/{name}", len(pairs) - 1)


def _design(rig: RigFile, step: CurrentStep) -> dict[str, Estimate]:
    """The proportional gain over the stated inductance: of no reading at all."""
    if not step.gain or not step.inductance:
        return {}
    inductance = certified(f"machine/{step.inductance}", rig.machine[step.inductance], "inductance of the winding")
    return {"bandwidth_design": rig.parameters[step.gain].default / (2 * math.pi) / inductance}


def _supply(rig: RigFile, step: CurrentStep, large: Sequence[Taken]) -> dict[str, Estimate]:
    """Mean of the DC link before the steps."""
    if not step.supply:
        return {}
    lead = round(fit.LEVEL_S / large[0].tick_s)
    means = np.array([t.supply[:lead].mean() for t in large])
    out = _scatter(
        float(means.mean()), means.std(ddof=1) / math.sqrt(len(means)), "V", f"supply/{step.supply}", len(means)
    )
    out = out + _known(
        _count(rig, step.supply) / math.sqrt(12), "V", f"count/{step.supply}", "the capture's count", "its scale"
    )
    return {"u_dc": out if step.supply not in rig.sensors else out / certified_gain(rig, step.supply)}


def _limits(some: Sequence[Taken], rig: RigFile, step: CurrentStep, found: Mapping[str, Estimate]) -> Limits:
    """The mean of the captures, whose noise would look like a limit that was touched."""
    tick_s, nan = some[0].tick_s, math.nan
    edges = [_edges(t)[0].at for t in some]
    before, after = round(LEAD_S / tick_s), round(LEAD_S / tick_s) * 4

    def mean(of: Callable[[Taken], Array]) -> Array:
        rows: list[Array] = [of(t)[:, at - before : at + after] for t, at in zip(some, edges, strict=True)]
        return np.asarray(np.mean(rows, axis=0))

    limit = rig.parameters[step.current_limit].default if step.current_limit else nan
    half = found["u_dc"].value / 2 if "u_dc" in found else nan
    current = voltage = lasting = off = inductance = nan
    if step.currents:
        rows = mean(lambda t: t.currents)
        rows -= rows[:, : before // 2].mean(axis=1, keepdims=True)
        current = float(fit.amplitude(rows).max())
        if step.voltages and step.filter_inductance and len(step.voltages) == len(step.currents):
            stated = rig.machine[step.filter_inductance]
            inductance, off = stated.value, math.sqrt(3) * stated.standard_uncertainty / stated.value
            size = np.abs(fit.given(mean(lambda t: t.voltages), rows, inductance, tick_s)).max(axis=0)
            voltage = float(size.max())
            lasting = float((size >= 0.95 * min(half, voltage)).sum() * tick_s)
    return Limits(current, limit, voltage, half, off, lasting, inductance)
