"""What the two ways to the negative stiffness say of each other and of the machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, coverage_factor, welch_satterthwaite
from procedures.negative_stiffness.fit import AmbFit, MotorFit
from procedures.negative_stiffness.plan import Plan
from procedures.servomotor import checks
from procedures.servomotor.conventions import conventions
from procedures.shared.step_table import Labels, StepTable

ONE_IN_A_THOUSAND = 1.7  # times the 95 % expanded uncertainty
AMB_N_PER_A = 74.4  # T (6.12); turns a force into a current for a judgement
COUPLED = 0.25  # cross force over direct force: an encoder zero 0.5 deg off makes 0.08


def of_fits(
    motor: StepTable[Labels], ambs: StepTable[Labels], by_motor: MotorFit, by_ambs: AmbFit, plan: Plan
) -> Iterator[Finding]:
    """Drift, misfit, and an axis that answers the other's displacement."""
    n = len(motor)
    alpha_d = float(by_motor.force[0]) / float(by_motor.i_y[0])
    terms, u = by_motor.fit.terms, by_motor.fit.u
    drift = {"i_y": float(terms[2]) / alpha_d, "i_x": float(terms[5]) / alpha_d}
    yield from checks.creeping(drift, {"i_y": float(u[2]) / alpha_d, "i_x": float(u[5]) / alpha_d}, plan.max_creep_A)
    residuals = np.hypot(by_motor.fit.residuals[:n], by_motor.fit.residuals[n:])
    yield from checks.misfit(motor, residuals, float(np.ptp(by_motor.force)), "force of the motor", plan.max_misfit)
    total = float(np.ptp(by_ambs.force))
    yield from checks.misfit(ambs, by_ambs.fit.residuals, total, "force of the outboard AMB", plan.max_misfit)
    for k, bias in enumerate((plan.bias_A, plan.bias_high_A)):
        newton_per_A = AMB_N_PER_A * bias / plan.bias_A
        _, branch, creep = (float(x) / newton_per_A for x in by_ambs.fit.terms[2 + 3 * k : 5 + 3 * k])
        u_A = float(by_ambs.fit.u[4 + 3 * k]) / newton_per_A
        yield from checks.creeping({f"i_yo at {bias:g} A": creep}, {f"i_yo at {bias:g} A": u_A}, plan.max_creep_A)
        if abs(branch) > plan.max_creep_A:
            yield Finding(
                "hysteresis",
                f"at {bias:g} A the outboard AMB's current differs by {2e3 * branch:+.1f} mA between going up and going "
                "down; it is taken out of the result by the branch term.",
                "i_yo",
            )
    coupling = float(terms[3]) / alpha_d
    if abs(coupling) > COUPLED:
        yield Finding(
            "axes-coupled",
            f"the horizontal current follows the vertical one by {coupling:+.2f} A/A: the commutation is turned, or segments "
            "are exchanged. Look at the encoder's zero and the wiring of the segments.",
            "i_x",
            Effect.ERROR,
        )


def of_results(estimates: Mapping[str, Estimate], rig: RigFile) -> Iterator[Finding]:
    """Signs, the AMB's gap against its drawing, and the two values against each other."""
    for name, way in (("motor", "motor's current"), ("ambs", "AMBs' currents")):
        if estimates[name].value <= 0:
            yield Finding(
                "wrong-sign",
                f"alpha_x' from the {way} is {estimates[name].value * 1e-3:+.1f} N/mm: a motor whose magnets push the rotor "
                "back to the centre. Check the sign of the force constant and of the position sensors.",
                way,
                Effect.ERROR,
            )
    yield from _gap(estimates["gap"], rig)
    yield from _disagreement(estimates)


def _expanded(e: Estimate) -> float:
    """k u for 95 %; for a judgement the shape of the distribution is not worth a Monte Carlo."""
    return coverage_factor(welch_satterthwaite(e)) * e.u


def _gap(found: Estimate, rig: RigFile) -> Iterator[Finding]:
    drawing, sensor = rig.geometry["amb_gap"], conventions(rig).positions["yo"]
    off = found.value - drawing.value
    allowed = (drawing.half_width or 3.3 * drawing.standard_uncertainty) + ONE_IN_A_THOUSAND * _expanded(found)
    if abs(off) > allowed:
        yield Finding(
            "gap-inconsistent",
            f"the outboard AMB behaves as if its gap were {found.value * 1e3:.3f} mm; the drawing has "
            f"{drawing.value * 1e3:.3f} mm ± {allowed * 1e3:.3f} mm with this run's uncertainty. Most likely {sensor} "
            f"reads {found.value / drawing.value - 1:+.0%} off: then alpha_x' is wrong by as much, in both ways.",
            sensor,
            Effect.INDETERMINATE,
        )


def _disagreement(estimates: Mapping[str, Estimate]) -> Iterator[Finding]:
    """The difference has its own uncertainty: what both share cancels in it."""
    d = estimates["difference"]
    U = _expanded(d)
    text = (
        f"by the motor's current {estimates['motor'].value * 1e-3:.1f} N/mm, by the AMBs' currents at two biases "
        f"{estimates['ambs'].value * 1e-3:.1f} N/mm: difference {d.value * 1e-3:+.2f} N/mm, U of the difference "
        f"{U * 1e-3:.2f} N/mm (what both share cancels)"
    )
    if abs(d.value) <= U:
        yield Finding("methods-agree", text, "alpha_x_prime, alpha_x_prime_amb")
    elif abs(d.value) <= ONE_IN_A_THOUSAND * U:
        why = "; more than U, which one sound rig in twenty exceeds"
        yield Finding("methods-disagree", text + why, "alpha_x_prime, alpha_x_prime_amb")
    else:
        why = (
            "; beyond what one sound rig in a thousand shows. Suspect the force constants: the motor's acts on the first "
            "value alone, the outboard AMB's on the second alone. The gain of a position sensor cancels in part."
        )
        yield Finding("methods-disagree", text + why, "alpha_x_prime, alpha_x_prime_amb", Effect.INDETERMINATE)
