"""Map of a reluctance machine's inductances, by pulses of the whole supply on one phase of a locked rotor after the other.

Measurands: the constants of the map's formula (`model`): inductance per metre of overlap of an aligned phase, mean of all;
gains of phases relative to that mean; the unaligned share and harmonics of the angle; length, overlap and stray field of the
stacks; leakage and saturation, means of the phases; zeros of the stators and the magnetic centre against the encoders'
readings; what turns once with the angle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from bench.errors import AnalysisError
from bench.figures import Shown
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import rises
from bench.rigfile.envelope import Envelope
from procedures.inductance_map import checks
from procedures.inductance_map.places import Place, grid
from procedures.inductance_map.plan import Plan
from procedures.inductance_map.requires import requires
from procedures.inductance_map.steps import PLACE, captured, read_taken
from procedures.shared.rates import of_rate
from procedures.stages import assumptions
from procedures.stages.stators import Phase, axis, phases

if TYPE_CHECKING:
    from procedures.inductance_map.estimates import Result

USUAL_HZ = 20e3
BEFORE_S = 2e-3
MEASURES = (
    Quantity("slope", "H/m", "inductance of an aligned phase per metre of overlap, without saturation; mean of the phases"),
    Quantity("gain", "1", "a phase's inductance relative to the mean of all"),
    Quantity("unaligned", "1", "inductance midway between aligned angles, of the aligned", title="unaligned share"),
    Quantity("c2", "1", "second harmonic of the angle, of the first"),
    Quantity("c3", "1", "third harmonic of the angle, of the first"),
    Quantity("length", "m", "of a stack, by how its overlap ends"),
    Quantity("overlap", "m", "of mover and each stator at the magnetic centre"),
    Quantity("fringe", "m", "of the stray field at the ends of a stack"),
    Quantity("leakage", "H", "of a phase; mean of all"),
    Quantity("saturation", "A", "current at which teeth saturate; mean of the phases"),
    Quantity("zero", "rad", "what the encoder reads where the first phase of a stator is aligned, mean over the turn"),
    Quantity("centre", "m", "what the encoder reads where both stators hold as much of the mover", title="magnetic centre"),
    Quantity("uneven", "1", "share of the inductance that turns once with the angle, as its cosine and its sine"),
    Quantity("give", "rad/(N m)", "by which the lock turns"),
    Quantity("give_x", "m/N", "by which the lock gives way along", title="give along"),
    Quantity("resistance", "Ohm", "of a phase as it was meanwhile"),
    Quantity("current_zero", "A", "what a phase's current reads where there is none", title="zero of a current"),
)  # fmt: skip


def step_count(plan: Plan) -> int:
    """A place each."""
    return len(grid(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """From place to place: sent there, locked, let go; each phase has its pulse, each pulse its capture."""
    assert rig.motion is not None
    test, some = rig.file.capabilities.phase_test, phases(rig.file)
    x, angle = axis(rig.file, "stroke"), axis(rig.file, "angle")
    assert test is not None
    assert x is not None
    assert angle is not None
    for place in grid(plan):
        transition(rig, RigState.HELD)
        rig.motion.move({x.name: place.x, angle.name: place.angle})
        rig.clock.sleep(plan.settle_s)
        rig.operator.mount("lock")
        transition(rig, RigState.READY)
        with record.step(PLACE, number=place.number):
            rig.clock.sleep(plan.rest_s)
        try:
            for phase in some:
                _pulse(rig, plan, place, phase)
        finally:
            rig.motion.write({test.phase: test.off})
        rig.operator.mount("")


def _pulse(rig: Rig, plan: Plan, place: Place, phase: Phase) -> None:
    test = rig.file.capabilities.phase_test
    assert rig.capture is not None
    assert rig.motion is not None
    assert test is not None
    rig.motion.write({test.current: 0.0})
    rig.motion.write({test.phase: phase.value})
    seconds = BEFORE_S + plan.pulse_s + plan.tail_s
    rig.capture.arm(captured(rig.file, phase), seconds=seconds, before_s=BEFORE_S, rate_hz=plan.rate_hz,
                    trigger=rises(phase.voltage, plan.trigger_V))  # fmt: skip
    rig.clock.sleep(2 * BEFORE_S)
    rig.motion.write({test.pulse: plan.pulse_s})
    rig.capture.wait(seconds + 5.0)
    rig.capture.upload(None, place=place.number, phase=phase.name)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Fluxes of the pulses, and the map that fits them."""
    from procedures.inductance_map import estimates

    rig, plan, taken = recording.rig, recording.plan, read_taken(recording)
    findings.gate(checks.of_signals(taken, rig, plan))
    findings.gate(checks.of_order(taken, rig))
    findings.add(checks.of_pulses(taken, rig, plan))
    try:
        result = estimates.result(taken, rig)
    except AnalysisError as error:
        findings.end(Finding("map-not-shown", f"{error}.", "", Effect.ERROR))
    findings.add(checks.of_results(result, rig, plan))
    return result


def measured(result: Result) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in result.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    test, x = rig.capabilities.phase_test, axis(rig, "stroke")
    if test is None or x is None:
        return
    yield from of_rate(rig, plan.rate_hz)
    envelope = Envelope(rig)
    for position in plan.positions_m:
        yield from envelope.problems_of({x.target: position})
    if len(set(plan.positions_m)) < 5:
        yield f"positions_m: found {len(set(plan.positions_m))} different ones; expected 5 or more, at both ends too"
    yield from envelope.problems_of({test.pulse: plan.pulse_s})
    some = phases(rig)
    if rig.capture is not None and some and (need := _bytes(rig, plan, some[0])) > rig.capture.memory_bytes:
        yield f"pulse_s: a capture takes {need} bytes; the controller has {rig.capture.memory_bytes}"


def _bytes(rig: RigFile, plan: Plan, phase: Phase) -> int:
    seconds = BEFORE_S + plan.pulse_s + plan.tail_s
    return round(4 * len(captured(rig, phase)) * seconds * (plan.rate_hz or USUAL_HZ))


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Shown]:
    """Inductance, flux, and the controller's parameters."""
    from procedures.inductance_map import figures as drawn

    return drawn.all_figures(result, recording.rig)


def holds_for(_: Plan) -> Mapping[str, float]:
    """A map is the machine's, whatever the plan."""
    return {}


procedure = Procedure(
    name="inductance-map",
    title="Map of a reluctance machine's inductances",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=step_count,
    fewest_steps=lambda plan: checks.FEWEST,
    holds_for=holds_for,
    reached=("scatter/*", "counts/*", "encoders/*", "sensors/*/offset", "sensors/*/offset/down"),
    assumes=assumptions.INDUCTANCE_MAP,
    places=("cosine", "sine"),
    method=read_method(__file__),
)
