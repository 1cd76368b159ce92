"""Flux, resistance and constants by reciprocity of each motor, with influences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.emf_constant import fit
from procedures.emf_constant.fit import Flux, Rows
from procedures.emf_constant.moves import Winding, chosen
from procedures.emf_constant.plan import Plan
from procedures.emf_constant.steps import Taken
from procedures.position_loops.motors import electrical_turn
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
BOTH = (1, -1)


@dataclass(frozen=True)
class Result:
    """Of a motor: what each repeat there and back showed, all of them together, and each coil's flux (repeats, coils) Wb; its
    quantities by name. `first`: a move there, with its equations, for the figure."""

    winding: Winding
    repeats: Sequence[Flux]
    whole: Flux
    by_coil: Array
    first: Rows
    estimates: dict[str, Estimate] = field(default_factory=dict)


def results(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> list[Result]:
    """Each motor's that was moved there and back four times or more."""
    out = []
    for motor, winding in chosen(rig, plan).items():
        each = list(_repeats(taken, motor, winding, plan))
        if len(each) >= 4:
            out.append(_result(winding, each, rig))
    return out


def _repeats(taken: Sequence[Taken], motor: str, winding: Winding, plan: Plan) -> Sequence[Rows]:
    phases = np.array(list(winding.phases.values()))
    others = [np.array([p[c] for c in winding.coils]) for p in winding.others]
    stars = [[winding.coils.index(c) for c in star] for star in winding.stars]
    by = {(t.repeat, t.there): t.move for t in taken if t.motor == motor and t.move is not None}
    whole = sorted({r for r, _ in by if all((r, way) in by for way in BOTH)})
    return [
        fit.together([fit.rows(by[r, way], winding.per, phases, others, stars, plan.window_s) for way in BOTH])
        for r in whole
    ]


def _result(winding: Winding, each: Sequence[Rows], rig: RigFile) -> Result:
    repeats = [fit.flux(rows) for rows in each]
    if not all(f.size > 0 for f in repeats):
        raise AnalysisError(
            f"{winding.motor}: voltages and currents of its coils are 0 throughout; its flux cannot be told"
        )
    whole = fit.flux(fit.together(each))
    by_coil = np.array([fit.by_coil(rows, f) for rows, f in zip(each, repeats, strict=True)])
    found = {"flux": _flux(winding, repeats, whole, rig), "resistance": _resistance(winding, repeats, rig)}
    motion = rig.capabilities.motion
    turns = motion is not None and winding.channel == motion.angle_channel
    per_ampere = found["flux"] * (2 * math.pi / electrical_turn(rig, winding.motor)) * (len(winding.coils) / 2)
    name, unit = ("K_emf_angle", "N m/A") if turns else ("K_emf", "N/A")
    found[name] = Estimate(per_ampere.value, unit, per_ampere.sensitivities)
    return Result(winding, repeats, whole, by_coil, each[0], found)


def _scatter(motor: str, what: str, each: Array, unit: str) -> Influence:
    u = float(each.std(ddof=1)) / math.sqrt(len(each))
    return Influence(f"scatter/{motor}/{what}", "scatter of the repeats", u, unit, "A", "normal", len(each) - 1.0)


def _flux(winding: Winding, repeats: Sequence[Flux], whole: Flux, rig: RigFile) -> Estimate:
    """A reading of a voltage g u makes the flux g Psi; one of the coordinate g x makes it Psi/g, for what is seen is the slope
    of the flux along it."""
    each = np.array([f.size for f in repeats])
    out = Estimate.exact(float(each.mean()), "Wb")
    for name, share in zip(winding.voltages.values(), whole.shares, strict=True):
        out = out * (1 + float(share) * (1 / certified_gain(rig, name) - 1))
    if winding.channel in rig.sensors:
        out = out * certified_gain(rig, winding.channel)
    return Estimate(out.value, "Wb", out.sensitivities) + Estimate.of(0.0, _scatter(winding.motor, "flux", each, "Wb"))


def _resistance(winding: Winding, repeats: Sequence[Flux], rig: RigFile) -> Estimate:
    """Mean of the coils', by what is truly a volt and an ampere."""
    each = np.array([f.resistance for f in repeats])
    out = Estimate.exact(0.0, "Ohm")
    for k, (coil, voltage) in enumerate(winding.voltages.items()):
        one = float(each[:, k].mean()) / len(winding.coils)
        out = out + one * certified_gain(rig, coil) / certified_gain(rig, voltage)
    return Estimate(out.value, "Ohm", out.sensitivities) + Estimate.of(
        0.0, _scatter(winding.motor, "resistance", each.mean(axis=1), "Ohm")
    )
