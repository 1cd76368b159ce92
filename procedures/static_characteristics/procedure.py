"""Static torque and force of a reluctance machine's phases over place, angle and current, by load cells that hold the shaft.

Measurands: the constants of the map's formula by force and torque (`static_...`), beside those that `inductance-map` has by
flux; what each phase gives at the magnetic centre by the plan's greatest current; force and torque by cells over those of the
other map; what both cells say of one field; how far the cells yield, and what friction held in the readings.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from typing import TYPE_CHECKING

from bench.calibration import Need
from bench.errors import AnalysisError
from bench.figures import Shown
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.earlier import AGAIN
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.shared import continued
from procedures.stages import assumptions
from procedures.stages.stators import axis, phases
from procedures.static_characteristics import checks
from procedures.static_characteristics.beside import Beside, by_flux, of_controller
from procedures.static_characteristics.places import SIDES, Load, grid, loads, repeated
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.requires import Cell, cells, requires
from procedures.static_characteristics.steps import READ, READING, read_taken

if TYPE_CHECKING:
    from procedures.static_characteristics.estimates import Result

PART = "cells"
MAP = "inductance-map"
MEASURES = (
    Quantity("force_ratio", "1", "force by load cells over that of the other map, over all readings"),
    Quantity("torque_ratio", "1", "torque by load cells over that of the other map, over all readings"),
    Quantity("reciprocity", "1", "what the torque grows along over what the force grows around, each by its cell as stated"),
    Quantity("force", "N", "of an aligned phase at the magnetic centre, by the plan's greatest current"),
    Quantity("torque", "N m", "the greatest of a phase at the magnetic centre, by the plan's greatest current"),
    Quantity("static_gain", "1", "a phase's force and torque relative to the mean of all"),
    Quantity("static_slope", "H/m", "inductance per metre of overlap of an aligned phase, by force and torque; mean of all"),
    Quantity("static_saturation", "A", "current at which teeth saturate, by force and torque"),
    Quantity("static_unaligned", "1", "inductance midway between aligned angles, of the aligned"),
    Quantity("static_c2", "1", "second harmonic of the angle, of the first"),
    Quantity("static_c3", "1", "third harmonic of the angle, of the first"),
    Quantity("static_length", "m", "of a stack, by how its force ends"),
    Quantity("static_overlap", "m", "of mover and each stator at the magnetic centre"),
    Quantity("static_fringe", "m", "of the stray field at the ends of a stack"),
    Quantity("static_zero", "rad", "what the encoder reads where the first phase of a stator is aligned"),
    Quantity("static_centre", "m", "what the encoder reads where both stators hold as much of the mover"),
    Quantity("static_uneven", "1", "share that turns once with the angle, as its cosine and its sine"),
    Quantity("cell_give", "rad/(N m)", "by which the torque cell yields"),
    Quantity("cell_give_x", "m/N", "by which the axial cell yields"),
    Quantity("held", "N", "friction in a reading along, half of what both sides differ by"),
    Quantity("held_angle", "N m", "friction in a reading around, half of what both sides differ by"),
)  # fmt: skip
BESIDE = MEASURES[:2]


def step_count(plan: Plan) -> int:
    """Of six phases: a reading of each load from both sides at each place."""
    return 2 * len(grid(plan)) * (2 + 6 * len(plan.levels_A))


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    return len(grid(plan)) * whole(rig, plan)


def whole(rig: RigFile, plan: Plan) -> int:
    """Readings at a place: each needs the zeros of the cells as they are mounted there."""
    return len(SIDES) * len([*loads(plan, phases(rig))])


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """From place to place: sent there, taken by the cells, let go; each load is read from both sides. A run that goes on with a
    stopped one reads the greatest loads of the last place again, and goes on at the next."""
    assert rig.motion is not None
    some, both, done = phases(rig.file), cells(rig.file), continued.done(record, READING)
    assert both is not None
    by_name, each = {p.name: p.value for p in some}, whole(rig.file, plan)
    numbers = count(len(done.labels) + len(record.completed(READING + AGAIN)))
    for place in grid(plan):
        last = (place.number + 1) * each - 1
        if done.leaves_out(last):
            continue
        again = done.repeats(last)
        transition(rig, RigState.HELD)
        rig.motion.move({both[0].axis.name: place.x, both[1].axis.name: place.angle})
        rig.clock.sleep(plan.settle_s)
        transition(rig, RigState.READY)
        rig.operator.mount(PART)
        test = rig.file.capabilities.phase_test
        assert test is not None
        try:
            for number, load in enumerate(loads(plan, some)):
                if again and number not in repeated(plan, some):
                    continue
                _carry(rig, by_name.get(load.phase, test.off), load)
                for side in SIDES:
                    rig.operator.wind(side)
                    labels = {"number": next(numbers), "place": place.number, "load": number, "side": side}
                    _read(rig, plan, record, both, labels, again)
        finally:
            _carry(rig, test.off, Load("", 0.0))
        rig.operator.mount("")


def _carry(rig: Rig, phase: float, load: Load) -> None:
    test = rig.file.capabilities.phase_test
    assert rig.motion is not None
    assert test is not None
    rig.motion.write({test.current: 0.0})
    rig.motion.write({test.phase: phase})
    if load.level:
        rig.motion.write({test.current: load.level})


def _read(
    rig: Rig, plan: Plan, record: Recorder, both: tuple[Cell, Cell], labels: Mapping[str, object], again: bool
) -> None:
    with record.step(READING + AGAIN if again else READING, **labels):
        for cell in both:
            if not cell.by.channel:
                value = rig.operator.read_cell(cell.axis.name, cell.by.instrument, cell.unit)
                record.event(
                    READ, number=labels["number"], axis=cell.axis.name, value=value
                )  # a step without it is none
        if any(cell.by.channel for cell in both):
            rig.clock.sleep(plan.window_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Loads, and the map that fits them."""
    from procedures.static_characteristics import estimates, halves

    rig, plan, taken = recording.rig, recording.plan, read_taken(recording)
    findings.gate(checks.of_signals(taken, rig, plan))
    findings.gate(checks.of_order(taken, rig))
    findings.add(checks.of_readings(taken, plan))
    try:
        result = estimates.result(taken, rig, max(plan.levels_A), _beside(recording))
    except AnalysisError as error:
        findings.end(Finding("map-not-determined", f"{error}.", "", Effect.ERROR))
    findings.add(halves.findings(recording, result))
    findings.add(checks.of_results(result, plan))
    return result


def _beside(recording: Recording[Plan]) -> Beside | None:
    """The map by flux where one was adopted, else the controller's."""
    some = phases(recording.rig)
    found = next((c for c in recording.calibrations if c.procedure == MAP), None)
    flux = None if found is None else by_flux(found.values, some)
    return flux if flux is not None else of_controller(recording.rig, some)


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
    envelope = Envelope(rig)
    for position in plan.positions_m:
        yield from envelope.problems_of({x.target: position})
    for level in plan.levels_A:
        yield from envelope.problems_of({test.current: level})
    if len(set(plan.positions_m)) < 3 or len(grid(plan)) < checks.FEWEST:
        yield (f"positions_m: found {len(set(plan.positions_m))} different ones, {len(grid(plan))} places; expected 3 "
               f"or more, at both "
               f"ends too, and {checks.FEWEST} places")  # fmt: skip
    if list(plan.levels_A) != sorted(set(plan.levels_A)) or min(plan.levels_A) <= 0:
        yield f"levels_A: found {', '.join(f'{a:g}' for a in plan.levels_A)}; expected them ascending from above 0"


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Shown]:
    """Torque and force."""
    from procedures.static_characteristics import figures as drawn

    del recording
    return drawn.all_figures(result)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What a rig has no other map for, unless one is adopted."""
    return () if of_controller(rig, phases(rig)) is not None else BESIDE


def needs(_: Plan) -> tuple[Need, ...]:
    """A map by flux, where there is one."""
    return (Need(MAP, optional=True),)


def holds_for(_: Plan) -> Mapping[str, float]:
    """A map is the machine's, whatever the plan."""
    return {}


procedure = Procedure(
    name="static-characteristics",
    title="Static torque and force of a reluctance machine's phases by load cells",
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
    continues=READING,
    whole=whole,
    steps_on=steps_on,
    fewest_steps=lambda plan: 2 * checks.FEWEST * (2 + len(plan.levels_A)),
    needs=needs,
    untold=untold,
    optional=BESIDE,
    holds_for=holds_for,
    reached=("scatter/*", "counts/*", "encoders/*", "capabilities/load_cells/*", "geometry/*", "sensors/*/offset"),
    assumes=assumptions.STATIC_CHARACTERISTICS,
    places=("cosine", "sine"),
    method=read_method(__file__),
)
