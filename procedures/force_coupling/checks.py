"""What a sweep of the phase angle says of the machine besides its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bench.findings import Effect, Finding
from procedures.force_coupling.estimates import Analysis
from procedures.force_coupling.fit import TERMS, CouplingFit
from procedures.force_coupling.plan import Plan
from procedures.force_coupling.steps import Phase
from procedures.servomotor import checks
from procedures.servomotor.conventions import Servomotor
from procedures.shared.step_table import StepTable

ZERO_RAD = math.radians(2.0)  # four times what a commutation set with care is off
SURE = 5  # standard uncertainties
WINDING = 0.1  # segments differ by 1 %


def of_fit(data: StepTable[Phase], f: CouplingFit, plan: Plan) -> Iterator[Finding]:
    """Drift over the sequence and steps off the model."""
    n, terms, u = len(data), f.fit.terms, f.fit.u
    yield from checks.creeping(
        {"i_x": float(terms[7]), "i_y": float(terms[8])}, {"i_x": float(u[7]), "i_y": float(u[8])}, plan.max_creep_A
    )
    residuals = np.hypot(f.fit.residuals[:n], f.fit.residuals[n:])
    span = float(np.hypot(np.ptp(f.i_x), np.ptp(f.i_y)))
    yield from checks.misfit(data, residuals, span, "currents over gamma", plan.max_misfit)


def of_results(a: Analysis, machine: Servomotor, pole_pairs: float) -> Iterator[Finding]:
    """Signs, a zero far off, unequal windings; and T's own way beside ours."""
    ratio, zero, winding = a.fit.term("r"), a.fit.term("gamma_0"), a.fit.term("a")
    yield from _commutation(a)
    if ratio <= 0 or winding <= 0 or a.estimates["alpha_c"].value <= 0:
        yield Finding(
            "wrong-sign",
            f"alpha_d/alpha_c comes out as {ratio:+.3f}, alpha_c as {a.estimates['alpha_c'].value:+.2f} N/A, the x winding as "
            f"{winding:+.3f} of the y winding: gamma turns the force the wrong way, a segment's current is counted with the "
            "wrong sign, or the force constant is.",
            "gamma",
            Effect.ERROR,
        )
    if abs(zero) > ZERO_RAD:
        yield Finding(
            "commutation-off",
            f"direct and coupled force are apart at gamma = {math.degrees(zero):+.2f}° (expected: within "
            f"{math.degrees(ZERO_RAD):g}°): the encoder's zero is off, its direction is wrong, or segments are exchanged.",
            "gamma_0",
            Effect.ERROR,
        )
    if abs(winding - 1) > WINDING:
        yield Finding(
            "windings-differ",
            f"the x winding gives {winding:.3f} of the y winding's force (within {WINDING:.0%} is expected): a segment "
            "gives no current or counts it wrongly, or segments are exchanged.",
            f"{machine.segments[1]}, {machine.segments[3]}",
            Effect.ERROR,
        )
    yield from _notes(a, pole_pairs)


def _notes(a: Analysis, pole_pairs: float) -> Iterator[Finding]:
    ratio, zero, winding = a.fit.term("r"), a.fit.term("gamma_0"), a.fit.term("a")
    direct, coupled = (
        f"{a.fit.term(name):+.2%} ± {2 * float(a.fit.fit.u[TERMS.index(name)]):.2%}" for name in ("rho_2", "rho_3")
    )
    yield Finding(
        "ripple",
        f"by the two edges of the encoder's count the ripple at home is {direct} of the direct force (alpha_2) and {coupled} "
        "of the coupled one (alpha_3); it is in both constants: the means over a turn are alpha_d (1 + the former) and alpha_c "
        "(1 - the latter).",
        "alpha_ratio",
    )
    yield Finding(
        "as-printed",
        f"the linear fit of T (6.15), gamma_0 = 0 and every step's difference from the mean, gives {a.printed:.4f}; from step "
        f"to step {a.successive:.4f}; here {ratio:.4f} with gamma_0 = {math.degrees(zero):+.3f}° and the x winding "
        f"{winding:.4f} of the y winding ({pole_pairs:g} pole pairs)",
        "alpha_ratio",
    )


def _commutation(a: Analysis) -> Iterator[Finding]:
    """The angle by which the force turns against gamma, and the encoder against the force constant's run."""
    apart = a.turn.value - 1
    if abs(apart) > SURE * a.turn.u:
        yield Finding(
            "gamma-scaled",
            f"the currents turn as if gamma were {a.turn.value:.4f} ± {2 * a.turn.u:.4f} of what was told: the controller "
            "turns its currents by another angle than it was told, its pole pairs are not the machine's, or a current does not "
            "stand for a force in proportion.",
            "gamma",
            Effect.INDETERMINATE,
        )
    if a.moved is not None and abs(a.moved.value) > SURE * a.moved.u:
        yield Finding(
            "zero-moved",
            f"the zero of the commutation is {math.degrees(a.moved.value):+.3f}° ± {math.degrees(2 * a.moved.u):.3f}° from "
            "where force-constant found it by the force that the other axis' current gave: the encoder was moved since, and "
            "alpha_d at the home angle is that of another place. Run force-constant again.",
            "gamma_0",
            Effect.INDETERMINATE,
            ("alpha_c",),
        )
