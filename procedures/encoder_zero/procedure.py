"""Zeros of encoders: where the field of each motor lies against its encoder, by steps of the current along it.

Measurands, by motor: the zero that the controller's parameter would have to have, rad electrical, as the encoder counts (the
field's phase is 2 pi x/period - zero); and between motors that one loop drives the ratio of their constants. While a loop holds
the mover still, a current along a field that is laid wrong gives force, which the current across takes off.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING

from bench.errors import BenchError, Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.encoder_zero import groups
from procedures.encoder_zero.groups import PLACES, TRIAL_REPEATS, Group, Setting, parameter_of, settings_of
from procedures.encoder_zero.plan import Plan
from procedures.encoder_zero.requires import requires
from procedures.encoder_zero.steps import STEP, Taken, read_taken
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

if TYPE_CHECKING:
    from procedures.encoder_zero.estimates import Result

ZERO = Quantity("zero", "rad", "electrical angle of the encoder at which the motor's field lies along its first phase")
RATIO = Quantity("K_ratio", "1", "force or torque per ampere of the one motor over that of the other")
MEASURES = (ZERO, RATIO)
MARGIN_S = 1e-3  # of a capture
NAMED = 3  # motors of one loop, for the progress display


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records of three motors, two of them on one loop, for the progress display."""
    once = 2 * (2 * NAMED - 2) * PLACES * plan.repeats
    return once + (2 * (2 * NAMED + 1) * TRIAL_REPEATS if plan.trial_rad else 0)


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The plan's observer; zeros as the rig file has them, no current stepped."""
    out = planned.observer(rig, plan.observer)
    for one in groups.zeros(rig).values():
        out[one.zero] = rig.parameters[one.zero].default
    return out


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """At two places, step the currents of each loop's motors; at the last one once more with each zero changed."""
    numbers = count(1)
    of = groups.groups(rig.file, plan)
    for place in range(PLACES):
        rig.levitation.write({groups.set_point(rig.file, g.loop): groups.target(rig.file, g, place) for g in of})
        rig.clock.sleep(plan.move_s + max(groups.settle_s(rig.file, plan, g) for g in of))
        for group in of:
            for one in settings_of(group, place, "", plan.repeats):
                _take(rig, plan, record, group, one, numbers)
            _rest(rig, plan, group)
    for group in of if plan.trial_rad else ():
        for motor in group.motors:
            with _changed(rig, motor, plan.trial_rad):
                rig.clock.sleep(groups.settle_s(rig.file, plan, group))
                for one in settings_of(group, PLACES - 1, motor, TRIAL_REPEATS):
                    _take(rig, plan, record, group, one, numbers)
                _rest(rig, plan, group)


def _take(rig: Rig, plan: Plan, record: Recorder, group: Group, one: Setting, numbers: Iterator[int]) -> None:
    """Set a current, wait until the loop has settled, capture."""
    assert rig.capture is not None
    quiet = {parameter_of(rig.file, m, w): 0.0 for m, w in group.stepped if (m, w) != (one.motor, one.way)}
    labels: dict[str, float | str] = {**vars(one), "current_A": one.sign * plan.current_A, "number": next(numbers)}
    seconds, rate = plan.window_s + MARGIN_S, groups.rate(rig.file, plan)
    try:
        if one.repeat == 0:
            rig.levitation.write(quiet)
        rig.levitation.set(parameter_of(rig.file, one.motor, one.way), one.sign * plan.current_A)
        rig.clock.sleep(groups.settle_s(rig.file, plan, group))
        with record.step(STEP, **labels):
            rig.capture.arm(groups.captured(rig.file, group), seconds=seconds, rate_hz=rate)
            rig.capture.wait(seconds + 5.0)
        rig.capture.upload(None, **labels)
    except BaseException:
        with suppress(BenchError):
            rig.levitation.set(parameter_of(rig.file, one.motor, one.way), 0.0)
        raise


def _rest(rig: Rig, plan: Plan, group: Group) -> None:
    rig.levitation.write({parameter_of(rig.file, m, w): 0.0 for m, w in group.stepped})
    rig.clock.sleep(groups.settle_s(rig.file, plan, group))


@contextmanager
def _changed(rig: Rig, motor: str, by: float) -> Iterator[None]:
    """With the controller's zero of a motor changed; back again in the end, whatever happens."""
    parameter = groups.zeros(rig.file)[motor].zero
    known = rig.file.parameters[parameter].default
    rig.levitation.set(parameter, known + by)
    try:
        yield
    except BaseException:
        with suppress(BenchError):
            rig.levitation.set(parameter, known)
        raise
    rig.levitation.set(parameter, known)


@dataclass(frozen=True)
class Results:
    """Of each group, and what was taken."""

    groups: tuple[Result, ...]
    taken: tuple[Taken, ...]


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Zeros and ratios."""
    from procedures.encoder_zero import checks, estimates

    taken, rig, plan = read_taken(recording), recording.rig, recording.plan
    told = tuple(checks.of_signals(taken, rig, plan))
    findings.gate(told)
    found = estimates.results(taken, rig, plan)
    findings.add(checks.of_results(found, rig, plan, {name for one in told for name in one.concerns}))
    return Results(tuple(found), tuple(taken))


def measured(results: Results) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for found in results.groups:
            for (name, where), estimate in found.estimates.items():
                if name == quantity.name:
                    yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    known = groups.zeros(rig)
    for motor in (m for m in plan.motors if m not in known):
        yield f"motors: found {motor}; the controller keeps the zeros of {', '.join(known)}"
        return
    yield from planned.of_observer(rig, plan.observer)
    yield from of_rate(rig, plan.rate_hz)
    for group in groups.groups(rig, plan):
        try:
            wanted = {groups.set_point(rig, group.loop): groups.target(rig, group, PLACES - 1)}
        except Lacking as error:
            yield str(error)
            continue
        wanted |= {parameter_of(rig, m, w): plan.current_A for m, w in group.stepped}
        wanted |= {known[m].zero: rig.parameters[known[m].zero].default + plan.trial_rad for m in group.motors}
        yield from (f"{', '.join(group.motors)}: {problem}" for problem in Envelope(rig).problems_of(wanted))


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """The current across over that along, of each motor."""
    from procedures.encoder_zero import figures as drawn

    del recording
    return drawn.all_figures(results.groups, results.taken)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """A motor that is alone on its loop has no other to be compared with."""
    return () if any(len(g.motors) > 1 for g in groups.groups(rig)) else (RATIO,)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """Of chosen motors there may be no two."""
    return (RATIO,) if plan.motors else ()


procedure = Procedure(
    name="encoder-zero",
    title="Electrical zeros of the motors' encoders",
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
    steps_on=groups.count,
    untold=untold,
    optional=(RATIO,),
    left_out=left_out,
    reached=("scatter/*",),
    assumes=assumptions.ENCODER_ZERO,
    method=read_method(__file__),
)
