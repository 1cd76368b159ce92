"""Sines that a positioned stage follows, each axis alone and all at once: errors, amplitude ratio and lag.

Measurands, by axis and mode, means over the periods that count: the largest |place - set point| of a period by the encoder's
own scale and as it truly is, and its rms; the fundamental of the place over that of the set point, and how late it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.sine_following import estimates
from procedures.sine_following.estimates import LAG, LARGEST, RATIO, RMS, TRUE, Results
from procedures.sine_following.plan import Plan
from procedures.sine_following.requires import requires
from procedures.sine_following.steps import SINE, amplitude, modes_of, read
from procedures.stages import assumptions, tracks
from procedures.stages.tracks import TOGETHER, Mode, chosen, sisters, waits_at

MOST = sisters(LARGEST, "largest |place - set point| of a period, by the encoder's own scale, mean over periods")
TRULY = sisters(TRUE, "largest |true place - set point| of a period, mean over periods")
SQUARE = sisters(RMS, "rms of place less set point, by the encoder's own scale")
AMPLITUDE = Quantity(RATIO, "1", "amplitude of the place over that of the set point, fundamental")
LATE = Quantity(LAG, "s", "how late the place follows, by the phase of the fundamental; negative: ahead")
PAIRS = (MOST, TRULY, SQUARE)
MEASURES = (*MOST, *TRULY, *SQUARE, AMPLITUDE, LATE)
SPARE_S = 0.05  # recorded after the last period


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """Integrators."""
    return tracks.settings_of(rig, plan.integrators)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each mode from where all axes wait; they end there."""
    assert rig.motion is not None
    axes = chosen(rig.file, plan.moved)
    rest = {a.name: waits_at(a) for a in axes}
    rates = {a.rate: rig.motion.get(a.rate) for a in axes if a.rate}
    for mode in modes_of(rig.file, plan):
        rig.motion.move(rest)
        rig.motion.write(waves(axes, mode, plan))
        _ride(rig, plan, record, mode, dict.fromkeys(rates, 0.0))
        rig.motion.write(rates)
        rig.motion.stop()
        rig.motion.write({a.wave.kind: a.wave.off for a in axes if a.wave})
    rig.motion.move(rest)


def _ride(rig: Rig, plan: Plan, record: Recorder, mode: Mode, at_once: Mapping[str, float]) -> None:
    """Shaped at first, so that nothing jumps to a sine that does not begin at zero."""
    assert rig.motion is not None
    begun = rig.clock.now_ns()
    rig.motion.play()
    rig.clock.sleep(plan.shaped_s)
    rig.motion.write(at_once)
    rig.clock.sleep(max(plan.lead * plan.period_s + plan.shaped_s - 1e-9 * (rig.clock.now_ns() - begun), 0.0))
    with record.step(SINE, mode=mode.name):
        rig.clock.sleep(plan.periods * plan.period_s + SPARE_S)


def waves(axes: Iterable[StageAxis], mode: Mode, plan: Plan) -> dict[str, float]:
    """What is written before a mode: sines for its axes, none for the others."""
    out: dict[str, float] = {}
    for a in axes:
        assert a.wave is not None
        assert a.wave.sine is not None
        moves = a in mode.axes
        leads = mode.name == TOGETHER and a == mode.axes[0]
        out |= {a.wave.kind: a.wave.sine if moves else a.wave.off, a.wave.amplitude: amplitude(a, plan) if moves else 0.0,
                a.wave.period: plan.period_s}  # fmt: skip
        if a.wave.phase:
            out[a.wave.phase] = plan.lead_turns if leads else 0.0
    return out


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Whether set points were sines, and what the axes did."""
    from procedures.sine_following import checks

    rig, plan, rides = recording.rig, recording.plan, read(recording)
    findings.gate(checks.of_rides(rides, rig, plan))
    groups = estimates.grouped(rides, plan)
    findings.add(checks.of_groups(groups, rig, plan))
    return estimates.results(groups, plan)


def measured(found: Results) -> Iterator[Measured]:
    """Kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in found.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from tracks.problems_of(rig, plan.moved, plan.integrators)
    for axis in chosen(rig, plan.moved):
        reach, middle = amplitude(axis, plan), waits_at(axis)
        if not axis.low <= middle - reach <= middle + reach <= axis.high:
            key = "amplitude_m" if axis.unit == "m" else "amplitude_rad"
            yield f"{key}: found {reach:g}; {axis.name} goes from {axis.low:g} to {axis.high:g} {axis.unit}"
    if plan.shaped_s >= plan.lead * plan.period_s:
        yield f"shaped_s: found {plan.shaped_s:g} s; expected less than what does not count, {plan.lead * plan.period_s:g} s"


def figures(found: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Set point and reading over a period, and the error."""
    from procedures.sine_following import figures as drawn

    return drawn.all_figures(found, recording.plan)


procedure = Procedure(
    name="sine-following",
    title="Sines that a positioned stage follows: errors, amplitude ratio, lag",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    steps_on=lambda rig, plan: len(modes_of(rig, plan)),
    untold=lambda rig: tracks.untold(rig, PAIRS),
    left_out=lambda plan: tracks.left_out(plan.moved, PAIRS),
    assumes=assumptions.FOLLOWING,
    places=(TOGETHER, "integrators off"),
    method=read_method(__file__),
)
