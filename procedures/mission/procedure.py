"""Mission: lift, gate, moves along and around at once, landing (L VI-B, the LDIA 2021 paper on the linear-rotary actuator).

Measurands, by radial probe, m along the probe from where it reads zero, without the noise of the readings: the largest distance
and the swing during the moves, the difference of the levels at the two places, and what the gate leaves; where the mover stands
against where it was sent; how long a lift takes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from bench.errors import DeviceFault, InterlockError
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.mission.plan import Plan
from procedures.mission.requires import requires
from procedures.mission.steps import LIFT, MOVE, TURN, Flight, captured, read
from procedures.position_loops.movers import motion, radial
from procedures.shared import assumptions, planned

if TYPE_CHECKING:
    from procedures.mission.estimates import Told

PEAK = Quantity("peak_reading", "m", "largest distance from the probe's zero during the moves, without noise")
SWING = Quantity("swing", "m", "peak to peak during a repeat, there and back, without noise")
LEVEL = Quantity("level_difference", "m", "mean reading at the second place less that at the first, at rest")
MARGIN = Quantity("gate_margin", "m", "gate less the largest reading over its time, without noise")
PLACE = Quantity("place_error", "m", "where the mover stands along the shaft less where it was sent")
ANGLE = Quantity("angle_error", "rad", "angle at which it stands less that to which it was sent")
TIME = Quantity("lift_time", "s", "from the beginning of the lift until the gate has passed")
MEASURES = (PEAK, SWING, LEVEL, MARGIN, PLACE, ANGLE, TIME)
TURN_RATE, TURN_RISE = 2.0, 20.0  # rad/s and rad/s^2 in the rings, which rub
TAIL_S = 0.02  # of a capture after its last move
LOOK_S = 0.01


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """The observer that the plan asks for."""
    return planned.observer(rig, plan.observer)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Turn in the rings, lift, go there and back, land. Where the gate does not pass nothing more is done."""
    at = motion(rig.file)
    with _named(rig):
        _write(rig, {at.angle_rate: TURN_RATE, at.angle_rise: TURN_RISE, at.angle: plan.angles_rad[0]})
        with record.step(TURN):
            rig.clock.sleep(plan.turn_s)
        if not _lifted(rig, plan, record):
            return
        rates = {at.place_rate: plan.place_rate_m_s, at.place_rise: plan.place_rise_m_s2,
                 at.angle_rate: plan.angle_rate_rad_s, at.angle_rise: plan.angle_rise_rad_s2}  # fmt: skip
        _write(rig, rates)
        for repeats in pieces(plan):
            _fly(rig, plan, record, repeats)
        rig.levitation.land()


def pieces(plan: Plan) -> list[range]:
    """Repeats of each capture."""
    ends = [round(plan.repeats * k / plan.captures) for k in range(plan.captures + 1)]
    return [range(a, b) for a, b in pairwise(ends)]


def piece_s(plan: Plan, repeats: int) -> float:
    """How long a capture of so many repeats is, s; a command takes a while."""
    return 2 * repeats * (plan.dwell_s + plan.spare_s) + TAIL_S


@contextmanager
def _named(rig: Rig) -> Iterator[None]:
    """Says of what ends a flight how far the probes read then.

    Raises:
        DeviceFault, InterlockError: as they came, with the readings.
    """
    try:
        yield
    except (DeviceFault, InterlockError) as error:
        far = {probe: rig.levitation.reading(channel) for probe, channel in radial(rig.file).items()}
        worst = max(far, key=lambda p: abs(far[p]))
        each = ", ".join(f"{p} {x * 1e6:.1f}" for p, x in far.items())
        raise type(error)(f"{error}; farthest is {worst}, newest readings in µm: {each}") from error


def _write(rig: Rig, values: Mapping[str, float]) -> None:
    rig.levitation.write({name: value for name, value in values.items() if name})


def _lifted(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Whether the gate passed; captured until then."""
    assert rig.capture is not None
    rig.capture.arm(captured(rig.file, plan), seconds=plan.lift_s, rate_hz=plan.rate_hz)
    with record.step(LIFT):
        rig.levitation.lift()
        begun = rig.clock.now_ns()
        while rig.levitation.state is not RigState.LEVITATED and rig.clock.now_ns() - begun < plan.patience_s * 1e9:
            rig.clock.sleep(LOOK_S)
        rig.clock.sleep(LOOK_S)
    rig.capture.wait(plan.lift_s + 1.0)
    rig.capture.upload(None, part=LIFT)
    return rig.levitation.state is RigState.LEVITATED


def _fly(rig: Rig, plan: Plan, record: Recorder, repeats: range) -> None:
    """A capture with its moves."""
    assert rig.capture is not None
    at = motion(rig.file)
    _write(rig, {at.place: plan.places_m[0], at.angle: plan.angles_rad[0]})
    rig.clock.sleep(plan.settle_s)
    rig.capture.arm(captured(rig.file, plan), seconds=piece_s(plan, len(repeats)), rate_hz=plan.rate_hz)
    for repeat in repeats:
        for k in (1, 0):
            with record.step(MOVE, repeat=repeat, there=k, place_m=plan.places_m[k], angle_rad=plan.angles_rad[k]):
                begun = rig.clock.now_ns()
                _write(rig, {at.place: plan.places_m[k], at.angle: plan.angles_rad[k]})
                rig.clock.sleep(max(plan.dwell_s - 1e-9 * (rig.clock.now_ns() - begun), 0.0))
    rig.capture.wait(5.0)
    rig.capture.upload(None, part=MOVE)


@dataclass(frozen=True)
class Results:
    """The flight, and what it says."""

    plan: Plan
    flight: Flight
    told: Told


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Whether it flew, and the numbers."""
    from procedures.mission import checks, estimates

    flight, rig, plan = read(recording), recording.rig, recording.plan
    findings.gate(checks.of_flight(flight, rig, plan))
    told = estimates.of_flight(flight, rig, plan)
    findings.add(checks.of_results(told, flight, rig, plan))
    return Results(plan, flight, told)


def measured(results: Results) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in results.told.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    known = rig.capabilities.settings.get("observer", {})
    if plan.observer not in known:
        yield f"observer: found {plan.observer!r}; expected one of {', '.join(known) or '(the rig file has none)'}"
    at = motion(rig)
    for key, name, values in (("places_m", at.place, plan.places_m), ("angles_rad", at.angle, plan.angles_rad)):
        p = rig.parameters[name]
        if not all(p.low <= v <= p.high for v in values):
            yield f"{key}: found {', '.join(f'{v:g}' for v in values)}; expected {p.low:g} to {p.high:g}"
    fastest = rig.envelope.max_speed_rad_s
    if plan.angle_rate_rad_s >= fastest:
        yield f"angle_rate_rad_s: found {plan.angle_rate_rad_s:g}; the envelope allows {fastest:g} rad/s"
    if plan.captures > plan.repeats:
        yield f"captures: found {plan.captures}; expected at most {plan.repeats}, one for each repeat"
    if plan.rest_s > plan.dwell_s - 0.05:
        yield f"rest_s: found {plan.rest_s:g} s; expected less than dwell_s, {plan.dwell_s:g} s, by 0.05 s for the move"
    yield from _memory(rig, plan)


def _memory(rig: RigFile, plan: Plan) -> Iterator[str]:
    if rig.capture is None:
        return
    longest = max(plan.lift_s, *(piece_s(plan, len(r)) for r in pieces(plan)))
    size = 2 * len(captured(rig, plan)) * plan.rate_hz * longest
    if size > rig.capture.memory_bytes:
        yield (f"captures: found {plan.captures}, of up to {size / 1e6:.0f} MB; the controller keeps "
               f"{rig.capture.memory_bytes / 1e6:.0f} MB. Divide the repeats into more captures.")  # fmt: skip


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Readings with the gate, place and angle, the bearings' currents."""
    from procedures.mission import figures as drawn

    return drawn.all_figures(results.flight, results.told, recording.rig, results.plan)


procedure = Procedure(
    name="mission",
    title="Mission: lift, moves along and around, landing",
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
    step_count=lambda plan: 2 + 2 * plan.repeats,
    reached=("scatter/*", "noise/*", "bias/*", "window/*", "telemetry/*"),
    assumes=assumptions.MISSION,
    method=read_method(__file__),
)
