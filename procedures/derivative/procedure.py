"""Algebraic derivative of a firmware, by injection (thesis 4.2, B1): gain, phase and error over frequency, its band.

Measurands, by line: gain and phase of the velocity over the derivative of the position that the law took, the error with all
sidebands, the sidebands alone; for the whole: edges of the band, the derivative of a constant, the gain of white noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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
from procedures.derivative.fitting import in_range, lines_clear
from procedures.derivative.plan import Plan
from procedures.derivative.requires import requires
from procedures.derivative.steps import LINE, OFFSET, QUIET, asked, read_taken
from procedures.one_axis.conventions import conventions
from procedures.shared import assumptions

if TYPE_CHECKING:
    from procedures.derivative.estimates import Result

GAIN = Quantity("gain", "1", "mean gain of the velocity over the position's derivative")
PHASE = Quantity("phase", "rad", "mean phase of the velocity before the position's derivative")
ERROR = Quantity("error", "1", "RMS of velocity less derivative, over the derivative's rms, sidebands included")
SIDEBAND = Quantity("sideband", "1", "of that what is at f +- n/eps: what changes from reset to reset")
LOW = Quantity("edge_low", "Hz", "below it the error is more than the limit", title="lower edge")
HIGH = Quantity("edge_high", "Hz", "above it the error is more than the limit", title="upper edge")
AT = Quantity(
    "error_at", "1", "error at the plan's frequency, between the lines", title="error at the plan's frequency"
)
FALSE = Quantity("false_derivative", "1/s", "mean velocity per constant position")
NOISE = Quantity("noise_gain", "1/s", "RMS of the velocity per rms of white noise in the position")
BY_LINE, WHOLE = (GAIN, PHASE, ERROR, SIDEBAND), (LOW, HIGH, AT, FALSE, NOISE)
MEASURES = (*WHOLE, *BY_LINE)
ESTIMATOR = "overlapping"


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The estimator as the plan has it, told and not in the loop, which a plain difference closes; what is constant and
    harmonic is compensated, so that the position has the injected line alone."""
    machine = conventions(rig)
    written = machine.knows({"degree": plan.degree, "window": plan.window_s})
    chosen = (("watched", ESTIMATOR), ("rule", plan.rule), ("compensation", "on"))
    return written | {name: value for kind, of in chosen for name, value in machine.choose(kind, of).items()}


def seconds(plan: Plan, hz: float = 0.0) -> float:
    """How long a capture lasts."""
    return max(plan.record_s, plan.periods / hz) if hz else plan.record_s


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return len(plan.lines_hz) + 3


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Quiet, at a set point to either side, then a sine after the other."""
    machine = conventions(rig.file)
    injection, (point,) = machine.can.injection, (machine.can.set_points.axes[machine.axis],)
    assert injection is not None
    rig.clock.sleep(plan.settle_s + 1.0)  # the disturbance is being learned
    _take(rig, plan, record, QUIET, 0)
    for number, at in enumerate((plan.offset_m, -plan.offset_m), 1):
        rig.levitation.set(point, at)
        rig.clock.sleep(plan.settle_s + 1.0)
        _take(rig, plan, record, OFFSET, number, at_m=at)
    rig.levitation.set(point, 0.0)
    for number, hz in enumerate(plan.lines_hz, 3):
        rig.levitation.write({injection.hz: hz, injection.amplitude: plan.amplitude_A})
        rig.levitation.set(injection.axis, injection.axes[machine.axis])
        rig.clock.sleep(plan.settle_s)
        _take(rig, plan, record, LINE, number, hz=hz)
        rig.levitation.set(injection.axis, injection.off)
    rig.levitation.set(injection.amplitude, 0.0)


def _take(
    rig: Rig, plan: Plan, record: Recorder, kind: str, number: int, *, hz: float = 0.0, at_m: float = 0.0
) -> None:
    assert rig.capture is not None
    lasts = seconds(plan, hz)
    with record.step(kind, number=number, hz=hz, at_m=at_m):
        rig.capture.arm(conventions(rig.file).captured, seconds=lasts)
        rig.capture.wait(lasts + 5.0)
    rig.capture.upload(None, number=number)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """The estimator's response at each line, and what it is beside that of the weights."""
    from procedures.derivative import checks, estimates, fit

    plan, taken = recording.plan, read_taken(recording)
    known_hz = conventions(recording.rig).known(recording.rig, "harmonic_hz")
    quiet = next((t for t in taken if t.kind == QUIET and len(t.y)), None)
    harmonic_hz = fit.exciter_hz(quiet.y, known_hz, quiet.tick_s) if quiet else known_hz
    findings.gate(checks.of_signals(taken, plan, harmonic_hz))
    result = estimates.evaluate(taken, asked(plan, taken[0].tick_s), plan, harmonic_hz)
    findings.add(checks.of_result(result, taken, plan))
    findings.add(checks.of_exciter(plan, harmonic_hz))
    return result


def measured(result: Result) -> Iterator[Measured]:
    """The quantities of the whole, which a reader asks for first, then those of each line."""
    yield from (q.measured(result.whole[q.name]) for q in WHOLE if q.name in result.whole)
    for where, found in result.by_line.items():
        yield from (q.measured(found[q.name], where) for q in BY_LINE)


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Error over frequency beside that of the weights, gain and phase, sidebands."""
    from procedures.derivative import figures as drawn

    return drawn.all_figures(result, recording.plan)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    machine = conventions(rig)
    assert rig.capture is not None
    tick_s = rig.devices["controller"].tick_s
    for kind, name in (("watched", ESTIMATOR), ("rule", plan.rule), ("compensation", "on")):
        try:
            machine.choose(kind, name)
        except Lacking as error:
            yield str(error)
    if abs(plan.window_s / tick_s - round(plan.window_s / tick_s)) > 1e-6:
        yield f"window_s: found {plan.window_s:g} s; expected whole ticks of {tick_s:g} s"
    if (
        list(plan.lines_hz) != sorted(set(plan.lines_hz))
        or min(plan.lines_hz) <= 0
        or max(plan.lines_hz) > 0.4 / tick_s
    ):
        yield f"lines_hz: found {plan.lines_hz}; expected above 0, each once, in order, up to {0.4 / tick_s:g} Hz"
    else:
        yield from lines_clear(plan, machine.known(rig, "harmonic_hz"))
    yield from in_range(rig, machine, plan)
    room = rig.capture.memory_bytes / Layout.of(rig.capture, machine.captured).sample.itemsize * tick_s
    if (longest := seconds(plan, min(plan.lines_hz, default=1.0))) > room:
        yield f"lines_hz: {min(plan.lines_hz):g} Hz takes {longest:.3g} s; the controller's memory holds {room:.3g} s"


procedure = Procedure(
    name="derivative",
    title="Algebraic derivative: gain, error and band of a velocity estimator",
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
    optional=(LOW, HIGH, AT),
    assumes=assumptions.DERIVATIVE,
    method=read_method(__file__),
)
