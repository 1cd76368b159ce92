"""Cogging of a mover along and around, by the currents that hold it against it while it is swept slowly, both ways.

Measurands, by loop: amplitude of the first harmonic of the current that takes cogging off (mean of the loop's motors, true
amperes that give force), the electrical phase by which it turns, the second harmonic's shares of it, its greatest value on the
map; half of what the current up has over that down; and each as force or torque.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from bench.calibration import Need
from bench.errors import AnalysisError, BenchError
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.uncertainty import Estimate
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.requires import DEFAULTS, requires
from procedures.cogging_map.steps import SWEEP, read_passes
from procedures.cogging_map.sweeps import Way, fed, loops, way
from procedures.position_loops.injection import ability
from procedures.position_loops.motors import around
from procedures.shared import assumptions, planned
from procedures.synchronous.dwells import telemetry_period_s

if TYPE_CHECKING:
    from procedures.cogging_map.estimates import Result

CURRENT = Quantity("cogging_current", "A", "amplitude of the first harmonic of the current that takes cogging off")
PEAK_CURRENT = Quantity("peak_current", "A", "greatest current that takes cogging off, by its first two harmonics")
FRICTION_CURRENT = Quantity("friction_current", "A", "half of what the current up has over that down")
PHASE = Quantity(
    "cogging_phase", "rad", "electrical angle, by the encoder, at which cogging turns from pushing back to on"
)
SHARE = Quantity("second_share", "1", "second harmonic of cogging over the first, of one part",
                 title="share of the second harmonic")  # fmt: skip
FORCE = Quantity("cogging_force", "N", "amplitude of the first harmonic of the force of cogging")
PEAK_FORCE = Quantity("peak_force", "N", "greatest force of cogging, by its first two harmonics")
FRICTION_FORCE = Quantity("friction_force", "N", "half of what the force up has over that down")
TORQUE = Quantity("cogging_torque", "N m", "amplitude of the first harmonic of the torque of cogging")
PEAK_TORQUE = Quantity("peak_torque", "N m", "greatest torque of cogging, by its first two harmonics")
FRICTION_TORQUE = Quantity("friction_torque", "N m", "half of what the torque up has over that down")
FORCES, TORQUES = (FORCE, PEAK_FORCE, FRICTION_FORCE), (TORQUE, PEAK_TORQUE, FRICTION_TORQUE)
MEASURES = (CURRENT, PEAK_CURRENT, FRICTION_CURRENT, PHASE, SHARE, *FORCES, *TORQUES)
CONSTANTS, ZEROS = "actuator-constant", "encoder-zero"


def step_count(plan: Plan) -> int:
    """Of two loops with a feedforward, for the progress display."""
    return (2 if plan.loops == "all" else 1) * (2 if plan.feedforward == "both" else 1) * 2 * plan.sweeps


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    return sum(2 * plan.sweeps * len(fed(plan, way(rig, plan, loop))) for loop in loops(rig, plan))


def needs(plan: Plan) -> tuple[Need, ...]:
    """Constants and zeros, where the plan wants them measured."""
    wanted = ((CONSTANTS, plan.constants), (ZEROS, plan.zeros))
    return tuple(Need(procedure) for procedure, told in wanted if told == "calibration")


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer; nothing injected, nothing added."""
    can = ability(rig)
    added = {one.added: 0.0 for one in rig.capabilities.force_currents.values() if one.added}
    return {can.axis: can.off, **added, **planned.observer(rig, plan.observer)}


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Of each loop, up and down in turn, with the controller's feedforward and without."""
    for name, value in plan.parameters.items():
        rig.levitation.write({name: value})
    for loop in loops(rig.file, plan):
        of = way(rig.file, plan, loop)
        with _swept(rig, plan, of):
            for repeat in range(plan.sweeps):
                for told in fed(plan, of):
                    rig.levitation.write({name: _usual(rig, plan, name) if told else 0.0 for name in of.feedforward})
                    for sign in (1, -1):
                        rig.clock.sleep(plan.settle_s)
                        with record.step(SWEEP, loop=loop, way=sign, fed=int(told), repeat=repeat):
                            rig.levitation.write({of.set_point: of.ends[1 if sign > 0 else 0]})
                            rig.clock.sleep(of.seconds)


def _usual(rig: Rig, plan: Plan, name: str) -> float:
    return plan.parameters.get(name, rig.file.parameters[name].default)


@contextmanager
def _swept(rig: Rig, plan: Plan, of: Way) -> Iterator[None]:
    """At the beginning of a map, slow; in the end where it was, as fast as it was, whatever happens with its feedforward."""
    write, usual = rig.levitation.write, {name: _usual(rig, plan, name) for name in (*of.feedforward, of.rate) if name}
    back = _usual(rig, plan, of.set_point)
    slow = {of.rate: of.speed} if of.rate else {}
    away_s = abs(of.ends[0] - back) / of.speed + plan.settle_s
    write(slow)
    write({of.set_point: of.ends[0]})
    rig.clock.sleep(away_s)
    try:
        yield
    except BaseException:
        with suppress(BenchError):
            write(usual)
        raise
    write({name: usual[name] for name in of.feedforward})
    write({of.set_point: back})
    rig.clock.sleep(away_s)
    write(usual)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Harmonics of each loop."""
    from procedures.cogging_map import checks, estimates

    rig, plan, passes = recording.rig, recording.plan, read_passes(recording)
    findings.gate(checks.of_signals(passes, rig, plan))
    facts: dict[str, Estimate] = {}
    for need in needs(plan):
        facts |= recording.calibration(need.procedure).values
    try:
        results = estimates.results(passes, rig, plan, facts)
    except AnalysisError as error:
        findings.end(Finding("cogging-not-shown", f"{error}.", "", Effect.ERROR))
    findings.add(checks.of_results(results, rig, plan, facts))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """The quantities of each loop."""
    for quantity in MEASURES:
        for result in results:
            for (name, where), estimate in result.estimates.items():
                if name == quantity.name:
                    yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    wanted = loops(rig, plan)
    if not wanted:
        yield f"loops: found {plan.loops!r}; this rig has none of them whose motors' cogging is told"
        return
    yield from planned.of_observer(rig, plan.observer)
    if problems := list(planned.of_parameters(rig, plan.parameters)):
        yield from problems
        return
    envelope, period_s = Envelope(rig), telemetry_period_s(rig)
    for loop in wanted:
        of = way(rig, plan, loop)
        for end in of.ends:
            yield from (f"{loop}: {problem}" for problem in envelope.problems_of({of.set_point: end} | plan.parameters))
        if of.rate:
            yield from (f"{loop}: {problem}" for problem in envelope.problems_of({of.rate: of.speed}))
        there = of.period_s(len(of.signals)) / period_s
        if there < plan.min_samples:
            yield (f"{loop}: found {there:.3g} samples in a period of the highest harmonic at {of.speed:g} of its unit a "
                   f"second; expected {plan.min_samples} or more: sweep slower")  # fmt: skip


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """The map of each loop."""
    from procedures.cogging_map import figures as drawn

    return drawn.all_figures(results, recording.rig)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What the rig's motors cannot show."""
    turns = {around(rig, loop) for loop in loops(rig, DEFAULTS)}
    return (*(() if False in turns else FORCES), *(() if True in turns else TORQUES))


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """Those of the other loops."""
    return {"all": (), "along": TORQUES, "around": FORCES}[plan.loops]


procedure = Procedure(
    name="cogging-map",
    title="Map of a mover's cogging along and around",
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
    needs=needs,
    step_count=step_count,
    steps_on=steps_on,
    fewest_steps=lambda plan: 4,
    untold=untold,
    optional=MEASURES,  # of none but the loops that are chosen
    left_out=left_out,
    assumes=assumptions.COGGING_MAP,
    method=read_method(__file__),
)
