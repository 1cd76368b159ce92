"""Runout of a levitated shaft: of its probes' target and of its magnets together, by plane, while it is turned slowly.

Measurands, by plane of the bearings and place along, each in x and y as it points where the angle reads zero: the vector R - M
of the target's runout less that of the magnets, m, and that of the bearing's current that turns with the shaft, true A.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from bench.errors import BenchError
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.runout_map.plan import Plan
from procedures.runout_map.requires import requires
from procedures.runout_map.steps import TURN, read_turns
from procedures.shared import assumptions, planned

if TYPE_CHECKING:
    from procedures.runout_map.estimates import Results

RUNOUT = Quantity("runout", "m", "runout of the probes' target less that of the magnets, of one plane and part")
CURRENT = Quantity("runout_current", "A", "bearing current that turns with the shaft, of one plane and part",
                   title="current at one a turn")  # fmt: skip
MEASURES = (RUNOUT, CURRENT)


def step_count(plan: Plan) -> int:
    """For the progress display."""
    return 2 * plan.turns * len(plan.places_m)


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer."""
    return planned.observer(rig, plan.observer)


def ends(plan: Plan) -> tuple[float, float]:
    """Set points of the angle between which it is turned."""
    return -plan.lead_rad, 2 * math.pi + plan.lead_rad


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """At each place, both ways in turn."""
    for name, value in plan.parameters.items():
        rig.levitation.write({name: value})
    motion = rig.file.capabilities.motion
    assert motion is not None
    low, high = ends(plan)
    with _slow(rig, plan):
        for place in plan.places_m:
            rig.levitation.write({motion.place: place})
            rig.clock.sleep(plan.settle_s)
            for repeat in range(plan.turns):
                for sign in (1, -1):
                    rig.clock.sleep(plan.settle_s)
                    with record.step(TURN, place_m=place, way=sign, repeat=repeat):
                        rig.levitation.write({motion.angle: high if sign > 0 else low})
                        rig.clock.sleep((high - low) / plan.speed_rad_s)


@contextmanager
def _slow(rig: Rig, plan: Plan) -> Iterator[None]:
    """At the beginning of a turn, slow; in the end where it was and as fast as it was."""
    motion, write = rig.file.capabilities.motion, rig.levitation.write
    assert motion is not None
    usual = {
        n: plan.parameters.get(n, rig.file.parameters[n].default)
        for n in (motion.angle_rate, motion.angle, motion.place)
        if n
    }
    away_s = abs(ends(plan)[0] - usual[motion.angle]) / plan.speed_rad_s + plan.settle_s
    if motion.angle_rate:
        write({motion.angle_rate: plan.speed_rad_s})
    write({motion.angle: ends(plan)[0]})
    rig.clock.sleep(away_s)
    try:
        yield
    except BaseException:
        with suppress(BenchError):
            write({motion.angle_rate: usual[motion.angle_rate]} if motion.angle_rate else {})
        raise
    write({motion.angle: usual[motion.angle], motion.place: usual[motion.place]})
    rig.clock.sleep(away_s)
    if motion.angle_rate:
        write({motion.angle_rate: usual[motion.angle_rate]})


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Vectors of each plane."""
    from procedures.runout_map import checks, estimates

    rig, plan, turned = recording.rig, recording.plan, read_turns(recording)
    findings.gate(checks.of_signals(turned, rig, plan))
    results = estimates.results(turned, rig, plan)
    findings.add(checks.of_results(results, plan))
    return results


def measured(results: Results) -> Iterator[Measured]:
    """Both quantities of each plane and place."""
    for quantity in MEASURES:
        for (name, where), estimate in results.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    motion = rig.capabilities.motion
    assert motion is not None
    yield from planned.of_observer(rig, plan.observer)
    if problems := list(planned.of_parameters(rig, plan.parameters)):
        yield from problems
        return
    if len(set(plan.places_m)) < len(plan.places_m):
        yield "places_m: found a place twice"
    for place in plan.places_m:
        yield from Envelope(rig).problems_of({motion.place: place} | plan.parameters)
    for end in ends(plan):
        yield from Envelope(rig).problems_of({motion.angle: end})
    if motion.angle_rate:
        yield from Envelope(rig).problems_of({motion.angle_rate: plan.speed_rad_s})


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """The vectors."""
    from procedures.runout_map import figures as drawn

    del recording
    return drawn.all_figures(results)


procedure = Procedure(
    name="runout-map",
    title="Runout of a levitated shaft's target and magnets",
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
    fewest_steps=lambda plan: 4,
    assumes=assumptions.RUNOUT_MAP,
    method=read_method(__file__),
)
