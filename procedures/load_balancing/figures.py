"""What load balancing draws: loads as vectors, currents over the turn, gamma with its bound."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from bench.figures import Figure, Series
from procedures.load_balancing import fit
from procedures.load_balancing.estimates import Result, Turns, loads_of
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.steps import LOADS_SEEN

Array = fit.Array


def all_figures(results: Mapping[str, Result], plan: Plan) -> Iterator[Figure]:
    """In the order of the report: those of the first way, and reductions of both."""
    way, result = next(iter(results.items()))
    t, p = result.main, result.values
    yield _vectors(t, p, way)
    yield _currents(t, p, way)
    yield _gamma(t, p, plan, way)
    yield _paths(t, plan, way)


def _angle(t: Turns) -> Array:
    out: Array = (np.arange(t.before.shape[1]) + 0.5) * 360 / t.before.shape[1]
    return out


def _vectors(t: Turns, p: Mapping[str, float], way: str) -> Figure:
    """Loads as the two currents feel them: in the frame that turns with gamma."""
    gamma = t.gamma.mean(axis=0)
    still, turned = (fit.factor(x, p) / np.abs(fit.factor(x, p)) for x in (np.zeros(1), gamma))
    before = fit.load(t.before.mean(axis=0), 0.0, p) / still
    after = fit.load(t.after.mean(axis=0), gamma, p) / turned
    most = float(np.abs(np.concatenate([before, after])).max())
    equal = np.array([0.0, 1.1 * most / np.sqrt(2)])
    series = (
        Series("without", *_closed(before)),
        Series("with", *_closed(after)),
        Series("each 30° of the circle", *_fan(before, after), "faint"),
        Series("alike", -t.law.branch * equal, -equal, "guide"),
    )
    return Figure("loads", f"Load on the motor around the circle, {way}",
                  "In the frame of the motor's field: what i_x and i_y have to hold. Without balancing the field stands still "
                  "and i_y carries nearly everything; with it the field turns so that both carry alike, on the dashed line. "
                  "Where the bound of gamma is reached the vector leaves it.",
                  "load across (N)", "load along (N)", series, kind="plane")  # fmt: skip


def _fan(*loads: fit.Complex) -> tuple[Array, Array]:
    """Vectors from zero, twelve of each."""
    ends = np.concatenate([z[:: max(len(z) // 12, 1)] for z in loads])
    path = np.column_stack([np.zeros(len(ends)), ends, np.zeros(len(ends))]).ravel()
    return path.real, path.imag


def _closed(z: fit.Complex) -> tuple[Array, Array]:
    z = np.append(z, z[0])
    return z.real, z.imag


def _currents(t: Turns, p: Mapping[str, float], way: str) -> Figure:
    angle = _angle(t)
    before, after = (fit.true(x.mean(axis=0), p) for x in (t.before, t.after))
    predicted = fit.balanced(loads_of(t, p)[LOADS_SEEN][1], t.law, p).current
    top = float(np.abs(before.imag).max())
    series = (
        Series("|i_y| without", angle, np.abs(before.imag)),
        Series("|i_x| without", angle, np.abs(before.real)),
        Series("|i_y| with", angle, np.abs(after.imag)),
        Series("|i_x| with", angle, np.abs(after.real)),
        Series("|i_y| with, predicted", angle, np.abs(predicted.imag), "guide"),
    )
    return Figure("currents", f"Currents around the circle, {way}",
                  "Means over the turns. The largest i_y is what the amplifiers must be made for; "
                  "the dashed one is the quasi-static formula on the loads without balancing.",
                  "phase of the circle (°)", "current (A)", series,
                  lines=(("largest without", top), ("largest with", float(np.abs(after.imag).max()))))  # fmt: skip


def _gamma(t: Turns, p: Mapping[str, float], plan: Plan, way: str) -> Figure:
    bound = float(np.degrees(plan.gamma_max_rad))
    predicted = fit.balanced(loads_of(t, p)[LOADS_SEEN][1], t.law, p).gamma
    series = (
        Series("controller", _angle(t), np.degrees(t.gamma.mean(axis=0))),
        Series("predicted", _angle(t), np.degrees(predicted), "guide"),
    )
    return Figure("gamma", f"Phase angle around the circle, {way}",
                  "Where the controller turned the field, and where the load by the adopted constants puts it. At 90° over the "
                  "pole pairs the motor gives no torque; the bound keeps away from that.", "phase of the circle (°)",
                  "gamma (°)", series, lines=(("bound", bound), ("bound, negative", -bound)))  # fmt: skip


def _paths(t: Turns, plan: Plan, way: str) -> Figure:
    series = tuple(
        Series(name, _angle(t), 1e6 * (far.mean(axis=0) - plan.radius_m))
        for name, far in (("without", t.distance_before), ("with", t.distance_after))
    )
    return Figure("path", f"Path off its circle, {way}",
                  "Along the radius, as the outboard probes read it. Without balancing a PID follows the circle; with it the "
                  "observer tells the load beforehand.", "phase of the circle (°)", "off the circle (µm)", series)  # fmt: skip
