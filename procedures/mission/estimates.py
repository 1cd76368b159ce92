"""Numbers with influences: what a flight was, by quantity and place.

Largest readings are of each repeat, there and back, and their mean is taken: repeats are alike, and the largest of several
would be that of noise. One that stands out by itself is the largest, by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.mission import fit
from procedures.mission.fit import Largest
from procedures.mission.plan import Plan
from procedures.mission.steps import Flight, Move, Piece, holds
from procedures.position_loops.movers import motion, radial
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
CLEAR = 20.0  # times its noise: what noise adds is known to half; below, to its size, for the curve is noise itself
OUT = 6.0  # standard uncertainties by which a repeat stands out


@dataclass(frozen=True)
class Told:
    """Estimates by name and place. `alone` are names and places where one repeat stood out; `noise` is, by probe, the standard
    deviation of a reading at rest, m; `largest`, by probe, the largest |reading| as it was read, m."""

    estimates: Mapping[tuple[str, str], Estimate]
    alone: Sequence[tuple[str, str]]
    noise: Mapping[str, float]
    largest: Mapping[str, float]


def of_flight(flight: Flight, rig: RigFile, plan: Plan) -> Told:
    """All of it; the gate is there where its time lies in the capture of the lift."""
    out: dict[tuple[str, str], Estimate] = {}
    alone: list[tuple[str, str]] = []
    noise, largest = {}, {}
    for probe, channel in radial(rig).items():
        gain = certified_gain(rig, channel)
        rests = rested(flight, plan, channel)
        noise[probe] = float(np.mean([_high(r, plan) for r in rests]))
        largest[probe] = max(float(np.abs(p.columns[channel]).max()) for p in flight.pieces)
        for name, of in (("peak_reading", fit.largest_distance), ("swing", fit.swing)):
            found, one = _over_repeats(f"{name}/{probe}", repeated(flight, channel), rests, plan, of)
            out[name, probe] = found / gain
            alone += [(name, probe)] if one else []
        out["level_difference", probe] = _paired(f"level_difference/{probe}", flight, plan, channel) / gain
        if (margin := gate_margin(flight, rig, plan, probe, rests)) is not None:
            out["gate_margin", probe] = margin
    out |= _settled(flight, rig, plan)
    out |= _lift_time(flight, rig)
    return Told(out, alone, noise, largest)


def rest_of(move: Move, plan: Plan) -> tuple[float, float]:
    """When the mover stood after a move, s."""
    return move.end - plan.rest_s, move.end


def piece_of(flight: Flight, move: Move) -> Piece:
    """The capture that holds a move."""
    return next(p for p in flight.pieces if holds(p, move))


def rested(flight: Flight, plan: Plan, channel: str) -> list[Array]:
    """Readings (m,) after each move."""
    out = []
    for move in flight.moves:
        piece = piece_of(flight, move)
        out.append(piece.columns[channel][piece.cut(*rest_of(move, plan))])
    return out


def repeated(flight: Flight, channel: str) -> list[Array]:
    """Readings (n,) of each repeat, there and back."""
    out = []
    for there, back in zip(flight.moves[::2], flight.moves[1::2], strict=True):
        piece = piece_of(flight, there)
        out.append(piece.columns[channel][piece.cut(there.begin, back.end)])
    return out


def _high(rest: Array, plan: Plan) -> float:
    return float((rest - fit.smoothed(rest, plan.smooth_s * plan.rate_hz)).std())


def _over_repeats(
    identity: str, records: Sequence[Array], rests: Sequence[Array], plan: Plan, of: Callable[[Array], float]
) -> tuple[Estimate, bool]:
    """The mean over repeats, or one that stands out; and whether one does."""
    found = [fit.without_noise(x, rests, plan.smooth_s * plan.rate_hz, of) for x in records]
    values = np.array([f.value for f in found])
    top = int(values.argmax())
    others = np.delete(values, top)
    u = math.hypot(found[top].u, float(others.std()))
    if values[top] - others.mean() > OUT * u:
        return _largest(identity, found[top]), True
    mean = Largest(
        float(values.mean()), *(float(np.mean([getattr(f, k) for f in found])) for k in ("bias", "u", "bent"))
    )
    scatter = _type_a(identity, values)
    return _largest(identity, mean, scatter), False


def _largest(identity: str, found: Largest, scatter: Estimate | None = None) -> Estimate:
    """With what noise and window leave: `scatter` in place of the noise of one record."""
    known = abs(found.bias) * (0.5 if found.value > CLEAR * found.u else 1.0)
    off = found.bent / math.sqrt(3)
    one = Influence(f"noise/{identity}", "noise of one record", found.u, "m", "A", "normal")
    biased = Influence(f"bias/{identity}", "what noise adds to a largest value", known, "m", "B", "normal")
    bent = Influence(f"window/{identity}", "what averaging takes off a peak", off, "m", "B", "rectangular")
    out = Estimate.of(0.0, biased) + Estimate.of(0.0, bent) + (Estimate.of(0.0, one) if scatter is None else scatter)
    return out + (found.value if scatter is None else 0.0)


def _type_a(identity: str, values: Array, unit: str = "m") -> Estimate:
    """Mean of values (n,) with their scatter."""
    u = float(values.std(ddof=1)) / math.sqrt(len(values))
    return Estimate.of(
        float(values.mean()),
        Influence(f"scatter/{identity}", "scatter of the repeats", u, unit, "A", "normal", float(len(values) - 1)),
    )


def levels(flight: Flight, plan: Plan, channel: str) -> tuple[Array, Array]:
    """Means at rest (repeats,) back and there."""
    means = np.array([r.mean() for r in rested(flight, plan, channel)])
    there = np.array([m.there for m in flight.moves])
    return means[there == 0], means[there == 1]


def _paired(identity: str, flight: Flight, plan: Plan, channel: str) -> Estimate:
    back, there = levels(flight, plan, channel)
    return _type_a(identity, there - back)


def gate_margin(flight: Flight, rig: RigFile, plan: Plan, probe: str, rests: Sequence[Array]) -> Estimate | None:
    """What the gate leaves; None where the capture of the lift does not hold its time. Telemetry tells up to a period late that
    the gate passed, and what a lift leaves decays: the time it began at matters."""
    late, early = (gated(flight, rig, radial(rig)[probe], by) for by in (0.0, period_of(flight)))
    if late is None or early is None:
        return None
    limit, _ = gate_of(rig)
    width, of = plan.smooth_s * plan.rate_hz, fit.largest_distance
    ends = [fit.without_noise(x, rests, width, of) for x in (late, early)]
    u = abs(ends[0].value - ends[1].value) / 2 / math.sqrt(3)
    told = Influence(f"telemetry/{probe}/gate", "when the gate's time began", u, "m", "B", "rectangular")
    found = Largest(*((getattr(ends[0], k) + getattr(ends[1], k)) / 2 for k in ("value", "bias", "u", "bent")))
    return limit - _largest(f"gate_margin/{probe}", found) + Estimate.of(0.0, told)


def gate_of(rig: RigFile) -> tuple[float, float]:
    """The gate, m, and its time, s."""
    at = motion(rig)
    return rig.parameters[at.gate].default, rig.parameters[at.gate_time].default


def gated(flight: Flight, rig: RigFile, channel: str, before_s: float = 0.0) -> Array | None:
    """Readings (n,) over the gate's time before telemetry told that the mover is lifted, or so much earlier."""
    passed, lift, (_, seconds) = flight.since("LEVITATED"), flight.lift, gate_of(rig)
    if passed is None or lift is None:
        return None
    passed -= before_s
    if not lift.t[0] <= passed - seconds <= passed <= lift.t[-1]:
        return None
    return lift.columns[channel][lift.cut(passed - seconds, passed)]


def period_of(flight: Flight) -> float:
    """Of the telemetry, s: a state is told up to so much late."""
    return float(np.median(np.diff(flight.telemetry["t"])))


def _settled(flight: Flight, rig: RigFile, plan: Plan) -> dict[tuple[str, str], Estimate]:
    """Where the mover stood, less where it was sent."""
    at, out = motion(rig), {}
    assert rig.capture is not None
    for k in (0, 1):
        for name, channel, sent, unit in (
            ("place_error", at.place_channel, plan.places_m[k], "m"),
            ("angle_error", at.angle_channel, plan.angles_rad[k], "rad"),
        ):
            where = place_of(plan, k)
            stood = _type_a(f"{name}/{where}", levels(flight, plan, channel)[k], unit)
            rounding = _rounding(channel, rested(flight, plan, channel), rig.capture.channels[channel].scale, unit)
            gain = certified_gain(rig, channel) if channel in rig.sensors else Estimate.exact(1.0, "1")
            out[name, where] = (stood + Estimate.of(0.0, rounding)) / gain - sent
    return out


def _rounding(channel: str, rests: Sequence[Array], count: float, unit: str) -> Influence:
    """What rounding leaves of a mean: half a `count` at most, and the less the more noise the reading has."""
    noise = max(float(np.mean([r.var() for r in rests])) / count**2 - 1 / 12, 0.0)  # squares of counts
    off = count / 2 * math.exp(-2 * math.pi**2 * noise)
    return Influence(f"rounding/{channel}", "rounding of the mean", off / math.sqrt(2), unit, "B", "arcsine")


def place_of(plan: Plan, k: int) -> str:
    """What the two places are called."""
    return f"{plan.places_m[k] * 1e3:g} mm, {math.degrees(plan.angles_rad[k]):.4g}°"


def _lift_time(flight: Flight, rig: RigFile) -> dict[tuple[str, str], Estimate]:
    begun, passed = flight.since("LIFTING"), flight.since("LEVITATED")
    if begun is None or passed is None:
        return {}
    off = period_of(flight) / math.sqrt(3)  # not random: the host's commands may keep step with telemetry
    seen = Influence("telemetry/lift_time", "telemetry's period", off, "s", "B", "rectangular")
    return {("lift_time", ""): Estimate.of(passed - begun, seen)}
