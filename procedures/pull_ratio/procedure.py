"""How much current holds a shaft against magnets that pull it away, per metre, and where it needs none: by set points.

Measurands: `pull_ratio`, K_pull/K_B of each plane and axis, true amperes and true metres; `current_free`, what a probe reads
where no bearing has a current. `fit` says why no lever, mass or weight is in the first, and which of them is in the second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from bench.calibration import Need
from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.pull_ratio import estimates
from procedures.pull_ratio.estimates import Result
from procedures.pull_ratio.plan import Plan
from procedures.pull_ratio.planes import (
    BOTH,
    Level,
    asked,
    axes,
    captured,
    needed_N,
    order,
    place,
    planes,
    rate,
    settle_s,
)
from procedures.pull_ratio.requires import requires
from procedures.pull_ratio.steps import STEP, Taken, read_taken
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

PULL_RATIO = Quantity(estimates.RATIO, "A/m", "negative stiffness over force constant, of a plane along an axis: K_pull/K_B",
                      title="pull over force constant")  # fmt: skip
CURRENT_FREE = Quantity(estimates.FREE, "m", "reading at which no bearing has a current: the magnetic centre, and along the "
                        "weight m g of the plane over its K_pull beside it", title="reading without current")  # fmt: skip
TURN = Quantity(estimates.TURN, "rad", "by which a plane's currents are laid beside its probes' axes, electrical",
                title="turn of the currents' frame")  # fmt: skip
LEVER = Quantity(
    estimates.LEVER, "1", "distance of the actuators' planes over that of the probes'", title="ratio of levers"
)
CONSTANT = Quantity(estimates.CONSTANT, "N/A", "(K_pull,1 + K_pull,2)/(K_pull,1/K_B,1 + K_pull,2/K_B,2): the force constant of "
                    "both planes together", title="force constant, both planes")  # fmt: skip
CENTRE = Quantity(estimates.CENTRE, "m", "reading in the middle of the magnets' pull along the weight, mean of both planes",
                  title="magnetic centre along the weight")  # fmt: skip
PULL = Quantity(estimates.PULL, "N/m", "negative stiffness of a plane, mean of both axes: its K_pull/K_B times its K_B",
                title="pull of a plane")  # fmt: skip
MEASURES = (PULL_RATIO, CURRENT_FREE, TURN, LEVER, CONSTANT, CENTRE, PULL)
BY_POLE = (CONSTANT, CENTRE)
MARGIN_S = 1e-3  # of a capture
MARGIN = 0.8  # of a loop's limit: the magnets' centre is told by no rig file
POLE, CONSTANTS = "unstable-pole", "bearing-constant"


def step_count(plan: Plan) -> int:
    """Of two axes with two planes each."""
    return 6 * (2 * len(plan.levels_m) - 1)


def needs(plan: Plan) -> tuple[Need, ...]:
    """The pole and the force constants, where the plan wants what follows from them."""
    wanted = ((POLE, plan.pole), (CONSTANTS, plan.constants))
    return tuple(Need(name) for name, how in wanted if how == "calibration")


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer."""
    return planned.observer(rig, plan.observer)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Go to the place, then to each level; by way of zero before other loops are moved."""
    motion, at = rig.file.capabilities.motion, place(rig.file, plan)
    if motion is not None and at is not None:
        rig.levitation.write({motion.place: at})
    rig.clock.sleep(plan.rest_s)
    points = {name: 0.0 for axis in axes(rig.file) for name in asked(rig.file, Level(axis, BOTH, 0.0, 1))}
    zero, before = dict(points), ("", "")
    for number, one in enumerate(order(rig.file, plan)):
        if before != (one.axis, one.moved):
            points = _go(rig, plan, points, zero)
        points, before = _go(rig, plan, points, {**zero, **asked(rig.file, one)}), (one.axis, one.moved)
        rig.clock.sleep(settle_s(rig.file, plan))
        _take(rig, plan, record, one, number)
    _go(rig, plan, points, zero)


def _go(rig: Rig, plan: Plan, points: Mapping[str, float], to: Mapping[str, float]) -> dict[str, float]:
    """In small steps, all loops alike: a loop that holds against a pull answers a step by k_P/(k_P - K_pull) of it at first,
    some twice as far, until its integrator has brought it back."""
    moved = {name: (points[name], at) for name, at in to.items() if at != points[name]}
    count = max((math.ceil(abs(at - start) / plan.step_m - 1e-9) for start, at in moved.values()), default=0)
    for k in range(1, count + 1):
        share = k / count
        rig.levitation.write({name: start * (1 - share) + at * share for name, (start, at) in moved.items()})
        rig.clock.sleep(plan.step_s)
    return dict(to)


def _take(rig: Rig, plan: Plan, record: Recorder, one: Level, number: int) -> None:
    assert rig.capture is not None
    labels: dict[str, float | str] = {**vars(one), "number": number}
    seconds = plan.average_s + MARGIN_S
    with record.step(STEP, **labels):
        rig.capture.arm(captured(rig.file), seconds=seconds, rate_hz=rate(rig.file, plan))
        rig.capture.wait(seconds + 5.0)
    rig.capture.upload(None, **labels)


@dataclass(frozen=True)
class Evaluated:
    """The result, and the levels that it is from."""

    result: Result
    taken: tuple[Taken, ...]


def evaluate(recording: Recording[Plan], findings: Findings) -> Evaluated:
    """Ratios and centres."""
    from procedures.pull_ratio import checks

    rig, plan = recording.rig, recording.plan
    taken = read_taken(recording)
    findings.gate(checks.of_signals(taken, rig, plan))
    try:
        known = {need.procedure: recording.calibration(need.procedure).values for need in needs(plan)}
        result = estimates.result(taken, rig, known.get(POLE), known.get(CONSTANTS))
    except AnalysisError as error:
        findings.end(Finding("no-pull", f"{error}.", "", Effect.ERROR))
    findings.gate(checks.of_result(result, taken, rig, plan))
    return Evaluated(result, tuple(taken))


def measured(found: Evaluated) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in found.result.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    levels = plan.levels_m
    if list(levels) != sorted(set(levels)) or levels[0] >= 0 or levels[-1] <= 0:
        yield f"levels_m: found {levels}; expected different levels in ascending order, on both sides of zero"
        return
    if plan.observer:
        yield from planned.of_observer(rig, plan.observer)
    if plan.pole == "calibration" and rig.capabilities.hold is None:
        yield "pole: found 'calibration'; expected none: the rig file tells no capabilities.hold"
    motion, at = rig.capabilities.motion, place(rig, plan)
    if plan.place_m is not None and motion is None:
        yield "place_m: the rig file tells no capabilities.motion; expected none"
    yield from of_rate(rig, plan.rate_hz)
    farthest = max(-levels[0], levels[-1])
    if farthest > rig.envelope.max_levitated_position_m:
        limit = rig.envelope.max_levitated_position_m
        yield f"levels_m: found {farthest * 1e6:g} µm; the envelope allows {limit * 1e6:g} µm"
    for name in (name for p in planes(rig) for name in p.loops):
        force, most = needed_N(rig, name, farthest)
        if force > MARGIN * most:
            yield (f"levels_m: {name} would need {force:.3g} N at {farthest * 1e6:g} µm; expected at most {MARGIN:.0%} of its "
                   f"loop's limit, {MARGIN * most:.3g} N")  # fmt: skip
    wanted = {motion.place: at} if motion is not None and at is not None else {}
    for level in (levels[0], levels[-1]):
        for axis in axes(rig):
            some = asked(rig, Level(axis, BOTH, level, 1))
            yield from (f"{axis}: {problem}" for problem in Envelope(rig).problems_of(wanted | some))


def figures(found: Evaluated, recording: Recording[Plan]) -> Iterable[Figure]:
    """Current over place, of each axis."""
    from procedures.pull_ratio import figures as drawn

    return drawn.all_figures(found.result, found.taken, recording.rig)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What follows from what the plan does not take."""
    return (*(BY_POLE if plan.pole == "none" else ()), *((PULL,) if plan.constants == "none" else ()))


procedure = Procedure(
    name="pull-ratio",
    title="Pull of the magnets over the bearings' force constant, and where no current is needed",
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
    optional=(*BY_POLE, PULL),  # without a pole or constants; and where no axis carries the weight
    left_out=left_out,
    assumes=assumptions.PULL_RATIO,
    method=read_method(__file__),
)
