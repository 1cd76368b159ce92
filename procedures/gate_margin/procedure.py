"""What a levitation gate has to spare, and what the bearings' catch has, levitated at rest over places and angles.

Measurands: by place the gate less the largest |reading| of all radial probes in one of the gate's times, noise included,
mean over such times; by bearing and axis how far its force holds the pull beyond where the shaft rests, less how far it goes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.gate_margin import estimates
from procedures.gate_margin.estimates import Results, weight_of
from procedures.gate_margin.place import GATE, TIME, TRIAL, WINDOWS, Place, bound_of, captured, grid, planes, rate
from procedures.gate_margin.plan import Plan
from procedures.gate_margin.requires import requires
from procedures.gate_margin.steps import read_taken, read_trials
from procedures.position_loops.movers import motion
from procedures.shared import assumptions, planned

MARGIN = Quantity("gate_margin", "m", "gate less the largest radial reading in one of its times, noise included, "
                                      "mean over such times",
                  title="gate margin")  # fmt: skip
CATCH = Quantity("catch_margin", "m", "how far the force holds the pull beyond where the shaft rests, less how far "
                                      "it goes; least place",
                 title="catch margin")  # fmt: skip
MEASURES = (MARGIN, CATCH)
POLE = "unstable-pole"
SPARE_S = 1e-3  # of a capture
LOOK_S = 0.01
LOOKS = 4  # at the currents at rest, before a trial
RAMP = 4  # writes by which a probe is sent beyond the gate: a step at once asks more of the bearings
STANDS_M = 2e-5  # along, between two looks: the lift has arrived


def needs(plan: Plan) -> tuple[Need, ...]:
    """The pole, where the plan wants it measured."""
    return (Need(POLE),) if plan.pole == "calibration" else ()


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The observer."""
    return planned.observer(rig, plan.observer)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Lift with probes beyond the gate, let it pass, look at each place, land."""
    at = motion(rig.file)
    gate = {GATE: rig.levitation.get(at.gate), TIME: rig.levitation.get(at.gate_time)}
    rig.levitation.lift()
    if plan.trial and at.radial:
        _arrive(rig, plan)
        _tried(rig, plan, record, gate)
    if not _passed(rig, plan):
        return
    for number, place in enumerate(grid(plan)):
        rig.levitation.write({at.place: place.place_m})
        rig.levitation.write({at.angle: place.angle_rad})
        rig.clock.sleep(plan.settle_s)
        _look(rig, plan, record, number, place, gate)
    rig.levitation.land()


def _levitated(rig: Rig) -> bool:
    return rig.levitation.state is RigState.LEVITATED


def _arrive(rig: Rig, plan: Plan) -> None:
    """Until the lift has come to a stand, which is when its gate begins to count."""
    channel = motion(rig.file).place_channel
    begun, start = rig.clock.now_ns(), rig.levitation.reading(channel)
    before = start
    while rig.clock.now_ns() - begun < plan.patience_s * 1e9 and not _levitated(rig):
        rig.clock.sleep(LOOK_S)
        now = rig.levitation.reading(channel)
        if abs(now - before) < STANDS_M < abs(now - start):
            return
        before = now


def _tried(rig: Rig, plan: Plan, record: Recorder, gate: Mapping[str, float]) -> None:
    """Each probe beyond the gate for longer than its time, then the last one for short times; over when it passes."""
    seconds, last = plan.trial_gates * gate[TIME], ""
    sides = _sides(rig)
    for probe, parameter in motion(rig.file).radial.items():
        if _levitated(rig):
            break
        beyond = sides[probe] * plan.trial_share * gate[GATE]
        _ramp(rig, parameter, beyond, plan.rise_s)
        if last:
            rig.levitation.write({last: 0.0})
        last = parameter
        with record.step(TRIAL, probe=probe, pulsed=0):
            rig.clock.sleep(seconds)
    else:
        if not _levitated(rig):
            _pulse(rig, plan, record, probe, last, beyond, seconds / plan.pulses)
    rig.levitation.write({last: 0.0})


def _ramp(rig: Rig, parameter: str, beyond: float, seconds: float) -> None:
    for k in range(1, RAMP + 1):
        rig.levitation.write({parameter: beyond * k / RAMP})
        rig.clock.sleep(seconds / RAMP)


def _sides(rig: Rig) -> dict[str, float]:
    """To which side each probe is sent: to where its magnets' middle is, so that the least is asked of the bearings. At rest
    K x = -K_B i: it is where the current, less the weight's, pushes. A wrong sign of a small current costs little."""
    out, told = (
        dict.fromkeys(motion(rig.file).radial, 1.0),
        [p for p in planes(rig.file) if p.current in rig.file.channels],
    )
    pushes = dict.fromkeys((p.probe for p in told), 0.0)
    for _ in range(LOOKS if told else 0):
        for p in told:
            pushes[p.probe] += rig.levitation.reading(p.current) - weight_of(p, rig.file)
        rig.clock.sleep(LOOK_S)
    return out | {probe: -1.0 if push < 0 else 1.0 for probe, push in pushes.items()}


def _pulse(rig: Rig, plan: Plan, record: Recorder, probe: str, parameter: str, beyond: float, every_s: float) -> None:
    with record.step(TRIAL, probe=probe, pulsed=1):
        for _ in range(plan.pulses):
            begun = rig.clock.now_ns()
            rig.levitation.write({parameter: 0.0})
            rig.clock.sleep(max(every_s - plan.pulse_s, 0.0))
            _ramp(rig, parameter, beyond, plan.pulse_s)
            rig.clock.sleep(max(every_s - 1e-9 * (rig.clock.now_ns() - begun), 0.0))


def _passed(rig: Rig, plan: Plan) -> bool:
    """Whether the gate passes once nothing keeps it shut."""
    begun = rig.clock.now_ns()
    while not _levitated(rig) and rig.clock.now_ns() - begun < plan.patience_s * 1e9:
        rig.clock.sleep(LOOK_S)
    return _levitated(rig)


def _look(rig: Rig, plan: Plan, record: Recorder, number: int, place: Place, gate: Mapping[str, float]) -> None:
    """Windows of one place, one after the other in one capture."""
    assert rig.capture is not None
    seconds = plan.windows * gate[TIME] + SPARE_S
    with record.step(WINDOWS, number=number, place_m=place.place_m, angle_rad=place.angle_rad, **gate):
        rig.capture.arm(captured(rig.file), seconds=seconds, rate_hz=rate(rig.file))
        rig.capture.wait(seconds + 5.0)
    rig.capture.upload(None, number=number)


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """The margins."""
    from procedures.gate_margin import checks

    rig, plan, gate = recording.rig, recording.plan, bound_of(recording)
    findings.add(checks.of_trials(read_trials(recording), gate[0], rig, plan))
    taken = read_taken(recording)
    findings.gate(checks.of_signals(taken, gate, rig, plan))
    poles = recording.calibration(POLE).values if needs(plan) else None
    found = estimates.results(taken, gate, rig, plan, poles)
    findings.add(checks.of_results(found, rig))
    return found


def measured(found: Results) -> Iterator[Measured]:
    """Gate by place, catch by probe."""
    for quantity in MEASURES:
        for (name, where), estimate in found.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    at = motion(rig)
    known = rig.capabilities.settings.get("observer", {})
    if plan.observer and plan.observer not in known:
        yield f"observer: found {plan.observer!r}; expected one of {', '.join(known) or '(the rig file has none)'}"
    envelope, gate = Envelope(rig), rig.parameters[at.gate].default
    for place in grid(plan):
        yield from envelope.problems_of({at.place: place.place_m, at.angle: place.angle_rad})
    if len({p.name for p in grid(plan)}) < len(grid(plan)):
        yield "places_m, angles_rad: found one place twice; expected each once"
    if plan.trial:
        beyond = dict.fromkeys(at.radial.values(), plan.trial_share * gate)
        yield from (f"trial_share: {problem}" for problem in envelope.problems_of(beyond))
    period = plan.trial_gates * rig.parameters[at.gate_time].default / plan.pulses
    if plan.trial and not 2 * plan.pulse_s < period < rig.parameters[at.gate_time].default:
        yield (f"pulses: found {plan.pulses}, one every {period:g} s; expected more than two pulse_s and less than the "
               "gate's time")  # fmt: skip
    if rig.capture is not None:
        size = 2 * len(captured(rig)) * rate(rig) * (plan.windows * rig.parameters[at.gate_time].default + SPARE_S)
        if size > rig.capture.memory_bytes:
            kept = rig.capture.memory_bytes / 1e6
            yield f"windows: found {plan.windows}, of {size / 1e6:.0f} MB; the controller keeps {kept:.0f} MB"


def figures(found: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Largest readings with the gate, their distribution, the catch."""
    from procedures.gate_margin import figures as drawn

    return drawn.all_figures(found, recording.rig)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """Without forces there is no catch."""
    return () if planes(rig) else (CATCH,)


procedure = Procedure(
    name="gate-margin",
    title="Margins of the levitation gate and of the catch",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    needs=needs,
    step_count=lambda plan: len(grid(plan)) + (5 if plan.trial else 0),
    fewest_steps=lambda plan: len(grid(plan)),
    untold=untold,
    assumes=assumptions.GATE_MARGIN,
    method=read_method(__file__),
)
