"""What a force-constant plan cannot ask of a rig: told with numbers before anything starts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile
from procedures.force_constant.plan import Plan
from procedures.servomotor.parameters import parameter

# What the levels are checked with before anything starts; no result uses these.
WEIGHT_N, COM_TO_OUTBOARD = 10.2 * 9.81, 0.010  # T Table 6.1
SLOPE_N_A, SLOPE_BIAS_A, ALPHA_N_A = 74.4, 3.0, 12.1  # T (6.12), Table 6.2
ROOM = 0.95  # share of the bias that a control current may take: a coil cannot pull with less than no current


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from _levels(plan)
    yield from _ranges(rig, plan)
    yield from _control_currents(rig, plan)


def _levels(plan: Plan) -> Iterator[str]:
    levels = plan.levels_A
    if len(levels) < 5:
        yield f"levels_A: found {len(levels)} levels; expected at least five, or curvature cannot be told from scatter"
    if list(levels) != sorted(set(levels)):
        yield f"levels_A: found {levels}; expected ascending levels, each once"
    if levels and not min(levels) < 0 < max(levels):
        yield f"levels_A: found {min(levels):g} to {max(levels):g} A; expected levels of both signs"


def _ranges(rig: RigFile, plan: Plan) -> Iterator[str]:
    along, across, ramp = (parameter(rig, key) for key in ("motor.along", "motor.across", "motor.ramp"))
    wanted = [(ramp, plan.ramp_A_s, "ramp_A_s")]
    wanted += [(name, x, "levels_A") for name in (along, across) for x in (min(plan.levels_A), max(plan.levels_A))]
    for name, value, key in wanted:
        p = rig.parameters[name]
        if not p.low <= value <= p.high:
            more = "; a faster ramp comes close to a step, and a step of 4 A loses levitation within 17 ms"
            yield f"{key}: found {value:g} {p.unit}; expected {p.low:g} to {p.high:g}, the range of {name}" + (
                more if name == ramp and value > p.high else ""
            )


def predicted_controls(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Greatest control current in A that each AMB is expected to need, by nominal constants and the rotor's weight."""
    span, reach = rig.geometry["amb_span"].value, rig.geometry["motor_to_outboard_amb"].value
    slope = SLOPE_N_A * plan.bias_A / SLOPE_BIAS_A
    own = {"inboard": WEIGHT_N * COM_TO_OUTBOARD / span, "outboard": WEIGHT_N * (1 - COM_TO_OUTBOARD / span)}
    share = {"inboard": reach / span, "outboard": -(1 + reach / span)}
    return {b: max(abs(own[b] + share[b] * ALPHA_N_A * level) for level in plan.levels_A) / slope for b in own}


def _control_currents(rig: RigFile, plan: Plan) -> Iterator[str]:
    limit = min(ROOM * plan.bias_A, rig.envelope.max_current_A - plan.bias_A)
    for bearing, control in predicted_controls(rig, plan).items():
        if control > limit:
            yield (
                f"levels_A: the {bearing} AMB would need about {control:.2f} A of control current at the extreme level "
                f"(nominal constants and weight), {limit:.2f} A is what a bias of {plan.bias_A:g} A and the envelope allow"
            )
