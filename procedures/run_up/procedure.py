"""Run-up: the drive takes the levitated shaft through its speeds at a stated acceleration (T 2.6.1, Figs. 2.7 and 2.9).

Measurands: vectors of the shaft's centre of order 1, orbits, D_max, currents and voltages at the speeds of the captures;
critical speeds, their amplification factors, and how far they stand off the running speed. `coast_down` shares the rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from bench.errors import AnalysisError, BenchError
from bench.figures import Shown
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import at_speed
from bench.units import RPM
from procedures.amb_rotor import lift, pushes, wiring
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws
from procedures.amb_rotor.lift import NO_SPEED
from procedures.run_up.fitting import of_plan
from procedures.run_up.plan import Passing, Plan
from procedures.run_up.requires import requires
from procedures.run_up.steps import MISSED, PASSAGE, read_passage
from procedures.shared import assumptions, first_look
from procedures.shared.rates import rate_of
from procedures.synchronous import bearings, dwelling
from procedures.synchronous.default_speeds import within_envelope
from procedures.synchronous.dwells import SLOW, can_capture, captured_channels, read_dwell
from procedures.unbalance import procedure as unbalance
from procedures.unbalance.procedure import CURRENT, D_MAX, MAJOR, READ, SHARE, VOLTAGE

if TYPE_CHECKING:
    from procedures.run_up.estimates import Run

COSINE, SINE = unbalance.COSINE, unbalance.SINE
SPEED = Quantity("critical_speed", "rad/s", "where the amplitude of a probe is greatest, with a factor of 2.5 or more; "
                 "of small orbits")  # fmt: skip
FACTOR = Quantity("amplification_factor", "1", "that speed over the width at 0.707 of the amplitude (API 617, half power); "
                  "of small orbits")  # fmt: skip
AMPLITUDE = Quantity("critical_amplitude", "m", "of the shaft's centre where it was greatest, 0-pk")
MARGIN = Quantity("separation", "1", "distance of the critical speed from the running speed, over the running speed",
                  title="separation margin")  # fmt: skip
CRITICAL = (SPEED, FACTOR, AMPLITUDE, MARGIN)  # which a well damped shaft does not have
MEASURES = (COSINE, SINE, MAJOR, D_MAX, SHARE, READ, CURRENT, VOLTAGE, *CRITICAL)
LOOK_S = 0.2
NEAR_END = 0.004  # of a speed that the drive is asked for: its own control leaves as much
LATE = 2.0  # of the time that a ramp should take
COAST_S = 240.0  # a coast-down is given at most
HOLD_S = 0.5
AFTER_S = 5.0  # the drive has passed a speed: a capture that has not come by then does not come


def settings(rig: RigFile, plan: Passing) -> dict[str, float]:
    """Lifted by the PID, which needs no model."""
    del plan
    return conventions(rig).lifting


def step_count(plan: Passing) -> int:
    """How many steps `acquire` records, for the progress display."""
    return lift.STEPS + (plan.slow_rad_s > 0) + 1


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, nudge it, roll it slowly, run it up, and stop it."""
    if not begin(rig, plan, record):
        return
    if lift.bring_to_speed(rig, record, plan.bottom_rad_s, plan.settle_s):
        pass_speeds(rig, plan, record, "up", plan.top_rad_s)
    end(rig, plan)


def begin(rig: Rig, plan: Passing, record: Recorder) -> bool:
    """Lift, nudge and slow roll, then set the controller as planned; False where the run ends here."""
    if not dwelling.roll_slowly(rig, record, plan.law, plan.slow_rad_s, plan.slow_s, plan.settle_s):
        return False
    lift.write(rig, plan.parameters)
    return True


def end(rig: Rig, plan: Passing) -> None:
    """Stop the shaft, and give the controller its own settings again."""
    if rig.drive is not None:
        rig.drive.stop()
        rig.drive.coast()
        if plan.rate_rad_s2:
            rig.drive.set_acceleration(0.0)
    lift.write(rig, {name: rig.file.parameters[name].default for name in plan.parameters})
    dwelling.stop(rig)


def pass_speeds(rig: Rig, plan: Passing, record: Recorder, direction: str, goal: float) -> None:
    """Through all speeds to `goal` in rad/s, with captures on the way; the drive coasts where the plan gives no rate."""
    drive, rate = rig.drive, plan.rate_rad_s2
    assert drive is not None
    up = direction == "up"
    begin = drive.speed_rad_s
    patience = LATE * abs(goal - begin) / rate + 10 if rate else COAST_S
    with record.step(PASSAGE, direction=direction, acceleration_rad_s2=rate, from_rad_s=begin, to_rad_s=goal):
        rig.clock.sleep(HOLD_S)
        armed = sorted(plan.speeds_rad_s, reverse=not up)
        _arm(rig, plan, armed[0])
        if rate:
            drive.set_acceleration(rate)
            drive.set_speed(goal)
        else:
            drive.coast()
        started = rig.clock.now_ns()

        def left() -> float:
            return patience - (rig.clock.now_ns() - started) * 1e-9

        for k, speed in enumerate(armed):
            if (drive.speed_rad_s > speed) if up else (drive.speed_rad_s < speed):
                record.event(
                    MISSED, wanted=speed, why="the shaft was past it before the capture before it was uploaded"
                )
                continue
            if k:
                _arm(rig, plan, speed)
            while ((drive.speed_rad_s < speed) if up else (drive.speed_rad_s > speed)) and left() > 0:
                rig.clock.sleep(LOOK_S)
            _fetch(rig, plan, record, speed)
        near = max(0.5, NEAR_END * goal)
        while (drive.speed_rad_s < goal - near) if up else (drive.speed_rad_s > goal + near):
            if left() <= 0:
                record.event(NO_SPEED, wanted=goal, why=late(patience, drive.speed_rad_s, rate))
                return
            rig.clock.sleep(LOOK_S)
        rig.clock.sleep(HOLD_S if up else 0.0)


def late(patience: float, rad_s: float, rate: float) -> str:
    """What a passage that took too long came to, and the way out."""
    reached = f"after {patience:.0f} s it turns at {rad_s * RPM:.0f} r/min. "
    if rate:
        return f"{reached}The drive does not keep its ramp of {rate:g} rad/s^2: ramp more slowly, or look at its torque limit"
    return (f"{reached}It coasts, and its drag slows it no further in that time: set bottom_rad_s above {rad_s:.0f} rad/s, or "
            "let the drive ramp it down (deceleration_rad_s2)")  # fmt: skip


def _arm(rig: Rig, plan: Passing, speed: float) -> None:
    if rig.capture is not None and can_capture(rig.file):
        names = captured_channels(conventions(rig.file))
        rig.capture.arm(
            names,
            seconds=plan.capture_s,
            before_s=plan.capture_s / 2,
            rate_hz=rate_of(rig.file, plan.rate_hz),
            trigger=at_speed(speed),
        )


def _fetch(rig: Rig, plan: Passing, record: Recorder, speed: float) -> None:
    """The capture at a speed; the analysis tells where there is none."""
    if rig.capture is None or not can_capture(rig.file):
        return
    try:
        rig.capture.wait(plan.capture_s + AFTER_S)
        rig.capture.upload(passed_rad_s=speed)
    except BenchError as error:
        if type(error) is not BenchError:  # a fault, a lost link, an interlock: the end of the run
            raise
        record.event(MISSED, wanted=speed, why=str(error))
        rig.capture.cancel()


def evaluate(recording: Recording[Any], findings: Findings) -> Run:
    """The passage's curves with their criticals, and the vectors at the captures' speeds."""
    from procedures.run_up import checks, estimates
    from procedures.synchronous import checks as dwell_checks
    from procedures.synchronous.coil_peaks import find_uncertified

    first_look.gate(recording, findings, wiring.before_orbits(recording))
    findings.gate([*wiring.before_orbits(recording), *checks.before(recording)])
    plan = recording.plan
    slow = next((read_dwell(recording, s) for s in recording.steps(SLOW)), None)
    # what a steady speed shows, a changing one may hide
    rolls = [slow] if slow else []
    findings.gate([*(dwell_checks.of_signals(rolls, plan.max_lost, plan.max_speed_error) if slow else ()),
                   *dwell_checks.slow_roll(rolls, plan.speeds_rad_s)])  # fmt: skip
    try:
        passage = read_passage(recording)
    except AnalysisError as error:
        findings.end(Finding("no-passage", str(error), "", Effect.ERROR))
    findings.gate(checks.of_passage(passage, recording, plan))
    known = bearings.Known.of(recording.calibrations, plan.beta_share, plan.offset_u_m)
    try:
        run = estimates.run(passage, slow, recording, plan, known)
    except AnalysisError as error:  # a drive that was faster than it was told: too few turns for a curve
        findings.end(Finding("no-passage", str(error), passage.name, Effect.ERROR))
    findings.add((bearings.describe(run.known), *find_uncertified(recording.rig), *dwelling.uncaptured(recording.rig)))
    findings.add(dwelling.left_out(recording.rig))
    findings.add(checks.of_run(run, recording, plan))
    return run


def measured(run: Run) -> Iterator[Measured]:
    """At the captures' speeds, then of every critical."""
    known = {q.name: q for q in MEASURES}
    for result in run.near.dwells if run.near else ():
        for (name, place), estimate in result.estimates.items():
            yield known[name].measured(estimate, f"{place}, {result.dwell.where}" if place else result.dwell.where)
    for peak in run.peaks:
        if peak.critical and peak.factor is not None:
            yield SPEED.measured(peak.speed, peak.where)
            yield FACTOR.measured(peak.factor, peak.where)
            yield AMPLITUDE.measured(peak.amplitude, peak.where)
            yield MARGIN.measured(peak.margin, peak.where)


def check(rig: RigFile, plan: Passing) -> Iterable[str]:
    """What cannot work before anything starts."""
    lacking = [f"parameters: the rig has no {name}" for name in plan.parameters if name not in rig.parameters]
    yield from of_laws(conventions(rig), "law", [plan.law])
    yield from lacking or of_plan(rig, plan)


def figures(run: Run, recording: Recording[Any]) -> Iterable[Shown]:
    """Bode pairs, polar plots, waterfall, order map, coil use, orbits."""
    from procedures.run_up import figures as drawn

    return drawn.all_figures(run, recording.rig, recording.plan.running_rad_s)


procedure = Procedure(
    name="run-up",
    places=("up",),
    title="Run-up of the levitated shaft",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    planned=lambda rig: within_envelope(rig, Plan, "top_rad_s", "running_rad_s", "speeds_rad_s"),
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    steps_on=lambda rig, plan: step_count(plan) + pushes.count(rig),
    needs=lambda plan: bearings.needs(plan.bearings),
    optional=CRITICAL,
    untold=unbalance.of_captures,
    assumes=assumptions.PASSAGE,
    method=read_method(__file__),
)
