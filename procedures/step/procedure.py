"""Set-point steps of the levitated shaft, at rest and turning, with one or two settings of the controller (thesis 3.5, A7).

Measurands, each by setting, speed, axis, size and direction: overshoot, rise, settling, error at the end and bandwidth; by
setting, speed and axis: damping ratio and natural frequency, and how far size and direction matter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.errors import NotReached
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from bench.units import RPM
from procedures.amb_rotor import before_lift, frame, lift
from procedures.amb_rotor.conventions import conventions
from procedures.shared import assumptions, first_look
from procedures.step import capturing
from procedures.step.held import check_sizes
from procedures.step.named import check_settings, list_settings, setting_names, written
from procedures.step.plan import Plan
from procedures.step.position import leans
from procedures.step.record_length import enough_s, faded_s
from procedures.step.requires import requires
from procedures.step.steps import STEP, TURNING_RAD_S, Case, Done, cases, read_steps
from procedures.step.turning import marked

if TYPE_CHECKING:
    from procedures.step.estimates import Result

OVERSHOOT = Quantity("overshoot", "1", "greatest position beyond the step, as a share of it")
RISE = Quantity("rise_time", "s", "10 to 90 % of the step")
SETTLING = Quantity("settling_time", "s", "until the averaged position stays in the band")
ERROR = Quantity("steady_error", "m", "position at the end of the record less its set point, from where it rested")
BANDWIDTH = Quantity("bandwidth", "Hz", "where the spectrum of the response's derivative is 3 dB down")
DAMPING = Quantity(
    "damping", "1", "damping ratio of the swing: its oscillations' mean pole, each with its part in the step"
)
FREQUENCY = Quantity("natural_frequency", "Hz", "of the same mean pole")
SIZE = Quantity(
    "size_effect",
    "1",
    "overshoot of the largest step less that of the smallest, mean of both ways",
    title="effect of the size",
)
WAY = Quantity(
    "way_effect", "1", "overshoot upwards less that downwards, at the largest step", title="effect of the direction"
)
MEASURES = (OVERSHOOT, RISE, SETTLING, ERROR, BANDWIDTH, DAMPING, FREQUENCY, SIZE, WAY)
SETTLED_S = 0.5  # after the last ramp of a speed
MAY_LACK = (OVERSHOOT, SETTLING, BANDWIDTH, DAMPING, FREQUENCY, SIZE, WAY)
MARGIN = 0.8  # of the clearance that a step with its overshoot may use


def model(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The controller's idea of the bearings, wrong by what the plan says; what the rig file says where that is nothing."""
    return {n: rig.parameters[n].default * (1 + plan.model_error) for n in model_names(rig, plan)}


def recorded_s(rig: RigFile, plan: Plan) -> float:
    """How long each step is recorded, s: what the plan says, or as long as the slowest of its laws takes."""
    if plan.record_s is not None:
        return plan.record_s
    return enough_s(
        conventions(rig), [{**_usual(rig), **s} for s in list_settings(plan, rig).values()], plan.axes, plan.band
    )


def waited_s(rig: RigFile, plan: Plan, setting: str, axis: str) -> float:
    """Before the rest of each step, s, until what the one before it leaves is nothing."""
    needed = faded_s(conventions(rig), {**_usual(rig), **list_settings(plan, rig)[setting]}, axis, plan.band)
    return max(needed - recorded_s(rig, plan) - plan.rest_s, 0.0)


def _usual(rig: RigFile) -> dict[str, float]:
    return {name: p.default for name, p in rig.parameters.items()}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 4 * plan.repeats * len(list(cases(setting_names(plan), plan.speeds_rad_s, plan.axes, plan.sizes_m)))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Up, back, down and back for every case; the shaft stands and the controller has its own settings again in the end."""
    settings, machine = list_settings(plan, rig.file), conventions(rig.file)
    used: dict[str, float] = {}
    record_s = recorded_s(rig.file, plan)
    lift.write(rig, model(rig.file, plan))
    if machine.can.set_points.slew:
        lift.write(rig, {machine.can.set_points.slew: 0.0})
    captured, number = capturing.captures(rig.file, machine), 0
    now: tuple[str, float] | None = None
    for setting, speed, axis, size in cases(tuple(settings), plan.speeds_rad_s, plan.axes, plan.sizes_m):
        if (now is None or now[1] != speed) and not _at(rig, plan, record, speed):
            break
        if now != (setting, speed):
            _put(rig, plan, settings[setting], used)
            now = (setting, speed)
        wait_s = waited_s(rig.file, plan, setting, axis)
        for repeat in range(plan.repeats):
            for begin, end in ((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0)):
                rig.clock.sleep(wait_s)
                with record.step(
                    STEP,
                    setting=setting,
                    speed_rad_s=speed,
                    axis=axis,
                    begin_m=begin,
                    step_m=end - begin,
                    repeat=repeat,
                ):
                    if captured:
                        capturing.arm(rig, machine, plan.rest_s + record_s)
                    rig.clock.sleep(plan.rest_s)
                    lift.write(rig, machine.point(axis, end))
                    rig.clock.sleep(record_s)
                if captured:
                    capturing.fetch(rig, number)
                number += 1
    if rig.drive is not None and max(plan.speeds_rad_s) > 0:
        rig.drive.stop()
        rig.drive.coast()
        rig.clock.sleep(machine.stands_s)
    slew = [machine.can.set_points.slew] if machine.can.set_points.slew else []
    changed = (*slew, *sorted({*used} - {*machine.select(machine.plain_law)}), *model(rig.file, plan))
    lift.write(rig, {name: rig.file.parameters[name].default for name in changed})


def _at(rig: Rig, plan: Plan, record: Recorder, speed: float) -> bool:
    """Turn at a speed; False if the shaft does not get there, which the analysis tells."""
    if rig.drive is None or speed == 0:
        return True
    try:
        rig.drive.reach(speed)
    except NotReached:
        record.event("not-reached", wanted=speed, reached=rig.rotation.speed_rad_s)
        return False
    rig.clock.sleep(SETTLED_S)
    return True


def _put(rig: Rig, plan: Plan, setting: Mapping[str, float], used: dict[str, float]) -> None:
    """A setting of the controller: what the other one changed is undone; first warm, if there is anything to be warmed."""
    before, warm = {n: rig.file.parameters[n].default for n in used if n not in setting}, written(plan.warm, rig.file)
    lift.write(rig, {**before, **setting, **warm})
    used |= {**before, **setting, **warm}
    if warm:
        rig.clock.sleep(plan.warm_s)
        lift.write(rig, {n: setting.get(n, rig.file.parameters[n].default) for n in warm})
    rig.clock.sleep(plan.settle_s)


@dataclass(frozen=True)
class Results:
    """What was recorded, step by step; the result of each case, and the estimates over sizes and directions by place."""

    steps: Sequence[Done]
    by_case: Mapping[Case, Result] = field(default_factory=dict)
    by_group: Mapping[str, Mapping[str, Estimate]] = field(default_factory=dict)


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """The response of each case, and what the cases of an axis have in common."""
    from procedures.step import checks, estimates, hum, planes, slewing, untold

    first_look.gate(recording, findings, ())
    before = list(checks.before(recording))
    findings.gate(before)
    exchanged = [] if before else list(planes.find_exchanged(recording))
    plan, steps = recording.plan, read_steps(recording)
    findings.gate(exchanged, so_far=Results(steps))
    findings.gate(checks.of_steps(steps, plan), checks.FATAL, Results(steps))
    by_case = estimates.by_case(steps, recording.rig, plan.band)
    by_group = estimates.by_group(steps, by_case, recording.rig)
    findings.add(frame.describe(recording.rig, plan.axes))
    why = untold.groups(by_case, by_group, recording.rig)
    findings.add(checks.of_results(by_case, by_group, plan, leaning=leans(recording.rig), untold=why))
    findings.add(untold.find_untold(by_case, by_group, why, recording.rig))
    findings.add(slewing.of_sizes(by_case))
    findings.add(slewing.of_starts(steps))
    findings.add(hum.find_hum(steps, by_case))
    findings.add(checks.compare(by_case, plan.names))
    return Results(steps, by_case, by_group)


def measured(results: Results) -> Iterator[Measured]:
    """The quantities of each case, then those over sizes and directions."""
    known = {q.name: q for q in MEASURES}
    for case, result in results.by_case.items():
        for name, estimate in result.estimates.items():
            yield known[name].measured(estimate, case.where)
    for where, found in results.by_group.items():
        for name, estimate in found.items():
            yield known[name].measured(estimate, where)


def model_names(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Parameters that `model_error` changes."""
    return conventions(rig).model_parameters if plan.model_error else ()


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    machine = conventions(rig)
    for axis in plan.axes:
        if not machine.can_point(axis):
            yield f"axes: found {axis}; expected one along which the controller takes set points"
    points = [name for a in plan.axes if machine.can_point(a) for name in machine.point(a, 0.0)]
    if unknown := list(check_settings(plan, rig)):
        yield from unknown
        return
    asked = [name for of in (plan.a, plan.b, plan.warm) for name in written(of, rig)]
    needed = [*points, *model_names(rig, plan), *asked]
    for name in dict.fromkeys(needed):
        if name not in rig.parameters:
            yield f"parameters: found no {name}; needed are those of the plan's settings"
        elif rig.parameters[name].when == "resting":
            yield f"{name}: can be written at rest only; a setting is changed while the shaft levitates"
    if 2 * max(plan.sizes_m) > MARGIN * machine.clearance:
        yield (f"sizes_m: found {max(plan.sizes_m) * 1e6:g} um; with its overshoot that needs more than {MARGIN:.0%} of the "
               f"clearance, {machine.clearance * 1e6:g} um")  # fmt: skip
    if min(plan.sizes_m) <= 0 or len({*plan.sizes_m}) < len(plan.sizes_m) or len({*plan.axes}) < len(plan.axes):
        yield "sizes_m, axes: expected sizes above 0, and each once"
    yield from check_sizes(rig, plan)
    if plan.names[0] == plan.names[1]:
        yield f"names: found {plan.names[0]!r} twice; the settings cannot be told apart"
    if any(0 < s < TURNING_RAD_S or s < 0 for s in plan.speeds_rad_s):
        least = TURNING_RAD_S * RPM
        yield f"speeds_rad_s: found {min(plan.speeds_rad_s) * RPM:.0f} r/min; expected 0, or {least:.0f} r/min and more"
    most = rig.envelope.max_speed_rad_s
    if max(plan.speeds_rad_s) > most:
        yield f"speeds_rad_s: found {max(plan.speeds_rad_s) * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if max(plan.speeds_rad_s) > 0 and not marked(rig):
        yield "speeds_rad_s: the rig tells nothing of how the shaft turns (its mark); expected 0 alone"
    if max(plan.speeds_rad_s) > 0 and not any("drive" in d.roles for d in rig.devices.values()):
        yield "speeds_rad_s: the rig file has no device in the role drive, so that nothing turns the shaft"


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Responses with band and model, control currents, overshoot over the size; the steps as they came where the evaluation
    ended with them."""
    from procedures.step import figures as drawn

    del recording
    return drawn.all_figures(results.steps, results.by_case) if results.by_case else drawn.raw_figures(results.steps)


procedure = Procedure(
    name="step",
    title="Set-point steps of the levitated shaft",
    measures=MEASURES,
    optional=MAY_LACK,  # a finding names what is not told: what does not settle, or follow a fit; what does not swing is a note
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    bring_up=before_lift.lifted,
    step_count=step_count,
    assumes=assumptions.STEP,
    method=read_method(__file__),
)
