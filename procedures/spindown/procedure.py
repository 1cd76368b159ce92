"""Drag of the levitated rotor by letting it coast (thesis 6.6.4, (6.16) with the polar inertia and Coulomb friction).

Measurand: the viscous drag coefficient B at two bias currents of the radial AMBs, and the Coulomb torque T_c, of the released
rotor, mean over both directions of turning: J_z w' = -B w - T_c sgn(w).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.servomotor import carrying, hold, segments, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import BIASES, chosen, named, write
from procedures.shared import assumptions
from procedures.spindown import coasting, waves
from procedures.spindown.coasting import Coasted
from procedures.spindown.plan import Plan
from procedures.spindown.requires import by_drive, requires
from procedures.spindown.running_down import SLOW, run_down
from procedures.spindown.steps import RunDown, read_run_downs

if TYPE_CHECKING:
    from procedures.spindown.estimates import Drag

B = Quantity("B", "N m s/rad", "viscous drag, mean over the directions that it was turned in")
B_HIGH = Quantity(
    "B_high", "N m s/rad", "viscous drag at the higher bias, mean over the directions that it was turned in"
)
T_C = Quantity("T_c", "N m", "Coulomb torque of the rotor alone, mean over the directions that it was turned in")
J_Z = Quantity("J_z", "kg m^2", "polar inertia: by the ring where one was mounted, else the rig file's as used")
MEASURES = (B, B_HIGH, T_C, J_Z)
BY_SPEED, CARRIED = "by the speed channel", "motor carries"


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted at the first bias and with the angle released: no loop is closed before the encoder's direction is known."""
    if by_drive(rig):
        return coasting.settings(rig)
    return named(rig, {**dict.fromkeys(BIASES, plan.bias_A), **hold.RELEASED})


def groups(plan: Plan) -> tuple[tuple[str, float], ...]:
    """What is run down in which order: name and bias."""
    ring = (("ring", plan.bias_A),) if plan.added_inertia else ()
    return (("low", plan.bias_A), ("high", plan.bias_high_A), *ring)


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display; with a drive, once more in each direction, slowly."""
    slowly = 0 if plan.run_up == "motor" else 2 * len(SLOW)
    return 2 + (wiring.STEPS if plan.motor_carries else 0) + 4 * plan.repeats * len(groups(plan)) + slowly


def fewest_steps(plan: Plan) -> int:
    """Without a drive `auto` runs up by the motor."""
    return step_count(plan) - (2 * len(SLOW) if plan.run_up == "auto" else 0)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Run down in both directions at both biases, and with the ring; the angle is held again in the end. Where the rig has no
    motor, as `coasting`."""
    if by_drive(rig.file):
        coasting.acquire(rig, plan, record)
        return
    hold.probe(rig, record)
    if plan.motor_carries and not _carries(rig, plan, record):
        return
    by = "drive" if plan.run_up == "drive" or (plan.run_up == "auto" and rig.drive is not None) else "motor"
    if by == "motor":
        rig.levitation.write(hold.speed_held(rig.file))
    for group, bias in groups(plan):
        if group != "low":
            _at_rest(rig, plan, bias, "ring" if group == "ring" else "")
        top = plan.speed_rad_s
        for repeat in range(plan.repeats):
            for direction in (1, -1):
                labels = {"group": group, "bias_A": bias, "direction": direction, "repeat": repeat, "by": by}
                top = run_down(rig, plan, record, labels, top)
                if not top:
                    return
    if plan.motor_carries:
        carrying.give_back(rig, plan.settle_s)
    if plan.added_inertia:
        transition(rig, RigState.READY)
        rig.operator.mount("")
        transition(rig, RigState.LEVITATED)
    hold.hold(rig)


def _carries(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Hand the outboard end to the motor; False where a small push shows that it does not push as it should."""
    if not wiring.sound(rig, record):
        return False
    rig.levitation.write(chosen(rig.file, "sharing", "priority"))
    carrying.carry(rig, plan.settle_s)
    hold.release(rig)
    return True


def _at_rest(rig: Rig, plan: Plan, bias: float, part: str) -> None:
    """Land, write the bias and have the part mounted, lift again: both are done at rest only, on the AMBs."""
    if plan.motor_carries:
        carrying.give_back(rig, plan.settle_s)
    transition(rig, RigState.READY)
    write(rig, dict.fromkeys(BIASES, bias))
    if part:
        rig.operator.mount(part)
    transition(rig, RigState.LEVITATED)
    if plan.motor_carries:
        carrying.carry(rig, plan.settle_s)


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of."""

    runs: list[RunDown]
    angle: Drag
    speed: Drag | None  # where a run-down is too short for the speed's filter
    inertia: Estimate
    motor_carries: bool = False


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis | Coasted:
    """The run-downs, evaluated by the angle and by the speed; where the rig has no motor, as `coasting`."""
    from procedures.spindown import checks, estimates
    from procedures.spindown import figures as drawn

    if by_drive(recording.rig):
        return coasting.evaluate(recording, findings)
    findings.gate([*checks.before_fits(recording), *segments.of_nudges(recording)])
    plan, rig, runs = recording.plan, recording.rig, read_run_downs(recording)
    if plan.motor_carries:
        findings.add(waves.of_places(runs))
        runs = waves.freed(runs) if waves.spread(runs) else runs
    angle = estimates.evaluate(runs, rig, "angle", plan)
    whole = all(r.of_speed is not None for r in runs)
    speed = estimates.evaluate(runs, rig, "speed", plan) if whole else None
    findings.add(checks.of_runs(runs, conventions(rig), plan))
    findings.add(checks.of_result(runs, angle, speed, plan))
    findings.add([*checks.of_drive(recording, angle), *checks.of_inertia(rig, angle)])
    if not plan.added_inertia:
        text = "J_z is the rig file's value, not measured here; B and T_c carry its tolerance. The ring measures it"
        findings.add([Finding("inertia-as-stated", text, "J_z")])
    findings.add([drawn.stopping(runs, angle, plan.speed_rad_s)])
    return Analysis(runs, angle, speed, _inertia(angle, rig), plan.motor_carries)


def measured(a: Analysis | Coasted) -> Iterator[Measured]:
    """B and T_c by the speed if it could be fitted, and all quantities by the angle, which are the results."""

    state = CARRIED if isinstance(a, Analysis) and a.motor_carries else ""
    if isinstance(a, Analysis) and a.speed is not None:
        for quantity in (B, T_C):
            yield quantity.measured(a.speed.estimates[quantity.name], f"{state}, {BY_SPEED}" if state else BY_SPEED)
    stated = facts(a)
    for quantity in MEASURES:
        if quantity.name in stated:
            yield quantity.measured(stated[quantity.name], state)


def _inertia(result: Drag, rig: RigFile) -> Estimate:
    from procedures.spindown import estimates

    return result.estimates.get("J_z") or estimates.stated_inertia(rig)


def facts(a: Analysis | Coasted) -> dict[str, Estimate]:
    """What a calibration of this rig holds: the results by the angle."""
    if isinstance(a, Coasted):
        return dict(a.estimates)
    return {**a.angle.estimates, "J_z": a.inertia}


def holds_for(plan: Plan) -> dict[str, float]:
    """B depends on the bias, and on which AMBs have one."""
    return {"bias_A": plan.bias_A, "bias_high_A": plan.bias_high_A, "motor_carries": float(plan.motor_carries)}


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if by_drive(rig):
        yield from coasting.check(rig, plan)
        return
    needed = ["ring_inertia"] if plan.added_inertia else ["polar_inertia"]
    for name in needed:
        if name not in rig.machine:
            yield f"machine: found no {name}; B is the decay rate times the inertia"
    if not plan.speed_rad_s < rig.envelope.max_speed_rad_s:
        yield (f"speed_rad_s: found {plan.speed_rad_s:g} rad/s; expected less than the envelope's "
               f"{rig.envelope.max_speed_rad_s:g} rad/s")  # fmt: skip
    if plan.end_speed_rad_s > plan.speed_rad_s / 4:
        yield (f"end_speed_rad_s: found {plan.end_speed_rad_s:g} rad/s; expected a quarter of {plan.speed_rad_s:g} rad/s or "
               "less, or viscous and constant drag cannot be told apart")  # fmt: skip
    if abs(plan.bias_high_A / plan.bias_A - 1) < 0.1:
        yield f"bias_high_A: found {plan.bias_high_A:g} A; expected at least a tenth off {plan.bias_A:g} A"
    if plan.run_up == "drive" and not any("drive" in d.roles for d in rig.devices.values()):
        yield "run_up: found drive; the rig file has no device in that role"
    if plan.motor_carries and (lacking := carrying.lacking(rig)):
        yield f"motor_carries: found true; the controller has no {', '.join(lacking)}"


def figures(a: Analysis | Coasted, recording: Recording[Plan]) -> Iterable[Figure]:
    """Speed over time with fit and residuals, deceleration and loss power over speed."""
    from procedures.spindown import figures as drawn

    if isinstance(a, Coasted):
        return coasting.figures(a)
    return drawn.all_figures(a.runs, a.angle, recording.plan.speed_rad_s)


procedure = Procedure(
    name="spindown",
    places=(BY_SPEED, CARRIED),
    title="Drag of the levitated rotor by spindown",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    fewest_steps=fewest_steps,
    steps_on=lambda rig, plan: coasting.steps(plan) if by_drive(rig) else step_count(plan),
    untold=lambda rig: (B_HIGH,) if by_drive(rig) else (),  # there at the bias that the controller has
    facts=facts,
    holds_for=holds_for,
    assumes=assumptions.SPINDOWN,
    method=read_method(__file__),
)
