"""Repeatability and accuracy of positioning after ISO 230-2, along and around, by a reference instrument outside the loop.

Measurands, by axis: A, R, E, M, B of the standard, both ways and each (`standard.py`), of the true places of these very
approaches, about which the instrument leaves open what its certificate does. What the axis' own encoder reads is never taken
for its place: that would be the repeatability of a counter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from bench.figures import Shown
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.rigfile.stage import axes_of
from procedures.positioning.plan import Plan
from procedures.positioning.requires import COUNTER, readable, requires
from procedures.positioning.standard import FIGURES
from procedures.positioning.steps import READ, READING, REST, read_taken
from procedures.positioning.targets import UP, Approach, cycle, fewest
from procedures.positioning.way import Tested, rates, tested
from procedures.stages import assumptions

if TYPE_CHECKING:
    from procedures.positioning.estimates import Result

WORDS = {
    "A": ("bidirectional accuracy", "from the lowest mean - 2 s to the highest mean + 2 s, both ways"),
    "A_up": ("accuracy up", "from the lowest mean - 2 s to the highest mean + 2 s, from below"),
    "A_down": ("accuracy down", "from the lowest mean - 2 s to the highest mean + 2 s, from above"),
    "R": ("bidirectional repeatability", "the largest of 2 s up + 2 s down + |B_i| and of 4 s"),
    "R_up": ("repeatability up", "the largest 4 s from below"),
    "R_down": ("repeatability down", "the largest 4 s from above"),
    "E": ("systematic deviation", "from the lowest to the highest mean, both ways"),
    "E_up": ("systematic deviation up", "from the lowest to the highest mean from below"),
    "E_down": ("systematic deviation down", "from the lowest to the highest mean from above"),
    "M": ("mean deviation", "from the lowest to the highest mean of both ways"),
    "B": ("reversal value", "the largest |B_i|, mean up less mean down"),
    "B_mean": ("mean reversal value", "the mean of B_i, mean up less mean down"),
}
ALONG = tuple(Quantity(n, "m", f"{WORDS[n][1]} (ISO 230-2)", title=WORDS[n][0]) for n in FIGURES)
AROUND = tuple(
    Quantity(f"{n}_angle", "rad", f"{WORDS[n][1]} (ISO 230-2)", title=f"{WORDS[n][0]} around") for n in FIGURES
)
MEASURES = (*ALONG, *AROUND)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """One axis after the other, approach after approach, each read at rest."""
    numbers = count(1)
    for one in tested(rig.file, plan):
        before: Approach | None = None
        for approach in cycle(one.at, plan.repeats):
            if before is None or before.way != approach.way:
                _go(rig, one, one.beyond[0 if approach.way == UP else 1])
            _go(rig, one, approach.place)
            rig.clock.sleep(max(plan.dwell_s - plan.rest_s, 0.0))
            for _ in range(plan.tries):
                if _read(rig, plan, record, one, approach, next(numbers)):
                    break
            before = approach


def _go(rig: Rig, one: Tested, place: float) -> None:
    assert rig.motion is not None
    rig.motion.move({one.axis.name: place})


def _read(rig: Rig, plan: Plan, record: Recorder, one: Tested, approach: Approach, number: int) -> bool:
    """One reading; whether the axis stood still before it and meanwhile. A loop that integrates against friction jumps now and
    then; of more readings at one approach the last one counts."""
    labels = {"axis": one.axis.name, "number": number, "place": approach.place,
              "target": approach.target, "way": approach.way, "repeat": approach.repeat}  # fmt: skip
    channel, shown = one.axis.channel, None
    with record.watching((channel,)) as seen:
        with record.step(REST, **labels):
            rig.clock.sleep(plan.rest_s)
        with record.step(READING, **labels):
            if one.by.channel:
                rig.clock.sleep(plan.window_s)
            else:
                shown = rig.operator.read(one.axis.name, one.by.instrument, one.unit)
    if shown is not None:
        record.event(READ, number=number, axis=one.axis.name, value=shown)
    stood = seen.get(channel)
    return stood is None or not one.pitch or float(np.ptp(stood)) <= (plan.rest_counts + 0.25) * one.pitch


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """The figures of each axis."""
    from procedures.positioning import checks, estimates

    taken = read_taken(recording)
    findings.gate(checks.of_signals(taken, recording.rig, recording.plan))
    findings.add(checks.of_axes(taken, recording))
    results = estimates.results(taken)
    findings.add(checks.of_results(results))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """Figure by figure."""
    for unit, quantities in (("m", ALONG), ("rad", AROUND)):
        for quantity, name in zip(quantities, FIGURES, strict=True):
            yield from (quantity.measured(r.estimates[name], r.name) for r in results if r.unit == unit)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    can, known = readable(rig), axes_of(rig)
    for name in plan.axes:
        if name not in known:
            yield f"axes: found {name!r}; expected one of {', '.join(known)}"
        elif name not in can:
            yield f"axes: found {name!r}, which no reference instrument reads; {COUNTER}"
    envelope = Envelope(rig)
    for one in tested(rig, plan):
        where = f"axis {one.axis.name}"
        if len(one.at) < 2 or any(b <= a for a, b in zip(one.at, one.at[1:], strict=False)):
            yield f"{where}: found targets {', '.join(f'{p:g}' for p in one.at)}; expected two or more, from below"
            continue
        for place in (*one.beyond, *one.at.tolist()):
            yield from (f"{where}: {problem}" for problem in envelope.problems_of({one.axis.target: place}))
    yield from envelope.problems_of(rates(rig, plan))
    if plan.rest_s > plan.dwell_s:
        yield f"rest_s: found {plan.rest_s:g} s; expected no more than dwell_s, {plan.dwell_s:g} s"


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """Of axes along and around, those that no instrument reads."""
    units = {axis.unit for axis in readable(rig).values()}
    return (*(() if "m" in units else ALONG), *(() if "rad" in units else AROUND))


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What a chosen axis is, along or around, the rig alone knows."""
    return MEASURES if plan.axes else ()


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """How fast it goes."""
    return rates(rig, plan)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """A rest and a reading for each approach, where the axis stands still."""
    return sum(4 * len(one.at) * plan.repeats for one in tested(rig, plan))


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Shown]:
    """The standard's diagram first."""
    from procedures.positioning import figures as drawn

    return drawn.all_figures(results, recording.rig)


procedure = Procedure(
    name="positioning",
    title="Repeatability and accuracy of positioning by a reference instrument (ISO 230-2)",
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
    step_count=lambda plan: 4 * plan.repeats * (fewest("m", 0.1) + fewest("rad", plan.turn_rad)),
    steps_on=steps_on,
    fewest_steps=lambda plan: 4 * plan.repeats * 2,
    untold=untold,
    optional=MEASURES,
    left_out=left_out,
    assumes=assumptions.POSITIONING,
    method=read_method(__file__),
)
