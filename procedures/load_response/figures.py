"""What loads draw: deviation over load by approaches from both sides, and over time after a load was put on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bench.figures import Figure, Series, Sheet, Shown
from bench.rigfile.stage import StageAxis
from bench.uncertainty import interval, stated
from procedures.load_response.estimates import BAND, COMPLIANCE, FRICTION, SCALE, Answered, Result, Static, named
from procedures.load_response.plan import Plan
from procedures.load_response.steps import Change

SHOWN = {"m": ("mm", 1e3), "rad": ("°", 180 / np.pi)}
POINTS = 600  # of a curve over time


def all_figures(r: Result, found: Sequence[Change], plan: Plan) -> Iterable[Shown]:
    """Both figures of each axis, and the table of what holds it."""
    for s in r.statics:
        yield _loop(s, r)
    for axis in dict.fromkeys(a.axis for a in r.answered):
        yield _after(axis, [a for a in r.answered if a.axis == axis], found, plan)
    if rows := [row for s in r.statics if (row := _row(s, r))]:
        caption = (
            "Without integrators. The stiffness is the reciprocal of the compliance, per true newton; the scale is what a \
newton by the controller's map is in newtons."
        )
        header = ("axis", "compliance", "stiffness", "friction band", "friction", "scale of the force")
        yield Sheet("static", "What holds each axis", caption, header, tuple(rows), numeric=(1, 2, 3, 4, 5))


def _loop(s: Static, r: Result) -> Figure:
    """Approaches upwards and downwards, and the line through their means."""
    unit, scale = SHOWN[s.axis.unit]
    k = s.pairs.mean.shape[1]
    x = np.repeat(s.force, k)
    up, down = ((s.pairs.mean + way * s.pairs.half).ravel() * scale for way in (-1, 1))
    ends = np.array([s.force.min(), s.force.max()])
    line = (s.deviation.zero + s.deviation.value * ends) * scale
    e = r.estimates.get((named(COMPLIANCE, s.axis.unit == "rad"), s.axis.name))
    label = "mean of both" if e is None else f"mean of both: {e.value * scale:.4g} {unit}/{_below(s.axis.force)}"
    caption = (f"Where {s.axis.name} comes to rest under each load beside its set point, moved slowly upwards and downwards, "
               f"at {k} set points spread over one count. Friction holds it anywhere between.")  # fmt: skip
    return Figure(f"loads-{s.axis.name}", f"Under loads, {s.axis.name}", caption, f"load / {s.axis.force}",
                  f"deviation of {s.axis.name} / {unit}",
                  (Series("upwards", x, up, "points"), Series("downwards", x, down, "points"),
                   Series(label, ends, line)))  # fmt: skip


def _after(axis: StageAxis, some: Sequence[Answered], found: Sequence[Change], plan: Plan) -> Figure:
    """The first set point of each load, put on and taken off."""
    unit, scale = SHOWN[axis.unit]
    series = []
    for a in some:
        assert a.load.source is not None
        one = next(c for c in found if (c.axis, c.source, c.on) == (axis.name, a.load.source.name, a.on))
        within = (one.times >= -plan.before_s) & (one.times <= plan.after_s + plan.look_s)
        step = max(1, int(within.sum()) // POINTS)
        label = f"{a.load.name}, {'on' if a.on else 'off'}"
        series.append(Series(label, one.times[within][::step], one.deviation[within][::step] * scale))
    caption = (f"Deviation of {axis.name} from its set point after a load was put on and taken off, integrators on, at the "
               "first set point. Times count from where the reading answers.")  # fmt: skip
    return Figure(f"after-{axis.name}", f"After a load, {axis.name}", caption, "time / s", f"deviation of {axis.name} / {unit}",
                  tuple(series))  # fmt: skip


def _row(s: Static, r: Result) -> tuple[str, ...]:
    turns, force = s.axis.unit == "rad", s.axis.force
    keys = [(named(name, turns), s.axis.name) for name in (COMPLIANCE, BAND, FRICTION, SCALE)]
    if not all(key in r.estimates for key in keys):
        return ()
    per, band, held, scale = (r.estimates[key] for key in keys)
    unit, factor = SHOWN[s.axis.unit]
    stiff = 1 / per

    def text(value: float, low: float, high: float) -> str:
        return stated(value, (high - low) / 2, "±")

    cells = []
    for e, f in ((per, factor), (stiff, 1.0), (band, factor), (held, 1.0), (scale, 1.0)):
        at = interval(e)
        cells.append(text(e.value * f, at.low * f, at.high * f))
    names = (f"{unit}/{_below(force)}", f"{force}/{s.axis.unit}", unit, force, "")
    return (s.axis.name, *(f"{cell} {name}".strip() for cell, name in zip(cells, names, strict=True)))


def _below(unit: str) -> str:
    """A unit below a stroke of division."""
    return f"({unit})" if " " in unit else unit
