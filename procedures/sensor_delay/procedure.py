"""Delays of position sensors, by the phase of positions against the currents that push.

Measurand, by probe: the time by which its reading is behind the position at the instant of the currents of the same row of a
capture, s: filter, conversion and what the samples are apart; the slope of its phase at low frequencies.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING

from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.position_loops.injection import BELOW, FORCE, Sine, ability, injected, parameters_of
from procedures.sensor_delay.plan import Plan
from procedures.sensor_delay.requires import requires
from procedures.sensor_delay.sines import captured, probes, rate, sines
from procedures.sensor_delay.steps import SINE, read_taken
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

if TYPE_CHECKING:
    from procedures.sensor_delay.estimates import Result

DELAY = Quantity("delay", "s", "time by which a probe's reading is behind the currents that are read with it",
                 title="delay of the position sensor")  # fmt: skip
MARGIN_S = 1e-3  # of a capture
USUAL = 4  # probes, for the progress display


def step_count(plan: Plan) -> int:
    """Of four probes, for the progress display."""
    return USUAL * plan.lines


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    return len(probes(rig)) * plan.lines


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The observer; nothing is injected."""
    can = ability(rig)
    return {can.axis: can.off, **planned.observer(rig, plan.observer)}


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """At each frequency a sine into every loop in turn."""
    rig.clock.sleep(plan.settle_s)
    numbers = count(1)
    for line in range(plan.lines):
        for probe in probes(rig.file):
            _sine(rig, plan, record, probe.loop, line, sines(rig.file, plan, probe.loop)[line], next(numbers))


def _sine(rig: Rig, plan: Plan, record: Recorder, loop: str, line: int, one: Sine, number: int) -> None:
    assert rig.capture is not None
    labels: dict[str, float | str] = {
        "loop": loop, "line": line, "hz": one.hz, "amplitude": one.amplitude, "periods": one.periods, "samples": one.samples,
        "number": number,
    }  # fmt: skip
    seconds = one.samples / rate(rig.file, plan) + MARGIN_S
    with injected(rig, loop, FORCE, one, plan.start_s):
        with record.step(SINE, **labels):
            rig.capture.arm(list(captured(rig.file)), seconds=seconds, rate_hz=rate(rig.file, plan))
            rig.capture.wait(seconds + 5.0)
    rig.capture.upload(None, **labels)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Delay of each probe."""
    from procedures.sensor_delay import checks, estimates

    rig, plan, taken = recording.rig, recording.plan, read_taken(recording)
    findings.gate(checks.of_signals(taken, rig, plan))
    results = estimates.results(taken, rig, plan)
    findings.gate(checks.of_results(results, rig, plan))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """Of each probe."""
    for result in results:
        yield DELAY.measured(result.estimate, result.probe.channel)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from planned.of_observer(rig, plan.observer)
    yield from of_rate(rig, plan.rate_hz)
    if plan.high_hz > BELOW * rate(rig, plan) or plan.high_hz < 2 * plan.low_hz:
        yield f"high_hz: found {plan.high_hz:g}; expected {2 * plan.low_hz:g} to {BELOW * rate(rig, plan):g}"
        return
    for probe in probes(rig):
        one = sines(rig, plan, probe.loop)[-1]
        if not one.amplitude:
            yield f"{probe.loop}: found no limit of its force; expected one, of which the sines take a share"
        problems = Envelope(rig).problems_of(parameters_of(ability(rig), FORCE, one))
        yield from (f"{probe.loop}: {problem}" for problem in problems)


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """Phases over the frequency."""
    from procedures.sensor_delay import figures as drawn

    del recording
    return drawn.all_figures(results)


procedure = Procedure(
    name="sensor-delay",
    title="Delays of position sensors",
    measures=(DELAY,),
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
    reached=("scatter/*",),
    assumes=assumptions.SENSOR_DELAY,
    method=read_method(__file__),
)
