"""The map's numbers with influences: certificates by what each does to the fit, gains of readings after it, scatter of
pulses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence
from procedures.inductance_map import fit
from procedures.inductance_map.fit import Found, Known
from procedures.inductance_map.model import MAP, PHASES, Rows, Terms
from procedures.inductance_map.pulses import Array
from procedures.inductance_map.steps import Taken, rows
from procedures.shared.certificates import certified, certified_gain
from procedures.shared.joint import parts
from procedures.stages.map_model import present
from procedures.stages.stators import Phase, axis, phases

UNITS = {"slope": "H/m", "length": "m", "overlap": "m", "fringe": "m", "zero": "rad", "centre": "m", "give": "rad/(N m)",
         "give_x": "m/N", "leakage": "H", "saturation": "A", "resistance": "Ohm",
         "current_zero": "A"}  # fmt: skip
EXACT = 1e-9  # u of a term whose number is exact, for the fit
COUNT = 1 / math.sqrt(12)  # standard uncertainty of a reading within its count
FIRST = {"slope": 0.8, "unaligned": 0.15, "c2": 0.03, "c3": 0.09, "length": 0.028, "overlap": 0.014, "fringe": 1.5e-3}
"""Where the fit begins if the controller has no map."""


@dataclass(frozen=True)
class Result:
    """The fit with what it is of; `estimates` by (quantity, where)."""

    phases: tuple[Phase, ...]
    taken: Sequence[Taken]
    rows: Rows
    found: Found
    estimates: dict[tuple[str, str], Estimate]


def result(taken: Sequence[Taken], rig: RigFile) -> Result:
    """Of at least as many places as the formula needs.

    Raises:
        AnalysisError: the pulses do not determine the map.
    """
    some, of = phases(rig), rows(taken, rig)
    known = certificates(of, rig, some)
    guess = [present(rig, f"map_{name}", FIRST.get(name, 0.0)) if name in FIRST else 0.0 for name in MAP]
    guess += [present(rig, "map_leakage", 1.5e-3), present(rig, "map_saturation", 8.5)]
    found = fit.fitted(of, fit.start(of, guess, known), known)
    return Result(some, taken, of, found, estimates(found, known, of, rig, some, taken))


def certificates(of: Rows, rig: RigFile, some: Sequence[Phase]) -> list[Known]:
    """What the rig file says of readings and encoders, by the terms of the fit."""
    at, out = Terms(len(of.x)), []
    for k, phase in enumerate(some):
        i, u = rig.sensors[phase.current].offset, rig.sensors[phase.voltage].offset
        for name, stated, identity in (
            ("offset_up", i, f"sensors/{phase.current}/offset"),
            ("offset_down", i, f"sensors/{phase.current}/offset/down"),
            ("offset_u", u, f"sensors/{phase.voltage}/offset"),
        ):
            one = None if name == "offset_down" else _of(identity, stated)
            out.append(
                Known(at.each(name).start + k, stated.value, max(stated.standard_uncertainty, EXACT), identity, one)
            )
    x, angle = axis(rig, "stroke"), axis(rig, "angle")
    assert x is not None
    assert angle is not None
    assert x.pitch is not None
    assert angle.pitch is not None
    wide = EXACT if angle.error is None else angle.error.standard_uncertainty / math.sqrt(2)  # of each part of a sine
    for k, part in enumerate(("cosine", "sine")):
        out.append(Known(at.once.start + k, 0.0, wide, f"encoders/{angle.name}/error/{part}"))
    for name, where, count in (("off", angle.name, angle.pitch.value), ("along", x.name, x.pitch.value)):
        first = getattr(at, name).start
        out += [Known(first + p, 0.0, COUNT * count, f"counts/{where}/{p}") for p in range(at.places)]
    share, pitch = x.pitch.standard_uncertainty / x.pitch.value, f"encoders/{x.name}/pitch"
    one = _of(pitch, x.pitch)
    return [
        *out,
        Known(at.scale, 1.0, max(share, EXACT), pitch, one, 1.0 if one is None else x.pitch.value),
    ]


def _of(identity: str, stated: Toleranced) -> Influence | None:
    """The influence of a number as the rig file states it; None of one that is exact."""
    return next((i for i in certified(identity, stated, _called(identity)).sensitivities if i.u > 0), None)


def _called(identity: str) -> str:
    return identity.replace("/", " ")


def estimates(found: Found, known: Sequence[Known], of: Rows, rig: RigFile, some: Sequence[Phase],
              taken: Sequence[Taken]) -> dict[tuple[str, str], Estimate]:  # fmt: skip
    """Terms of the fit, and out of those of the phases what is true of currents and voltages."""
    term = _terms(found, known, of)
    at, out = Terms(len(of.x)), {}
    whole, each = term[0], {}
    factor = [certified_gain(rig, p.current) / certified_gain(rig, p.voltage) for p in some]
    for k, phase in enumerate(some):
        each[phase.name] = whole * term[at.each("gain").start + k] * factor[k]
    slope = sum(each.values(), Estimate.exact(0.0)) / PHASES
    out["slope", ""] = _in(slope, "slope")
    stators = list(dict.fromkeys(p.motor for p in some))
    for j, name in enumerate(MAP):
        if name in ("zero_1", "zero_2"):
            out["zero", stators[int(name[-1]) - 1]] = _in(term[j], "zero")
        elif name in ("cosine", "sine"):
            out["uneven", name] = _in(term[j], "uneven")
        elif name != "slope":
            out[name, ""] = _in(term[j], name)
    for phase in some:
        out["gain", phase.name] = _in(each[phase.name] / slope, "gain")
    leakage = [term[at.each("leakage").start + k] * factor[k] for k in range(PHASES)]
    saturation = [term[at.each("saturation").start + k] / certified_gain(rig, p.current) for k, p in enumerate(some)]
    out["leakage", ""] = _in(sum(leakage, Estimate.exact(0.0)) / PHASES, "leakage")
    out["saturation", ""] = _in(sum(saturation, Estimate.exact(0.0)) / PHASES, "saturation")
    for k, phase in enumerate(some):
        out["resistance", phase.name] = _resistance(phase, factor[k], taken)
    if all(t.zeros for t in taken):
        for k, phase in enumerate(some):
            out["current_zero", phase.name] = _current_zero(phase, np.array([t.zeros[k] for t in taken]))
    return out


def _in(e: Estimate, name: str) -> Estimate:
    return replace(e, unit=UNITS.get(name, "1"))


def _resistance(phase: Phase, factor: Estimate, taken: Sequence[Taken]) -> Estimate:
    """u/i of the held ends, by true volts and amperes; it warms meanwhile, which is in the scatter."""
    each = np.array([p.resistance for t in taken if (p := t.pulses.get(phase.name)) is not None])
    u = float(each.std(ddof=1)) / math.sqrt(len(each))
    scatter = Influence(
        f"scatter/resistance/{phase.name}", "scatter of the pulses", u, "Ohm", "A", "normal", len(each) - 1.0
    )
    return _in(Estimate.exact(float(each.mean())) * factor, "resistance") + Estimate.of(0.0, scatter)


def _current_zero(phase: Phase, each: Array) -> Estimate:
    """What a current reads where there is none, in the mean over the places (n,)."""
    u = float(each.std(ddof=1)) / math.sqrt(len(each))
    scatter = Influence(
        f"scatter/current_zero/{phase.name}", "scatter of the places", u, "A", "A", "normal", len(each) - 1.0
    )
    return _in(Estimate.of(float(each.mean()), scatter), "current_zero")


def _terms(found: Found, known: Sequence[Known], of: Rows) -> list[Estimate]:
    """Every term of the map and of the phases that is told, in the order of the vector."""
    at = Terms(len(of.x))
    count = at.each("saturation").stop
    counts = np.array([k.identity.startswith("counts/") for k in known])
    u = np.array([k.u for k in known])
    rounding = (found.gains[:count, counts] * u[counts]) @ (found.gains[:count, counts] * u[counts]).T
    out = [Estimate.exact(float(v)) for v in found.terms[:count]]
    for j, one in enumerate(known):
        if counts[j]:
            continue
        influence = one.influence
        if influence is None:
            influence = Influence(one.identity, _called(one.identity), one.u, "1", "B", "rectangular")
        does = found.gains[:count, j] / one.per
        out = [e + Estimate(0.0, "", {influence: float(s)}) for e, s in zip(out, does, strict=True)]
    scatter = parts(found.scatter[:count, :count], "scatter/pulses", "scatter of the pulses", "A", _freedom(of))
    counted = parts(rounding, "counts/encoders", "counts of the encoders", "B", math.inf)
    return [e + s + c for e, s, c in zip(out, scatter, counted, strict=True)]


def _freedom(of: Rows) -> float:
    """Pulses less terms that have no certificate."""
    pulses = len(np.unique(of.place * PHASES + of.phase))
    return float(max(pulses - len(MAP) - 3 * PHASES, 1))
