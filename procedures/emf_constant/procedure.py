"""Emf constants of a mover's motors, from voltages and currents of their coils while it is sent to and fro.

Measurands, by motor: the flux that its moving field links with a coil at most, Wb; by reciprocity force or torque per ampere,
n/2 (d phase/d x) flux of n coils; the mean resistance of its coils as they were meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING

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
from procedures.emf_constant.moves import Line, captured, lines, rate, seconds, windings
from procedures.emf_constant.plan import Plan
from procedures.emf_constant.requires import requires
from procedures.emf_constant.steps import MOVE, read_taken
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

if TYPE_CHECKING:
    from procedures.emf_constant.estimates import Result

FLUX = Quantity("flux", "Wb", "flux that a motor's moving field links with one of its coils, at most")
K_EMF = Quantity("K_emf", "N/A", "force along per ampere, by reciprocity: n/2 (d phase/dz) flux of n coils",
                 title="emf constant")  # fmt: skip
K_EMF_ANGLE = Quantity("K_emf_angle", "N m/A", "torque per ampere, by reciprocity: n/2 (pole pairs) flux of n coils",
                       title="emf constant around")  # fmt: skip
RESISTANCE = Quantity("resistance", "Ohm", "of a coil, mean of a motor's, as it was while it was measured")
MEASURES = (FLUX, K_EMF, K_EMF_ANGLE, RESISTANCE)
CONSTANTS = "actuator-constant"


def step_count(plan: Plan) -> int:
    """Of three motors, for the progress display."""
    return 3 * 2 * plan.repeats


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    return len(lines(rig, plan)) * 2 * plan.repeats


def needs(plan: Plan) -> tuple[Need, ...]:
    """The constants that reciprocity is compared with, where the plan wants it."""
    return (Need(CONSTANTS),) if plan.constants == "calibration" else ()


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The observer."""
    return planned.observer(rig, plan.observer)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """For one motor after the other: there and back, each move captured whole."""
    numbers = count(1)
    for line in lines(rig.file, plan):
        rig.levitation.write(dict(line.rates))
        rig.levitation.write({line.parameter: line.ends[0]})
        rig.clock.sleep(line.seconds + plan.settle_s)
        for repeat in range(plan.repeats):
            for there in (1, -1):
                _move(
                    rig,
                    plan,
                    record,
                    line,
                    {"motor": line.motor, "repeat": repeat, "there": there, "number": next(numbers)},
                )
        rig.levitation.write({line.parameter: line.ends[0]})


def _move(rig: Rig, plan: Plan, record: Recorder, line: Line, labels: dict[str, float | str]) -> None:
    assert rig.capture is not None
    rig.clock.sleep(plan.settle_s)
    with record.step(MOVE, **labels):
        channels, rate_hz = list(captured(rig.file, line.motor)), rate(rig.file, plan)
        rig.capture.arm(channels, seconds=seconds(line, plan), rate_hz=rate_hz)
        rig.levitation.write({line.parameter: line.ends[1 if labels["there"] == 1 else 0]})
        rig.capture.wait(seconds(line, plan) + 5.0)
    rig.capture.upload(None, **labels)


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """Flux of each motor, and what its nameplate may mean."""
    from procedures.emf_constant import checks, estimates

    rig, plan, taken = recording.rig, recording.plan, read_taken(recording)
    findings.gate(checks.of_signals(taken, rig, plan))
    results = estimates.results(taken, rig, plan)
    constants = recording.calibration(CONSTANTS).values if needs(plan) else {}
    findings.gate(checks.of_results(results, rig, plan, constants))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for result in results:
            if quantity.name in result.estimates:
                yield quantity.measured(result.estimates[quantity.name], result.winding.motor)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    known = windings(rig)
    if unknown := [m for m in plan.motors if m not in known]:
        yield f"motors: found {', '.join(unknown)}; coils and voltages are known of {', '.join(known)}"
        return
    yield from planned.of_observer(rig, plan.observer)
    yield from of_rate(rig, plan.rate_hz)
    for line in lines(rig, plan):
        if abs(line.ends[1] - line.ends[0]) * abs(known[line.motor].per) < 1:
            yield f"{line.motor}: found {line.ends[0]:g} to {line.ends[1]:g}; expected an electrical radian or more"
        for end in line.ends:
            wanted = {**line.rates, line.parameter: end}
            yield from (f"{line.motor}: {problem}" for problem in Envelope(rig).problems_of(wanted))


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """What is left of the voltage beside the speed's flux, of each motor."""
    from procedures.emf_constant import figures as drawn

    del recording
    return drawn.all_figures(results)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What the rig's motors cannot show."""
    at, seen = rig.capabilities.motion, {w.channel for w in windings(rig).values()}
    along = at is not None and at.place_channel in seen
    around = at is not None and at.angle_channel in seen
    return (*(() if along else (K_EMF,)), *(() if around else (K_EMF_ANGLE,)))


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """Which way a chosen motor works the rig alone knows."""
    return (K_EMF, K_EMF_ANGLE) if plan.motors else ()


procedure = Procedure(
    name="emf-constant",
    title="Flux and emf constants of a mover's motors",
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
    optional=(K_EMF, K_EMF_ANGLE),
    left_out=left_out,
    reached=("scatter/*",),
    assumes=assumptions.EMF_CONSTANT,
    method=read_method(__file__),
)
