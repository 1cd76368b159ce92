"""Step response of a machine's current loops (G1): rise of a large step, band of a small one, what goes across.

Measurands, by place: `rise_time` and `fall_time` of a large step and the `rise_bandwidth` that a rise time is told as; the
`bandwidth_small` of a small one, the `bandwidth_design` that is computed and not measured: three bands that are no estimates of
each other. The currents are those that the controller's own sensors read, in its own frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.errors import Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from procedures.current_step import fit
from procedures.current_step.plan import Plan
from procedures.current_step.requires import requires
from procedures.current_step.steps import (
    LARGE,
    PUSH,
    SLOWER,
    SMALL,
    channels,
    place_of,
    read_pushed,
    read_taken,
)
from procedures.shared import assumptions

if TYPE_CHECKING:
    from procedures.current_step.estimates import Place

RISE = Quantity("rise_time", "s", "10 to 90 % of the large step, with whatever limits act on its way")
FALL = Quantity("fall_time", "s", "10 to 90 % of the large step back")
RISE_BAND = Quantity("rise_bandwidth", "Hz", "1/(3 rise_time): a rise time told as a frequency, no frequency response",
                     title="rise bandwidth, 1/(3 t_r)")  # fmt: skip
SMALL_BAND = Quantity("bandwidth_small", "Hz", "-3 dB of the small step's response, no limit touched",
                      title="bandwidth of the small signal")  # fmt: skip
DESIGN = Quantity("bandwidth_design", "Hz", "proportional gain over 2 pi times the stated inductance: computed, not measured",
                  title="bandwidth by design")  # fmt: skip
OVERSHOOT = Quantity("overshoot", "1", "of the large step beyond where it comes to rest, over its size")
ACROSS = Quantity(
    "across",
    "1",
    "largest current across a large step up to three rise times after it, less that before, over its size",
)
U_DC = Quantity("u_dc", "V", "voltage of the DC link before the large steps", title="supply")
MEASURES = (RISE, RISE_BAND, SMALL_BAND, DESIGN, ACROSS, OVERSHOOT, FALL, U_DC)


@dataclass(frozen=True)
class Result:
    """What was found at each place."""

    places: tuple[Place, ...]


def captures(rig: RigFile, plan: Plan) -> Iterator[tuple[str, str, float, int]]:
    """Kind, place, size A and repeat of every capture, in their order."""
    for name in plan.steps_at:
        if place_of(rig, name).still:
            yield PUSH, name, plan.size_A, 0
        yield from ((LARGE, name, plan.size_A, k) for k in range(plan.repeats))
        yield from ((SMALL, name, plan.small_A, k) for k in range(plan.small_repeats))


MORE = 4  # times the spare time that a further attempt has, each


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records on a rig that tells positions beside the currents."""
    return len(plan.steps_at) * (1 + plan.repeats + plan.small_repeats)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records."""
    return sum(1 for _ in captures(rig, plan))


def seconds(plan: Plan, kind: str) -> float:
    """How long a capture lasts."""
    return (2 * plan.push_s if kind == PUSH else plan.lead_s + 2 * plan.hold_s) + plan.spare_s


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Of each place a held step with the positions, then large steps and small ones, each up and back in one capture. One that
    a slow line left outside of its capture is taken again, with more to spare; where that brings nothing, no further one."""
    assert rig.capture is not None
    rig.clock.sleep(plan.settle_s)
    tries = plan.tries
    for number, (kind, name, size, repeat) in enumerate(captures(rig.file, plan)):
        labels: dict[str, str | float] = {"number": number, "place": name, "size_A": size, "repeat": repeat}
        came = any(_captured(rig, plan, record, kind, attempt, labels) for attempt in range(tries))
        tries = tries if came else 1


def _captured(rig: Rig, plan: Plan, record: Recorder, kind: str, attempt: int, labels: dict[str, str | float]) -> bool:
    """Take one capture; whether the step and the step back are in it."""
    assert rig.capture is not None
    place, size = place_of(rig.file, str(labels["place"])), float(labels["size_A"])
    lasts = seconds(plan, kind) + attempt * MORE * plan.spare_s
    rate = rig.capture.rate_hz / (SLOWER if kind == PUSH else 1)
    with record.step(kind, attempt=attempt, **labels):
        rig.capture.arm(channels(place, kind, int(labels["repeat"])), seconds=lasts, rate_hz=rate)
        rig.clock.sleep(plan.push_s if kind == PUSH else plan.lead_s)
        rig.levitation.set(place.parameter, size)
        rig.clock.sleep(plan.push_s if kind == PUSH else plan.hold_s)
        rig.levitation.set(place.parameter, 0.0)
        rig.capture.wait(lasts + 5.0)
    data = rig.capture.upload(None, number=labels["number"], attempt=attempt)
    if kind == PUSH:
        return True
    along = data.columns[place.along]
    pair = fit.edges(along, size, 1 / data.rate_hz)
    return pair is not None and pair[1].at + round(plan.response_s * data.rate_hz) < len(along)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Steps at every place, what limited them, and whether the mover stayed."""
    from procedures.current_step import checks, estimates

    plan, taken = recording.plan, read_taken(recording)
    findings.gate([*checks.of_pushes(read_pushed(recording), plan), *checks.of_signals(taken, plan)])
    places = estimates.evaluate(taken, recording.rig, plan)
    findings.add(checks.of_result(places))
    return Result(places)


def measured(result: Result) -> Iterator[Measured]:
    """The quantities of each place; the supply, which is one, once."""
    for number, place in enumerate(result.places):
        yield from (q.measured(place.estimates[q.name], place.name) for q in MEASURES
                    if q is not U_DC and q.name in place.estimates)  # fmt: skip
        if not number and U_DC.name in place.estimates:
            yield U_DC.measured(place.estimates[U_DC.name])


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Of each place the large step along and across, what the half-bridges did, and the response of the small step."""
    from procedures.current_step import figures as drawn

    return drawn.all_figures(result.places, recording.plan)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    assert rig.capture is not None
    if len(set(plan.steps_at)) < len(plan.steps_at):
        yield f"steps_at: found {plan.steps_at}; expected each place once"
    if plan.small_A >= plan.size_A:
        yield f"small_A: found {plan.small_A:g} A; expected less than size_A, {plan.size_A:g} A"
    if plan.response_s > plan.hold_s / 2:
        yield f"response_s: found {plan.response_s:g} s; expected half of hold_s, {plan.hold_s / 2:g} s, or less"
    tick_s = rig.devices["controller"].tick_s
    for name in plan.steps_at:
        try:
            place = place_of(rig, name)
        except Lacking as error:
            yield str(error)
            continue
        parameter = rig.parameters[place.parameter]
        if plan.size_A > parameter.high:
            yield f"size_A: found {plan.size_A:g} A; {place.parameter} is at most {parameter.high:g} A"
        size = Layout.of(rig.capture, place.captured).sample.itemsize
        if (needed := size * seconds(plan, LARGE) / tick_s) > rig.capture.memory_bytes:
            yield (f"hold_s: a capture of {seconds(plan, LARGE):.3g} s takes {needed:.0f} bytes; the controller's memory holds "
                   f"{rig.capture.memory_bytes}")  # fmt: skip


procedure = Procedure(
    name="current-step",
    title="Step response of the current loops",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=step_count,
    steps_on=steps_on,
    optional=(DESIGN, U_DC),
    assumes=assumptions.CURRENT_STEP,
    method=read_method(__file__),
)
