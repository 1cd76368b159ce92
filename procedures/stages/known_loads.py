"""Known loads on the axes of a stage: weights over a pulley along its shaft, and weights on a lever around it.

A weight in air W on a hook pulls along the shaft with W cos(a), a how far the cord is off the shaft's direction; the pulley
rubs with f W against the motion, so that at rest it holds the shaft as friction does. On a lever of length r it turns the shaft
with W r. Far and counter-clockwise are positive. The hanger pulls with a mass on it, and by itself not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bench.procedure.rig import Rig
from bench.procedure.roles import Load
from bench.rigfile import RigFile
from bench.rigfile.numbers import Term
from bench.rigfile.places import Places
from bench.rigfile.stage import StageAxis, axes_of
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import certified
from procedures.shared.weight import weight

SPREAD = 2 / math.sqrt(5)  # standard deviation of the square of a rectangular number, over its variance


@dataclass(frozen=True)
class Source:
    """A hook or lever by its name, which loads an `axis` in the direction `sign`; `turns`: a lever."""

    axis: str
    name: str
    sign: int
    turns: bool


def sources(rig: RigFile, axis: StageAxis) -> tuple[Source, ...]:
    """What can load an axis, positive ones first."""
    if axis.unit == "rad":
        found = [Source(axis.name, name, lever.side, True) for name, lever in rig.levers.items()]
    else:
        ways = {"far": 1, "near": -1}
        found = [Source(axis.name, name, ways[h.along], False) for name, h in rig.hooks.items() if h.along is not None]
    return tuple(sorted(found, key=lambda s: -s.sign))


def loaded(rig: RigFile) -> tuple[StageAxis, ...]:
    """Axes that known loads pull at both ways."""
    return tuple(a for a in axes_of(rig).values() if {s.sign for s in sources(rig, a)} == {1, -1})


def put(rig: Rig, source: Source, label: str) -> None:
    """Have a mass put on it in place of what is there; "" is nothing."""
    if source.turns:
        rig.operator.lever("left" if source.sign > 0 else "right", Load(label))
    else:
        rig.operator.hang(Load(label, source.name if len(rig.file.hooks) > 1 else ""))


def load_inputs(rig: RigFile, of: Sequence[Source], masses: Sequence[str]) -> dict[str, Estimate]:
    """What `force` asks for, each with its influence."""
    out = {
        "gravity": certified("site/gravity", rig.site.gravity, "local gravity"),
        "air_density": certified("site/air_density", rig.site.air_density, "air density (buoyancy)"),
        "mass_density": certified("masses/density", rig.mass_density, "density of the masses (buoyancy)"),
    }
    out |= {f"mass_{m}": certified(f"masses/{m}", rig.masses[m], f"mass {m}") for m in masses}
    out["hanger"] = certified("masses/hanger", rig.hanger, "hanger")
    places = Places(rig)
    for s in of:
        if s.turns:
            arm = places.number(rig.levers[s.name].length, f"levers.{s.name}.length")
            out[f"arm_{s.name}"] = _term(arm, f"arm of the lever, {s.name}")
        elif (pulley := rig.hooks[s.name].pulley) is None:
            out |= {f"lost_{s.name}": Estimate.exact(0.0), f"along_{s.name}": Estimate.exact(1.0)}
        else:
            key = f"hooks.{s.name}.pulley"
            lost = places.number(pulley.friction, f"{key}.friction")
            out[f"lost_{s.name}"] = _term(lost, f"friction of the pulley, {s.name}")
            out[f"along_{s.name}"] = _cosine(places.number(pulley.misalignment, f"{key}.misalignment"), s.name)
    return out


def _term(term: Term, name: str) -> Estimate:
    return certified(term.identity, term.number, name) * term.factor


def _cosine(term: Term, name: str) -> Estimate:
    """Of a small angle: 1 - (a^2 + u^2)/2 in the mean, and as far off as the square of the angle scatters."""
    a, u = term.number.value, term.number.standard_uncertainty
    share = math.hypot(a * u, SPREAD * u**2 / 2)
    off = Influence(
        term.identity, f"direction of the pull, {name}", share, "1", "B", "normal", source=term.number.source
    )
    return Estimate.of(1 - (a**2 + u**2) / 2, off)


def force(source: Source, label: str, p: Mapping[str, float]) -> float:
    """N along the axis, or N m around it, of a mass by its label; 0 of none."""
    if not label:
        return 0.0
    kg = p[f"mass_{label}"] + (0.0 if source.turns else p["hanger"])
    newtons = float(weight(kg, p["gravity"], p["air_density"], p["mass_density"]))
    return source.sign * newtons * p[f"arm_{source.name}" if source.turns else f"along_{source.name}"]


def rubbing(source: Source, label: str, p: Mapping[str, float]) -> float:
    """N with which the pulley rubs under that load."""
    return 0.0 if source.turns else abs(force(source, label, p)) * p[f"lost_{source.name}"]
