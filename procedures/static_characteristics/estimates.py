"""The map's numbers by force and torque, with influences; what they are beside those of another way to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.inductance_map.model import mapped
from procedures.shared.joint import parts
from procedures.stages.map_model import present
from procedures.stages.stators import Phase, phases
from procedures.static_characteristics import fit
from procedures.static_characteristics.beside import Beside
from procedures.static_characteristics.fit import Found, Known
from procedures.static_characteristics.known import certificates
from procedures.static_characteristics.model import MAP, PHASES, Array, Rows, Terms, held_at, q_of
from procedures.static_characteristics.readings import held, rows
from procedures.static_characteristics.requires import cells
from procedures.static_characteristics.steps import Taken

UNITS = {"slope": "H/m", "length": "m", "overlap": "m", "fringe": "m", "zero": "rad", "centre": "m", "saturation": "A",
         "give": "rad/(N m)", "give_x": "m/N", "force": "N", "torque": "N m", "held": "N", "held_angle": "N m"}  # fmt: skip
FIRST = {"slope": 0.8, "unaligned": 0.15, "c2": 0.03, "c3": 0.09, "length": 0.028, "overlap": 0.014, "fringe": 1.5e-3,
         "saturation": 8.5}  # fmt: skip
"""Where the fit begins if the controller has no map."""
ANGLES = 181  # of a tooth, on which the greatest torque is looked for: 0.01 % of it
FREE = 30.0  # times its u, by which a cell's gain is let go to see what data alone say of it
MAPPED = ("unaligned", "c2", "c3", "length", "overlap", "fringe", "centre", "saturation")


@dataclass(frozen=True)
class Result:
    """The fit with what it is of; `greatest` current A of the plan; `estimates` by (quantity, where)."""

    phases: tuple[Phase, ...]
    taken: Taken
    rows: Rows
    known: Sequence[Known]
    found: Found
    greatest: float
    beside: Beside | None
    estimates: dict[tuple[str, str], Estimate]


def result(taken: Taken, rig: RigFile, greatest: float, beside: Beside | None) -> Result:
    """Of at least as many places as the formula needs.

    Raises:
        AnalysisError: the loads do not determine the map.
    """
    some, both = phases(rig), cells(rig)
    assert both is not None
    of = rows(taken, rig, both)
    known = certificates(of, rig, some, both)
    found = fit.fitted(of, start(of, rig, known), known)
    out = _of_terms(found, known, of, some, greatest)
    if beside is not None:
        out |= beside_of(found, known, of, beside)
    out["reciprocity", ""] = _reciprocity(found, known, of)
    for name, values in zip(("held", "held_angle"), held(taken), strict=True):
        out[name, ""] = _scattered(name, values[:, 1:-1])
    return Result(some, taken, of, known, found, greatest, beside, out)


def start(of: Rows, rig: RigFile, known: Sequence[Known]) -> Array:
    """The first guess of every term: the controller's map, and what certificates say."""
    at = Terms(len(of.x))
    out = np.zeros(at.count)
    out[: len(MAP)] = [present(rig, f"map_{name}", FIRST[name]) if name in FIRST else 0.0 for name in MAP]
    out[at.each("gain")] = 1.0
    for one in known:
        out[one.term] = one.value
    return out


def _of_terms(found: Found, known: Sequence[Known], of: Rows, some: Sequence[Phase], greatest: float
              ) -> dict[tuple[str, str], Estimate]:  # fmt: skip
    """Terms of the fit, and what a phase gives at the centre at most."""
    at = Terms(len(of.x))
    term = terms(found, known, of, at.each("offset").stop)
    stators, out = list(dict.fromkeys(p.motor for p in some)), {}
    out["static_slope", ""] = _in(term[0], "slope")
    for name in MAPPED:
        out[f"static_{name}", ""] = _in(term[MAP.index(name)], name)
    for k, stator in enumerate(stators):
        out["static_zero", stator] = _in(term[MAP.index(f"zero_{k + 1}")], "zero")
    for name in ("cosine", "sine"):
        out["static_uneven", name] = _in(term[MAP.index(name)], "uneven")
    for k, phase in enumerate(some):
        out["static_gain", phase.name] = _in(term[at.each("gain").start + k], "gain")
    for name in ("give", "give_x"):
        out[f"cell_{name}", ""] = _in(term[at.cell(name)], name)

    def peaks(t: Array) -> Array:
        return np.concatenate(greatest_loads(t, of, greatest))

    both = derived(peaks, found.terms, term)
    for k, phase in enumerate(some):
        out["force", phase.name], out["torque", phase.name] = _in(both[k], "force"), _in(both[PHASES + k], "torque")
    return out


def greatest_loads(t: Array, of: Rows, current: float) -> tuple[Array, Array]:
    """Force N of each phase where it is aligned, and its greatest torque N m, at the magnetic centre by a true current A."""
    m, gain, k = dict(zip(MAP, t, strict=False)), t[Terms(len(of.x)).each("gain")], np.arange(PHASES)
    zero = np.where(of.stator == 0, m["zero_1"], m["zero_2"])
    q = float(q_of(np.array(current), m["saturation"]))
    even = {**m, "cosine": 0.0, "sine": 0.0}
    x = np.full(PHASES, m["centre"])
    force = mapped(even, gain, of, k, x, of.aligned + zero)[2] * q
    turned, each = np.linspace(0, math.pi / of.poles, ANGLES), np.tile(k, ANGLES)
    at = np.repeat(-turned, PHASES) + np.tile(of.aligned + zero, ANGLES)
    around = mapped(even, gain, of, each, np.full(len(each), m["centre"]), at)[1].reshape(ANGLES, PHASES)
    return np.abs(force), around.max(axis=0) * q


@dataclass(frozen=True)
class Held:
    """Every load (n,) as it was found: true places and current, and what the other map says of it, N and N m; none without
    one."""

    x: Array
    angle: Array
    current: Array
    beside: tuple[Array, Array] | None


def held_loads(r: Result) -> Held:
    """What force and torque were held against."""
    x, angle = held_at(r.found.terms, r.rows)
    current = true_currents(r.found.terms, r.rows)
    its = None if r.beside is None else loads_by(*r.beside.split(r.beside.values), r.rows, (x, angle, current))
    return Held(x, angle, current, its)


def true_currents(t: Array, of: Rows) -> Array:
    """Of each load (n,), A."""
    at = Terms(len(of.x))
    return np.asarray((of.current - t[at.each("offset")][of.phase]) / t[at.each("current")][of.phase])


def loads_by(m: Mapping[str, float], gain: Array, of: Rows, where: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Force N and torque N m of each load by a map, at places x m and angle rad and with a current A."""
    x, angle, current = where
    _, around, along = mapped(m, gain, of, of.phase, x, angle)
    q = q_of(current, m["saturation"])
    return along * q, around * q


def beside_of(found: Found, known: Sequence[Known], of: Rows, other: Beside) -> dict[tuple[str, str], Estimate]:
    """Force and torque by cells over those of the other map, over all loads that were read."""
    at = Terms(len(of.x))
    term = terms(found, known, of, at.each("offset").stop)
    where = (*held_at(found.terms, of), true_currents(found.terms, of))

    def ratios(t: Array, by: Array) -> Array:
        own = loads_by(dict(zip(MAP, t, strict=False)), t[at.each("gain")], of, where)
        its = loads_by(*other.split(by), of, where)
        return np.array([float(a @ b / (b @ b)) for a, b in zip(own, its, strict=True)])

    values = other.values
    mine = derived(lambda t: ratios(t, values), found.terms, term)
    its = derived(lambda by: ratios(found.terms, by), values, other.estimates)
    names = ("force_ratio", "torque_ratio")
    return {(n, ""): _in(a + (b - b.value), n) for n, a, b in zip(names, mine, its, strict=True)}


def _reciprocity(found: Found, known: Sequence[Known], of: Rows) -> Estimate:
    """What data alone say of the torque cell against the axial one: dT/dx over dF/da, each by its cell as it is stated."""
    at = Terms(len(of.x))
    number = at.cell("cell_angle")
    free = [replace(k, u=FREE * k.u) if k.term == number else k for k in known]
    loose = fit.fitted(of, found.terms, free)
    others = [k for k in free if k.term not in (number, at.cell("cell_x"), at.cell("arm"))]
    t, cell_x, arm = loose.terms, at.cell("cell_x"), at.cell("arm")
    told = [*range(at.each("offset").stop)]
    each = _parted(loose, free, others, of, told)
    value = float(t[number] / (t[cell_x] * t[arm]))
    return _in(Estimate.exact(value) + sum(
        ((each[j] - each[j].value) * (sign * value / float(t[j])) for j, sign in ((number, 1), (cell_x, -1), (arm, -1))),
        Estimate.exact(0.0)), "reciprocity")  # fmt: skip


def _scattered(name: str, values: Array) -> Estimate:
    """Mean over readings, and how far they scatter."""
    count = values.size
    u = float(values.std(ddof=1)) / math.sqrt(count)
    scatter = Influence(f"scatter/{name}", "scatter of the readings", u, UNITS[name], "A", "normal", count - 1.0)
    return Estimate.of(float(values.mean()), scatter)


def _in(e: Estimate, name: str) -> Estimate:
    return replace(e, unit=UNITS.get(name, "1"))


def derived(of: Callable[[Array], Array], values: Array, estimates: Sequence[Estimate]) -> list[Estimate]:
    """What follows from terms (n,) that have estimates, linearised about them: `of` them (q,)."""
    at = of(values)
    out = [Estimate.exact(float(v)) for v in at]
    for j, e in enumerate(estimates):
        step = max(1e-6 * abs(values[j]), 0.1 * e.u, 1e-12)
        moved = [values.copy(), values.copy()]
        moved[0][j], moved[1][j] = values[j] + step, values[j] - step
        slope = (of(moved[0]) - of(moved[1])) / (2 * step)
        out = [o + (e - e.value) * float(s) for o, s in zip(out, slope, strict=True)]
    return out


def terms(found: Found, known: Sequence[Known], of: Rows, count: int) -> list[Estimate]:
    """The first so many terms."""
    return _parted(found, known, known, of, range(count))


def _parted(
    found: Found, known: Sequence[Known], kept: Sequence[Known], of: Rows, told: Sequence[int]
) -> list[Estimate]:
    """Terms by number, with the influences of the certificates that are `kept`, counts and scatter."""
    rows, keep = list(told), {k.identity for k in kept}
    counts = np.array([k.identity.startswith("counts/") for k in known])
    u = np.array([k.u for k in known])
    gains = found.gains[rows]
    rounding = (gains[:, counts] * u[counts]) @ (gains[:, counts] * u[counts]).T
    out = [Estimate.exact(float(v)) for v in found.terms[rows]]
    for j, one in enumerate(known):
        if counts[j] or one.identity not in keep:
            continue
        stated = one.stated or one.u * abs(one.per)
        influence = Influence(one.identity, _called(one.identity), stated, one.unit, "B", one.distribution)
        out = [e + Estimate(0.0, "", {influence: float(s) / one.per}) for e, s in zip(out, gains[:, j], strict=True)]
    freedom = float(max(len(of.x) * PHASES - len(MAP) - PHASES, 1))
    left = parts(found.scatter[np.ix_(rows, rows)], "scatter/loads", "scatter of the loads", "A", freedom)
    counted = parts(rounding, "counts/encoders", "counts of the encoder", "B", math.inf)
    return [e + a + b for e, a, b in zip(out, left, counted, strict=True)]


def _called(identity: str) -> str:
    return identity.removeprefix("capabilities/").replace("_", " ").replace("/", " ")
