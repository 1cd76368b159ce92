"""Response of position loops: |y/r| with the reference and its rate injected, and |S| with the reading injected.

Measurands, by loop, all other loops closed: where |y/r| falls through -3 dB, and the greatest |S|. Beside them, computed
and not measured: where an ideal
actuator's would.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import TYPE_CHECKING

from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.loop_response import grid
from procedures.loop_response.fit import TOP_DEGREE
from procedures.loop_response.injection import (
    BELOW,
    REFERENCE,
    SENSOR,
    ability,
    chosen,
    injected,
    parameters_of,
    rate,
    sensitive,
    settle_s,
    sine,
)
from procedures.loop_response.plan import Plan
from procedures.loop_response.requires import requires
from procedures.loop_response.steps import REFINED, STEP, SURVEY, line_of, read_taken
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

if TYPE_CHECKING:
    from procedures.loop_response.estimates import Result

BANDWIDTH = Quantity(
    "bandwidth", "Hz", "where |y/r| of a loop falls to -3 dB, reference and rate injected, all others closed"
)
IDEAL = Quantity(
    "bandwidth_ideal", "Hz", "the same of the loop alone with an ideal actuator: computed of gains and masses"
)
S_MAX = Quantity("s_max", "1", "greatest |S| of a loop, all others closed (ISO 14839-3)", title="S_max")
AT = Quantity("s_max_hz", "Hz", "frequency of the greatest |S|", title="frequency of S_max")
MEASURES = (BANDWIDTH, IDEAL, S_MAX, AT)
MARGIN_S = 1e-3  # of a capture
LEAST_ABOUT = TOP_DEGREE + 2  # lines about the greatest |S|: one more than its curve has terms


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records of six loops at most, for the progress display."""
    return (len(plan.axes) or 6) * (2 * (plan.lines + 2 * grid.BESIDE + plan.refined) + grid.most_in_gaps(plan))


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig, at most."""
    some = len(sensitive(rig, plan))
    return (len(chosen(rig, plan)) + some) * (plan.lines + 2 * grid.BESIDE + plan.refined) + some * grid.most_in_gaps(
        plan
    )


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Nothing is injected."""
    del plan
    can = ability(rig)
    return {can.axis: can.off}


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Go to the place, and look at each loop: by its reference, then by its reading."""
    for name, value in plan.parameters.items():
        rig.levitation.write({name: value})
    rig.clock.sleep(plan.settle_s)
    numbers = count(1)
    for axis in chosen(rig.file, plan):
        _reference(_Look(rig, plan, record, axis, REFERENCE, numbers))
        if axis in sensitive(rig.file, plan):
            _sensor(_Look(rig, plan, record, axis, SENSOR, numbers))


class _Look:
    """Sines into one loop at one place; `seen`, the sizes by frequency of what was captured."""

    def __init__(self, rig: Rig, plan: Plan, record: Recorder, axis: str, place: str, numbers: Iterator[int]) -> None:
        self.rig, self.plan, self.record, self.axis, self.place, self.numbers = rig, plan, record, axis, place, numbers
        self.seen: dict[float, float] = {}

    def take(self, hz: float, kind: str) -> None:
        """Inject, capture, upload; what it seems to be is kept, for deciding how to go on."""
        rig, plan, can = self.rig, self.plan, ability(self.rig.file)
        if not plan.low_hz / 2 <= hz <= BELOW * rate(rig.file, plan):
            return
        one = sine(rig.file, plan, self.axis, self.place, hz, plan.survey_s if kind == SURVEY else plan.refined_s)
        channel = can.loops[self.axis].channel
        labels: dict[str, float | str] = {
            "axis": self.axis, "place": self.place, "pass": kind, "hz": one.hz, "amplitude": one.amplitude,
            "periods": one.periods, "samples": one.samples, "number": next(self.numbers),
        }  # fmt: skip
        assert rig.capture is not None
        start = plan.start_s if kind == SURVEY else settle_s(rig.file, plan, self.axis)
        with injected(rig, self.axis, self.place, one, start):
            with self.record.step(STEP, **labels):
                seconds = one.samples / rate(rig.file, plan) + MARGIN_S
                rig.capture.arm(
                    [channel, *([can.wave] if can.wave else [])], seconds=seconds, rate_hz=rate(rig.file, plan)
                )
                rig.capture.wait(seconds + 5.0)
        columns = rig.capture.upload(None, **labels).columns
        try:
            self.seen[one.hz] = line_of(columns, channel, can.wave, labels).size
        except AnalysisError:
            return  # which the analysis tells


def _reference(look: _Look) -> None:
    """Upwards until it has fallen, then halve what encloses -3 dB, then finely about it."""
    for hz in grid.survey(look.plan):
        if grid.goes_on(look.seen):
            look.take(hz, SURVEY)
    for _ in range(grid.HALVINGS):
        if (middle := grid.halving(look.seen)) is not None:
            look.take(middle, SURVEY)
    if (about := grid.fall(look.seen, look.plan.within)) is not None:
        for hz in grid.about(*about, look.plan.refined):
            look.take(hz, REFINED)


def _sensor(look: _Look) -> None:
    """The whole range, closer where the greatest may be, then beside it, then finely about it."""
    for hz in grid.survey(look.plan):
        look.take(hz, SURVEY)
    asked: set[float] = set()  # a line that cannot be read leaves its gap as wide as it was
    while middles := set(grid.gaps(look.seen)) - asked:
        for hz in sorted(middles):
            look.take(hz, SURVEY)
        asked |= middles
    for _ in range(grid.BESIDE if look.seen else 0):
        for hz in grid.beside(look.seen):
            look.take(hz, SURVEY)
    if look.seen:
        for hz in grid.about(*grid.top(look.seen), look.plan.refined):
            look.take(hz, REFINED)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Bandwidth and sensitivity of each loop."""
    from procedures.loop_response import checks, estimates

    taken = read_taken(recording)
    findings.gate(checks.of_signals(taken, recording.rig, recording.plan))
    results, failed = estimates.results(taken, recording.rig, recording.plan)
    findings.add(failed)
    findings.add(checks.of_results(results))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """The quantities of each loop."""
    for quantity in MEASURES:
        for result in results:
            if quantity.name in result.estimates:
                yield quantity.measured(result.estimates[quantity.name], result.axis)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    can = ability(rig)
    for key, axes in (("axes", plan.axes), ("sensitive", plan.sensitive or ()), ("amplitude", plan.amplitude)):
        for axis in (a for a in axes if a not in can.loops):
            yield f"{key}: found {axis}; the controller injects into {', '.join(can.loops)}"
            return
    if plan.sensitive and (not can.wave or SENSOR not in can.places):
        yield "sensitive: the controller adds nothing to a reading, or no capture shows what it adds; expected none"
        return
    if problems := list(planned.of_parameters(rig, plan.parameters)):
        yield from problems
        return
    if plan.refined < LEAST_ABOUT and (looked := sensitive(rig, plan)):
        yield (f"refined: found {plan.refined} lines; expected {LEAST_ABOUT} or more, which the curve about the greatest |S| "
               f"of {', '.join(looked)} needs")  # fmt: skip
    if plan.high_hz > BELOW * rate(rig, plan):
        most = f"{BELOW * rate(rig, plan):g} or less: {BELOW:g} of the rate of captures"
        yield f"high_hz: found {plan.high_hz:g}; expected {most}"
    yield from of_rate(rig, plan.rate_hz)
    for axis in chosen(rig, plan):
        for place in (REFERENCE, *([SENSOR] if axis in sensitive(rig, plan) else ())):
            one = sine(rig, plan, axis, place, plan.high_hz, plan.survey_s)
            wanted = {**plan.parameters, **parameters_of(can, place, one)}
            yield from (f"{axis}, {place}: {problem}" for problem in Envelope(rig).problems_of(wanted))


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """|y/r| of all loops with their -3 dB, and |S| over its zones."""
    from procedures.loop_response import figures as drawn

    del recording
    return drawn.all_figures(results)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """Without the wave there is no |S|; without masses no ideal bandwidth."""
    can = ability(rig)
    told = any(loop.inertia for loop in can.loops.values())
    return (*(() if can.wave and SENSOR in can.places else (S_MAX, AT)), *(() if told else (IDEAL,)))


procedure = Procedure(
    name="loop-response",
    title="Response of the position loops",
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
    steps_on=steps_on,
    fewest_steps=lambda plan: 1,
    untold=untold,
    optional=(S_MAX, AT),  # of none that is chosen
    left_out=lambda plan: (S_MAX, AT) if plan.sensitive == () else (),
    assumes=assumptions.LOOP_RESPONSE,
    method=read_method(__file__),
)
