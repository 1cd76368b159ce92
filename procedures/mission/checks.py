"""What can be wrong with a flight, as findings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.mission.estimates import Told, gate_of, gated
from procedures.mission.plan import Plan
from procedures.mission.steps import Flight, holds
from procedures.position_loops.movers import radial

UM = 1e6
EXPECTED = ("LIFTING", "LEVITATED")
LANDED = ("LANDING", "READY", "OFF")
OUTSIDE = 5.0  # standard deviations of a reading's noise


def of_flight(flight: Flight, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Whether it flew, from the gate to the last move."""
    if flight.since("LIFTING") is None:
        yield Finding("not-lifted", "the controller never began to lift", "lift", Effect.ERROR)
    elif flight.since("LEVITATED") is None:
        yield Finding("gate-not-passed", _at_the_gate(flight, rig), "gate", Effect.ERROR)
    elif early := _came_down(flight):
        yield Finding("came-down", early, "state", Effect.ERROR)
    elif len(flight.moves) < 2 * plan.repeats or len(flight.pieces) < plan.captures:
        found, expected = (len(flight.moves), len(flight.pieces)), (2 * plan.repeats, plan.captures)
        text = f"found {found[0]} moves in {found[1]} captures; expected {expected[0]} in {expected[1]}"
        yield Finding("moves-missing", text, "move", Effect.ERROR)
    elif outside := [m for m in flight.moves if not any(holds(p, m) for p in flight.pieces)]:
        text = (
            f"{len(outside)} of {len(flight.moves)} moves lie in no capture, first that of repeat {outside[0].repeat}: "
            "commands came later than a capture leaves room for. Take a host that is less busy, or a longer "
            f"spare_s ({plan.spare_s:g} s a move)"
        )
        yield Finding("moves-missing", text, "move", Effect.ERROR)


def _at_the_gate(flight: Flight, rig: RigFile) -> str:
    """Which probe keeps it from passing, and how far it reads in the last of the gate's times."""
    limit, seconds = gate_of(rig)
    t = flight.telemetry["t"]
    lifting = [(a, b) for (name, a), (_, b) in zip(flight.states, [*flight.states[1:], ("", t[-1])], strict=True)
               if name == "LIFTING"]  # fmt: skip
    begin, end = lifting[-1]
    late = (t >= max(begin, end - seconds)) & (t < end)
    far = {p: float(np.abs(flight.telemetry[c][late]).max()) for p, c in radial(rig).items()}
    worst = max(far, key=lambda p: far[p])
    each = ", ".join(f"{p} {x * UM:.1f}" for p, x in far.items())
    return (f"the gate did not pass within {end - begin:.1f} s: {worst} reads up to {far[worst] * UM:.1f} µm in the last "
            f"{seconds:g} s ({each}), {limit * UM:.3g} µm allowed")  # fmt: skip


def _came_down(flight: Flight) -> str:
    """What the controller did while moves were still to come; nothing where it held the mover."""
    passed = flight.since("LEVITATED")
    last = flight.moves[-1].end if flight.moves else passed
    assert passed is not None
    assert last is not None
    for name, t in flight.states:
        if passed < t < last and name not in EXPECTED:
            return f"{t - passed:.2f} s after the gate the controller went to {name} by itself, {last - t:.2f} s before the end"
    return ""


def of_results(told: Told, flight: Flight, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """What to think of the numbers."""
    for name, probe in told.alone:
        text = f"one repeat stands out: {name} of {probe} is that of this one. Did something push the mover?"
        yield Finding("repeat-stands-out", text, probe, Effect.NOTE)
    if any(gated(flight, rig, channel) is None for channel in radial(rig).values()):
        text = f"the gate's time lies outside the {plan.lift_s:g} s captured: no gate_margin. Capture longer (lift_s)."
        yield Finding("gate-not-captured", text, "gate", Effect.INDETERMINATE, ("gate_margin",))
    for probe, channel in radial(rig).items():
        far, seen = _telemetry(flight, channel), told.largest[probe]
        if far > seen + OUTSIDE * told.noise[probe]:
            text = f"{probe} reads {far * UM:.1f} µm while nothing was captured, {seen * UM:.1f} µm in the captures"
            yield Finding("far-outside-captures", text, probe, Effect.INDETERMINATE, (f"peak_reading@{probe}",))
    yield Finding("captured", _captured(flight), "capture", Effect.NOTE)
    read = ", ".join(f"{p} {x * UM:.2f}" for p, x in told.largest.items())
    noise = ", ".join(f"{p} {x * UM:.2f}" for p, x in told.noise.items())
    text = f"largest single readings, noise included: {read} µm; a reading's noise at rest: {noise} µm"
    yield Finding("single-readings", text, "peak_reading", Effect.NOTE)


def _telemetry(flight: Flight, channel: str) -> float:
    """The largest |reading| that the telemetry has from the gate to the end of the last move, m."""
    passed, t = flight.since("LEVITATED"), flight.telemetry["t"]
    assert passed is not None
    return float(np.abs(flight.telemetry[channel][(t >= passed) & (t <= flight.moves[-1].end)]).max())


def _captured(flight: Flight) -> str:
    every = [p for p in (flight.lift, *flight.pieces) if p is not None]
    size = sum(2 * len(p.t) * len(p.columns) for p in every)
    seconds = ", ".join(f"{p.t[-1] - p.t[0]:.2f} s" for p in every)
    return (
        f"captured: {len(every)} pieces of {seconds}, {size / 1e6:.1f} MB. Nothing is captured while one is uploaded."
    )
