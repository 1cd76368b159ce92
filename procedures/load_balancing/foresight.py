"""What a plan of load balancing is expected to come to before anything starts: the largest current, and parts of a turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bench.calibration import Calibration
from bench.rigfile import RigFile
from procedures.load_balancing import inputs
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.steps import FEWEST
from procedures.servomotor import carrying
from procedures.servomotor.parameters import stated

SAMPLES = 2  # of a capture in the narrowest part of a turn, so that each has one


def parts(plan: Plan, rate_hz: float) -> Iterator[str]:
    """Parts of a turn that are too wide for a peak, or narrower than samples of a capture at `rate_hz` lie apart."""
    if round(plan.turn_s / plan.bin_s) < FEWEST:
        yield (f"bin_s: found {plan.bin_s:g} s, {360 * plan.bin_s / plan.turn_s:.1f}° of the circle at {plan.circle_hz:g} Hz; "
               f"expected at most a part in {FEWEST} of a turn, {plan.turn_s / FEWEST:g} s")  # fmt: skip
    if plan.bin_s < SAMPLES / rate_hz:
        yield (f"bin_s: found {plan.bin_s:g} s; expected {SAMPLES / rate_hz:g} s or more: the phase angle is captured at "
               f"{rate_hz:g} Hz")  # fmt: skip


def bottom_A(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> float:
    """i_y at the bottom of the circle, A, where weight and magnets pull the same way. The inboard AMB holds its own plane, so
    that the stiffness is the one that the controller is told: 344 N/mm at the outboard sensors on T's machine, where it is 322
    with the inboard sensors' plane held."""
    model = inputs.adopted(rig, inputs.merged(list(facts.values())))
    return (carrying.gravity_share_N(rig) + model["stiffness"] * plan.radius_m) / model["alpha_d"]


def current(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterator[str]:
    """A current beyond what the segments have."""
    found, most = bottom_A(rig, plan, facts), carrying.MARGIN * stated(rig, "motor.segment_limit").default
    if found > most:
        yield f"radius_m: the motor would need {found:.1f} A at the bottom of the circle; expected at most {most:.1f} A"
