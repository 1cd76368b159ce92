"""Decoupling of a stage's axes: what a held axis does, and what is put on it, while another one follows a sine.

Measurands, by pair: the largest excursion of the held axis from its set point over the periods, by its own encoder; that over
the moved axis' swing; effective value and peak of the force that the moved axis' motion puts on the held one, while the moved
one slides, smoothed and without its mean; its slope over what the moved axis' loop asks for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from bench.calibration import Calibration, Need
from bench.errors import Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.rigfile.stage import StageAxis, axes_of
from procedures.decoupling import estimates
from procedures.decoupling.estimates import Result, coupling_of, excursion_of, named, ratio_of
from procedures.decoupling.plan import Plan
from procedures.decoupling.requires import requires
from procedures.decoupling.steps import ALONE, FAST, NUDGED, SLOW, SPARE_S, read_runs
from procedures.shared import planned
from procedures.stages import assumptions, map_model
from procedures.stages.pairs import pairs, played, silenced, sine, waits_at

PLACE = Quantity("excursion", "m", "largest distance of the held axis from its set point, by its encoder")
ANGLE = Quantity("excursion_angle", "rad", "largest angle of the held axis from its set point, by its encoder",
                 title="excursion")  # fmt: skip
RATIO = Quantity(
    "peak_ratio", "1", "largest excursion of the held axis over the moved one's swing", title="ratio of peaks"
)
PER_ANGLE = Quantity("peak_per_angle", "m/rad", "largest excursion of the held axis over the moved one's swing",
                     title="ratio of peaks")  # fmt: skip
PER_STROKE = Quantity("peak_per_stroke", "rad/m", "largest excursion of the held axis over the moved one's swing",
                      title="ratio of peaks")  # fmt: skip
CROSS_FORCE = Quantity(
    "cross_force", "N", "effective value of the force that the moved axis' motion puts on the held one"
)
CROSS_TORQUE = Quantity(
    "cross_torque", "N m", "effective value of the torque that the moved axis' motion puts on the held one"
)
PEAK_FORCE = Quantity("peak_cross_force", "N", "greatest force that the moved axis' motion puts on the held one")
PEAK_TORQUE = Quantity("peak_cross_torque", "N m", "greatest torque that the moved axis' motion puts on the held one")
SHARE = Quantity("cross_share", "1", "slope of the cross force over what the moved axis' loop asks for")
PER_TORQUE = Quantity(
    "force_per_torque", "1/m", "slope of the cross force over the torque that the moved axis' loop asks for"
)
PER_FORCE = Quantity(
    "torque_per_force", "m", "slope of the cross torque over the force that the moved axis' loop asks for"
)
MEASURES = (PLACE, ANGLE, RATIO, PER_ANGLE, PER_STROKE, CROSS_FORCE, CROSS_TORQUE, PEAK_FORCE, PEAK_TORQUE, SHARE, PER_TORQUE,
            PER_FORCE)  # fmt: skip
INTEGRATORS = "integrators"
STEPS_OF_A_PAIR = 3
OWN = "default"
"""The controller's own map, as its parameters are by default."""


def step_count(plan: Plan) -> int:
    """Of two axes, for the progress display."""
    return STEPS_OF_A_PAIR * (2 if plan.moved == "all" else 1)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    some = pairs(rig, plan.moved)
    return len({p.moved.name for p in some}) + 2 * len(some)


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The integrators; no waves."""
    return silenced(rig) | dict(rig.capabilities.settings.get(INTEGRATORS, {}).get(plan.integrators, {}))


def motion_of(axis: StageAxis, plan: Plan) -> dict[str, float]:
    """Parameters of the moved axis' sine."""
    return sine(axis, plan.amplitude_m if axis.unit == "m" else plan.amplitude_rad, plan.period_s)


def nudge_of(axis: StageAxis, turns: float, plan: Plan) -> dict[str, float]:
    """Parameters of the held axis' small one, so many of it to one of the motion."""
    return sine(axis, plan.nudge_m if axis.unit == "m" else plan.nudge_rad, plan.period_s / turns)


def needs(plan: Plan) -> tuple[Need, ...]:
    """An identified map, where the controller is to be given one."""
    return () if plan.model == OWN else tuple(Need(name, told=True) for name in map_model.sources(plan.model))


def foresees(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterable[str]:
    """A map that is not whole would leave the controller with a part of its own; one beyond its ranges is none of this kind."""
    if plan.model == OWN:
        return
    wanted, given = map_model.expected(rig, plan.model), map_model.identified(rig, plan.model, facts)
    for source in map_model.sources(plan.model):
        if missing := [q for name, (procedure, q) in wanted.items() if procedure == source and name not in given]:
            yield f"model: {facts[source].run_id} holds no {', '.join(missing)}; expected all that the controller has"
    yield from (f"model: {problem}" for problem in Envelope(rig).problems_of(given))


def _give_map(rig: Rig, plan: Plan, record: Recorder) -> None:
    """An identified map to the controller, which takes one at rest alone; at each start it has its own again."""
    assert rig.motion is not None
    transition(rig, RigState.READY)
    rig.motion.write(map_model.identified(rig.file, plan.model, {c.procedure: c for c in record.calibrations}))
    transition(rig, RigState.HELD)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each axis through its periods while the others are held, then with each of these nudged, slow and fast."""
    assert rig.motion is not None
    if plan.model != OWN:
        _give_map(rig, plan, record)
    for name, value in plan.parameters.items():
        rig.motion.write({name: value})
    axes = axes_of(rig.file)
    stiff = {f"stiffness_{name}": rig.motion.get(axis.stiffness) for name, axis in axes.items()}
    some = pairs(rig.file, plan.moved)
    for moved in {p.moved.name: p.moved for p in some}.values():
        _rest(rig, plan)
        with played(rig, motion_of(moved, plan)):
            rig.clock.sleep(plan.period_s)
            with record.step(ALONE, moved=moved.name, **stiff):
                rig.clock.sleep(plan.periods * plan.period_s + SPARE_S)
        for held in (p.held for p in some if p.moved is moved):
            for turns in (SLOW, FAST):
                _rest(rig, plan)
                with played(rig, motion_of(moved, plan) | nudge_of(held, turns, plan)):
                    rig.clock.sleep(plan.period_s)
                    with record.step(NUDGED, moved=moved.name, held=held.name, turns=turns, **stiff):
                        rig.clock.sleep(plan.nudges * plan.period_s + SPARE_S)


def _rest(rig: Rig, plan: Plan) -> None:
    """At their zeros, for a stop leaves axes where they came to rest."""
    assert rig.motion is not None
    rig.motion.move({name: waits_at(axis) for name, axis in axes_of(rig.file).items()})
    rig.clock.sleep(plan.settle_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Each pair."""
    from procedures.decoupling import checks

    rig, plan, runs = recording.rig, recording.plan, read_runs(recording)
    period_s = recording.streams["telemetry"].period_ns * 1e-9
    findings.gate(checks.of_signals(runs, rig, plan, period_s))
    found = estimates.results(runs, rig, plan, period_s)
    findings.add(checks.of_results(found, plan))
    return found


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """By pair."""
    for quantity in MEASURES:
        for r in results:
            if quantity.name in r.estimates:
                yield quantity.measured(r.estimates[quantity.name], r.pair.where)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """Sisters of a measure of which a rig has no pair."""
    some = pairs(rig, "all")
    told = {name for p in some for name in (excursion_of(p), ratio_of(p), *named(p), coupling_of(p))}
    return tuple(q for q in MEASURES if q.name not in told)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What a plan does not tell that moves the axes of one kind alone: of a stage with an axis of each."""
    if plan.moved == "all":
        return ()
    along = (PLACE, PER_ANGLE, CROSS_FORCE, PEAK_FORCE, PER_TORQUE)
    around = (ANGLE, PER_STROKE, CROSS_TORQUE, PEAK_TORQUE, PER_FORCE)
    return along if plan.moved == "stroke" else around


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    known = rig.capabilities.settings.get(INTEGRATORS, {})
    if plan.integrators not in known and (known or plan.integrators not in ("", "on")):
        expected = ", ".join(known) or "on (the rig file has no choice)"
        yield f"integrators: found {plan.integrators!r}; expected one of {expected}"
    if problems := list(planned.of_parameters(rig, plan.parameters)):
        yield from problems
        return
    if plan.model != OWN:
        try:
            map_model.expected(rig, plan.model)
        except Lacking as error:
            yield from (f"model: {line}" for line in error.lines)
    if not (some := pairs(rig, plan.moved)):
        yield f"moved: found {plan.moved!r}; the rig has no axis that measures that"
    envelope = Envelope(rig)
    for moved in {p.moved.name: p.moved for p in some}.values():
        size = plan.amplitude_m if moved.unit == "m" else plan.amplitude_rad
        if not moved.low <= waits_at(moved) - size <= waits_at(moved) + size <= moved.high:
            travel = f"{moved.low:g} to {moved.high:g}"
            yield f"{moved.name}: found a sine of {size:g} {moved.unit}; expected less than the travel, {travel}"
        yield from (
            f"{moved.name}: {problem}" for problem in envelope.problems_of(motion_of(moved, plan) | plan.parameters)
        )
    for p in some:
        for turns in (SLOW, FAST):
            yield from (f"{p.where}: {problem}" for problem in envelope.problems_of(nudge_of(p.held, turns, plan)))


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """Traces, then cross forces."""
    from procedures.decoupling import figures as drawn

    return drawn.all_figures(results, recording.plan)


procedure = Procedure(
    name="decoupling",
    title="Decoupling of a stage's axes: excursion of the held one and cross force",
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
    step_count=step_count,
    steps_on=steps_on,
    needs=needs,
    foresees=foresees,
    untold=untold,
    left_out=left_out,
    assumes=assumptions.DECOUPLING,
    places=("while",),
    reached=("scatter/*", "drag/*", "within/*"),
    method=read_method(__file__),
)
