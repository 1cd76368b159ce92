"""Constants of a mover's motors from its answer to their currents: force along, torque around, each per ampere.

Measurands, constants per true ampere of the current that gives the force: K_force of a motor along, K_torque of each motor
around, their sum over the inertia that they turn, the ratio of two motors, and the slope of cogging at each place; with a
ring of known moment of inertia that inertia, too, and K_torque by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import count
from typing import TYPE_CHECKING

from bench.calibration import Need
from bench.errors import AnalysisError, BenchError
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition, within_reach
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.actuator_constant import ring
from procedures.actuator_constant.asked import adds, check
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.requires import requires
from procedures.actuator_constant.sines import (
    Place,
    frequencies,
    loops,
    places,
    rate,
    sine,
    slow_s,
    start_s,
    with_the_ring,
)
from procedures.actuator_constant.steps import ADDED, SINE, channels, read_added, read_taken
from procedures.position_loops.injection import REFERENCE, ability, injected
from procedures.position_loops.motors import around, motors
from procedures.shared import assumptions, planned

if TYPE_CHECKING:
    from procedures.actuator_constant.estimates import Result

K_FORCE = Quantity("K_force", "N/A", "force of a motor along per ampere that gives it", title="force constant")
K_TORQUE = Quantity("K_torque", "N m/A", "torque of a motor per ampere that gives it", title="torque constant")
K_OVER_J = Quantity("K_over_J", "1/(A s^2)", "torque constants of all motors around, together, over the inertia they turn",
                    title="torque constants over inertia")  # fmt: skip
RATIO = Quantity("K_ratio", "1", "constant of one motor over that of the other, both around one axis or along it",
                 title="ratio of the constants")  # fmt: skip
SLOPE = Quantity("cogging_stiffness", "N/m", "slope of what pulls back along, at a place", title="cogging stiffness")
SLOPE_ANGLE = Quantity("cogging_stiffness_angle", "N m/rad", "slope of what turns back, at an angle",
                       title="cogging stiffness around")  # fmt: skip
INERTIA = Quantity("inertia", "kg m^2", "of what turns around an axis, by the ratio to a ring of known moment of inertia",
                   title="moment of inertia")  # fmt: skip
MEASURES = (K_FORCE, K_TORQUE, K_OVER_J, RATIO, SLOPE, SLOPE_ANGLE, INERTIA)
MARGIN_S = 1e-3  # of a capture
ZEROS = "encoder-zero"


def step_count(plan: Plan) -> int:
    """Of two loops, one of which has two motors, for the progress display."""
    added = 2 * plan.pairs if plan.added_A else 0
    around_ = len(plan.angles_rad) * (2 if plan.added_inertia else 1)
    return (len(plan.places_m) + around_) * plan.lines + added


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    bare = sum(
        len(places(rig, plan, loop)) * plan.lines + 2 * plan.pairs * adds(rig, plan, loop) for loop in loops(rig, plan)
    )
    return bare + sum(len(places(rig, plan, loop)) * plan.lines for loop in with_the_ring(rig, plan))


def needs(plan: Plan) -> tuple[Need, ...]:
    """The zeros of the encoders, where the plan wants them measured."""
    return (Need(ZEROS),) if plan.zeros == "calibration" else ()


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer; nothing is injected, nothing is added."""
    can = ability(rig)
    added = {one.added: 0.0 for one in rig.capabilities.force_currents.values() if one.added}
    return {can.axis: can.off, **added, **planned.observer(rig, plan.observer)}


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Of each loop: go to each place, inject sines; at the first add a current to one of two motors. What turns once more with
    the ring on, which an operator puts on and takes off a machine that is off."""
    numbers = count(1)
    _look(rig, plan, record, loops(rig.file, plan), numbers, False)
    if again := with_the_ring(rig.file, plan):
        with within_reach(rig):
            rig.operator.mount(ring.NAME)
        _look(rig, plan, record, again, numbers, True)
        transition(rig, RigState.OFF)
        rig.operator.mount("")


def _look(rig: Rig, plan: Plan, record: Recorder, at: Iterable[str], numbers: Iterator[int], ringed: bool) -> None:
    """Some loops, with the ring or without it."""
    for name, value in plan.parameters.items():
        rig.levitation.write({name: value})
    for loop in at:
        for k, place in enumerate(places(rig.file, plan, loop)):
            rig.levitation.write({place.parameter: place.value})
            rig.clock.sleep(plan.settle_s + plan.time_constants * slow_s(rig.file, plan, loop))
            lines = frequencies(rig.file, plan, loop)
            for j, hz in enumerate(lines):
                more: dict[str, float | str] = {"number": next(numbers), **({"ring": 1} if ringed else {})}
                _sine(rig, plan, record, loop, place, hz, j == len(lines) // 2, more)
            if k == 0 and not ringed and adds(rig.file, plan, loop):
                _added(rig, plan, record, loop, place)


def _sine(rig: Rig, plan: Plan, record: Recorder, loop: str, place: Place, hz: float, whole: bool,
          more: dict[str, float | str]) -> None:  # fmt: skip
    """Inject, capture, upload."""
    one = sine(rig.file, plan, loop, hz)
    labels: dict[str, float | str] = {
        "loop": loop, "place": place.name, "hz": one.hz, "amplitude": one.amplitude, "periods": one.periods,
        "samples": one.samples, "whole": int(whole), **more,
    }  # fmt: skip
    assert rig.capture is not None
    with injected(rig, loop, REFERENCE, one, start_s(rig.file, plan, loop)):
        with record.step(SINE, **labels):
            seconds = one.samples / rate(rig.file, plan) + MARGIN_S
            rig.capture.arm(list(channels(rig.file, loop, whole)), seconds=seconds, rate_hz=rate(rig.file, plan))
            rig.capture.wait(seconds + 5.0)
    rig.capture.upload(None, **labels)


def _added(rig: Rig, plan: Plan, record: Recorder, loop: str, place: Place) -> None:
    """To the first of two motors, either way in turn: what the other one then has less, the loop has taken back of both."""
    parameter, write = next(iter(motors(rig.file, loop).values())).added, rig.levitation.write
    rest_s = plan.start_s + plan.added_settle * slow_s(rig.file, plan, loop)
    try:
        for repeat in range(plan.pairs):
            for size in (plan.added_A, -plan.added_A):
                write({parameter: size})
                rig.clock.sleep(rest_s)
                with record.step(ADDED, loop=loop, place=place.name, size_A=size, repeat=repeat):
                    rig.clock.sleep(plan.rest_s)
    except BaseException:
        with suppress(BenchError):
            write({parameter: 0.0})
        raise
    write({parameter: 0.0})
    rig.clock.sleep(rest_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Constants of each loop's motors."""
    from procedures.actuator_constant import checks, estimates

    rig, plan = recording.rig, recording.plan
    taken, added = read_taken(recording), read_added(recording)
    findings.gate(checks.of_signals(taken, added, rig, plan))
    try:
        zeros = recording.calibration(ZEROS).values if needs(plan) else None
        results = estimates.results(taken, added, rig, plan, zeros)
    except ring.NotSeen as error:
        findings.end(Finding("part-not-seen", f"{error}", "", Effect.ERROR))
    except AnalysisError as error:
        findings.end(Finding("no-mass", f"{error}.", "", Effect.ERROR))
    findings.add(checks.of_results(results, rig, plan))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """The quantities of each loop."""
    for quantity in MEASURES:
        for result in results:
            for (name, where), estimate in result.estimates.items():
                if name == quantity.name:
                    yield quantity.measured(estimate, where)


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """The apparent constant of each line with the fit."""
    from procedures.actuator_constant import figures as drawn

    del recording
    return drawn.all_figures(results)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What the rig's motors cannot show."""
    every = dict.fromkeys(one.loop for one in rig.capabilities.force_currents.values())
    turns = [loop for loop in every if around(rig, loop)]
    two = any(adds(rig, Plan.model_validate({}), loop) for loop in every)
    along = () if len(turns) < len(every) else (K_FORCE, SLOPE)
    ringed = () if turns and ring.RING in rig.machine else (INERTIA,)
    return (*along, *(() if turns else (K_TORQUE, K_OVER_J, SLOPE_ANGLE)), *(() if two else (RATIO,)), *ringed)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """Those of the other loops, and the ratio where no current is added; which loop has two motors the rig alone knows."""
    others = {"all": (), "along": (K_TORQUE, K_OVER_J, SLOPE_ANGLE, INERTIA), "around": (K_FORCE, SLOPE)}[plan.loops]
    ringed = () if plan.added_inertia or plan.loops == "along" else (INERTIA,)
    return (*others, *ringed, *(() if plan.added_A and plan.loops == "all" else (RATIO,)))


procedure = Procedure(
    name="actuator-constant",
    title="Force and torque constants of a mover's motors",
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
    fewest_steps=lambda plan: 1,
    untold=untold,
    optional=MEASURES,  # of none but the loops that are chosen
    left_out=left_out,
    assumes=assumptions.ACTUATOR_CONSTANT,
    method=read_method(__file__),
)
