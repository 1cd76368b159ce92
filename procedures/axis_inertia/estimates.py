"""Mass and moment of inertia of each axis, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from bench.uncertainty import Estimate, Influence
from procedures.axis_inertia import fit
from procedures.axis_inertia.fit import Axis, Moved
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.sequence import BARE, among_phases, chosen, known, part, tones
from procedures.axis_inertia.steps import Sine
from procedures.shared.certificates import certified
from procedures.stages.map_bends import doubts
from procedures.stages.spread import turns

Array = npt.NDArray[np.float64]
MASS, INERTIA = "mass", "inertia"


@dataclass(frozen=True)
class Result:
    """By axis what it moves, by the values alone, and how far its sines are apart, as shares with their standard uncertainty;
    quantities by name and where."""

    of: Mapping[str, StageAxis]
    axes: Mapping[str, Axis]
    parts: Mapping[str, float]
    moved: Mapping[str, Moved]
    apart: Mapping[str, tuple[float, float]]
    estimates: dict[tuple[str, str], Estimate] = field(default_factory=dict)


def named(axis: StageAxis) -> str:
    """The quantity's name for an axis in m or rad."""
    return INERTIA if turns(axis) else MASS


def arrays(sines: Sequence[Sine], rig: RigFile, plan: Plan) -> dict[str, Axis]:
    """Sines by axis, part and repeat.

    Raises:
        AnalysisError: some are missing.
    """
    by = {(s.axis, s.part, s.repeat, s.tone): s for s in sines}
    out = {}
    for axis in chosen(rig, plan):
        mine, on = tones(axis, plan), (BARE, part(axis, plan))
        wanted = [[[(axis.name, p, k, t.number) for t in mine] for k in range(plan.repeats)] for p in on]
        missing = [key for row in wanted for some in row for key in some if key not in by]
        if missing:
            raise AnalysisError(f"axis {axis.name}: {len(missing)} sines are missing (was the run stopped early?)")
        per, rubs = (np.array([[[getattr(by[key], what) for key in some] for some in row] for row in wanted])
                     for what in ("per", "rubs"))  # fmt: skip
        out[axis.name] = Axis(per, rubs)
    return out


def results(sines: Sequence[Sine], rig: RigFile, plan: Plan) -> Result:
    """Everything.

    Raises:
        AnalysisError: sines are missing.
    """
    of = {a.name: a for a in chosen(rig, plan)}
    axes = arrays(sines, rig, plan)
    certificates = {
        name: certified(f"machine/{key}", rig.machine[key], f"{known(a, plan).replace('_', ' ')}")
        for name, a in of.items()
        if (key := known(a, plan))
    }
    parts = {name: e.value for name, e in certificates.items()}
    whole = np.arange(plan.repeats)
    told = _solved(axes, parts, plan.delay_s, whole)
    at = _vector(told)
    each = fit.pseudo([_vector(_solved(axes, parts, plan.delay_s, np.delete(whole, k))) for k in whole], at)
    u = each.std(axis=0, ddof=1) / math.sqrt(plan.repeats)
    bends = _by_doubts(sines, rig, plan, parts, at) | _by_delay(axes, parts, plan, at)
    out, apart = {}, {}
    for k, (name, axis) in enumerate(of.items()):
        value, unit = float(at[2 * k]), "kg m^2" if turns(axis) else "kg"
        own, dof = fit.scatter(each[:, 2 * k], np.array(among_phases(rig, axis, plan)))
        scatter = Influence(f"scatter/{name}", "scatter of the repeats", own, unit, "A", "normal", dof)
        e = certificates[name] * (value / parts[name]) + Estimate.of(0.0, scatter)
        for influence, moves in bends.items():
            e = e + Estimate(0.0, "", {influence: float(moves[2 * k])})
        out[named(axis), name] = Estimate(e.value, unit, e.sensitivities)
        apart[name] = (float(at[2 * k + 1]), float(u[2 * k + 1]))
    return Result(of, axes, parts, told, apart, out)


def _solved(axes: Mapping[str, Axis], parts: Mapping[str, float], delay: float, take: fit.Take) -> dict[str, Moved]:
    return {name: fit.moved(a, parts[name], delay, take) for name, a in axes.items()}


def _by_delay(axes: Mapping[str, Axis], parts: Mapping[str, float], plan: Plan, at: Array) -> dict[Influence, Array]:
    """Sensitivity of the results to how late force comes."""
    u = plan.delay_half_s / math.sqrt(3)
    if u == 0:
        return {}
    late = Influence("delay", "delay of the force behind what is asked for", u, "s", "B", "rectangular",
                     source="axis-inertia: delay_half_s of the plan")  # fmt: skip
    return {late: (_vector(_solved(axes, parts, plan.delay_s + u, np.arange(plan.repeats))) - at) / u}


def _vector(told: Mapping[str, Moved]) -> Array:
    """J, and how far the sine that is farthest off is off it, of each axis."""
    out = []
    for m in told.values():
        off = m.each[1:] / m.each[0] - 1
        out += [m.inertia, float(off[int(np.argmax(np.abs(off)))])]
    return np.array(out)


def _by_doubts(
    sines: Sequence[Sine], rig: RigFile, plan: Plan, parts: Mapping[str, float], at: Array
) -> dict[Influence, Array]:
    """Sensitivities of the results to what bends the map: the part asks for more force, and so for greater currents."""
    out: dict[Influence, Array] = {}
    whole = np.arange(plan.repeats)
    for k, influence in enumerate(doubts(rig, plan.saturation_share)):
        if influence.u > 0:
            more = [replace(s, per=s.per + influence.u * s.moves[k]) for s in sines]
            out[influence] = (_vector(_solved(arrays(more, rig, plan), parts, plan.delay_s, whole)) - at) / influence.u
    return out
