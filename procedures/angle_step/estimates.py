"""From the moves of an angle step to estimates with influences: scatter of the repeats, sensors, sampling, encoder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.angle_step import bounds, steps
from procedures.angle_step.fine import BETWEEN, Fine, Raised, fine
from procedures.angle_step.response import Response, response
from procedures.angle_step.steps import Case, Done
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_gain

Moved = TypeVar("Moved", Response, Fine)


@dataclass(frozen=True)
class Result:
    """Responses of the moves of one case, and the mean of each quantity with its influences; no settling time where the angle
    does not settle. How many captures are `short`: they end before their step does."""

    case: Case
    responses: tuple[Response, ...]
    estimates: Mapping[str, Estimate]
    short: int = 0


def by_case(moves: list[Done], rig: RigFile, band: float, count_rad: float) -> dict[Case, Result]:
    """Every case's result; `band` is a share of the step, `count_rad` one encoder count.

    Raises:
        AnalysisError: a move does not reach its step.
    """
    machine = conventions(rig)
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    gains = {axis: certified_gain(rig, channel) for axis, channel in machine.positions.items()}
    period = _period(moves)
    out = {}
    for case, done in steps.by_case(moves).items():
        within = max(band * case.size, 2 * count_rad)
        responses = tuple(response(d.move, within) for d in done)
        found = _estimates(case, responses, gains, share, count_rad, period)
        captured, short = _captured(case, done, responses, rig, within, count_rad)
        out[case] = Result(case, responses, found | captured, short)
    return out


def _captured(
    case: Case, done: Sequence[Done], responses: Sequence[Response], rig: RigFile, band_rad: float, count: float
) -> tuple[dict[str, Estimate], int]:
    """What captures add and what they say better, where each step is over within its own; and how many are too short."""
    machine, swings = conventions(rig), [d.swing for d in done if d.swing is not None]
    if not swings:
        return {}, 0
    tick = float(swings[0].t[1])
    noise = bounds.noise_of(rig, tuple(machine.positions.values()), 1 / tick)
    shown = [fine(d, s, r.settling, band_rad, count, noise) for d, s, r in zip(done, swings, responses, strict=True)]
    whole = [f for f in shown if f is not None]
    if len(whole) < len(shown):
        return {}, len(shown) - len(whole)
    out = bounds.estimates(case.where, swings, rig, case.allocation == "priority")
    return out | _finer(case, whole, responses, rig, count, tick), 0


def _period(moves: list[Done]) -> float:
    t = moves[0].move.t
    return float(t[1] - t[0])


def _estimates(
    case: Case, r: Sequence[Response], gains: Mapping[str, Estimate], share: float, count: float, period: float
) -> dict[str, Estimate]:
    where = case.where

    def mean(name: str, unit: str, of: Callable[[Response], float]) -> Estimate:
        return _repeated(f"{name}/{where}", unit, [of(x) for x in r])

    slope = 1 / math.sqrt(np.mean([1 / x.slopes[0] ** 2 + 1 / x.slopes[1] ** 2 for x in r]))
    encoder = _bound(f"encoder/{where}", "encoder count", count / 2, "rad")
    sampling = _bound(f"sampling/{where}", "sampling", period / 2, "s")
    floor = _bound(f"noise/{where}", "noise in a peak", max(x.floor for x in r), "m")
    outboard = _gained(r, lambda x: x.towards, lambda x: x.peak, {"xo": 1.0, "yo": 1.0}, gains)
    at_rest = _gained(r, lambda x: x.towards, lambda x: x.rest_peak, {"xo": 1.0, "yo": 1.0}, gains)
    planes = {"xo": share, "yo": share, "xi": 1 - share, "yi": 1 - share}
    motor = _gained(r, lambda x: x.towards_motor, lambda x: x.peak_motor, planes, gains)
    out = {
        "rise_time": mean("rise_time", "s", lambda x: x.rise) + encoder * (1 / slope),
        "overshoot": mean("overshoot", "1", lambda x: x.overshoot) + encoder * (1 / case.size),
        "final_error": mean("final_error", "rad", lambda x: x.final_error) + encoder,
        "peak_outboard": mean("peak_outboard", "m", lambda x: x.peak) + outboard + floor,
        "peak_motor": mean("peak_motor", "m", lambda x: x.peak_motor) + motor + floor,
        "excess": mean("excess", "m", lambda x: x.peak - x.rest_peak) + outboard - at_rest + floor,
        "saturated": mean("saturated", "s", lambda x: x.saturated) + sampling,
    }
    if all(math.isfinite(x.settling) for x in r):
        out["settling_time"] = mean("settling_time", "s", lambda x: x.settling) + sampling
    return out


def _finer(
    case: Case, r: Sequence[Fine], still: Sequence[Response], rig: RigFile, count: float, tick: float
) -> dict[str, Estimate]:
    """With the influences that captures have."""
    where, machine, ways = case.where, conventions(rig), [x.forward for x in r]
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    gains = {axis: certified_gain(rig, channel) for axis, channel in machine.positions.items()}

    def mean(name: str, unit: str, of: Callable[[Fine], float]) -> Estimate:
        return _each_way(f"{name}/{where}", unit, [of(x) for x in r], ways)

    slope = 1 / math.sqrt(np.mean([1 / x.slopes[0] ** 2 + 1 / x.slopes[1] ** 2 for x in r]))
    between = _bound(f"edges/{where}", "encoder between its counts", BETWEEN * count, "rad")
    sampling = _bound(f"ticks/{where}", "sampling", tick / 2, "s")
    band = _bound(f"edges/settling/{where}", "encoder between its counts", max(x.settling_off for x in r), "s")
    noise = _lowered(f"raised/outboard/{where}", [x.raised for x in r])
    motor_noise = _lowered(f"raised/motor/{where}", [x.motor_raised for x in r])
    outboard = _gained(r, lambda x: x.towards, lambda x: x.peak, {"xo": 1.0, "yo": 1.0}, gains)
    rest = _each_way(f"standstill/{where}", "m", [x.rest_peak for x in still], ways)
    planes = {"xo": share, "yo": share, "xi": 1 - share, "yi": 1 - share}
    motor = _gained(r, lambda x: x.towards_motor, lambda x: x.peak_motor, planes, gains)
    return {
        "rise_time": mean("rise_time", "s", lambda x: x.rise) + sampling + between * (1 / slope),
        "overshoot": mean("overshoot", "1", lambda x: x.overshoot) + between * (1 / case.size),
        "settling_time": mean("settling_time", "s", lambda x: x.settling) + sampling + band,
        "saturated": mean("saturated", "s", lambda x: x.saturated) + sampling,
        "peak_outboard": mean("peak_outboard", "m", lambda x: x.peak) + outboard + noise,
        "peak_motor": mean("peak_motor", "m", lambda x: x.peak_motor) + motor + motor_noise,
        "excess": mean("excess", "m", lambda x: x.peak) + outboard - rest + noise,
    }


def _repeated(identity: str, unit: str, values: Sequence[float]) -> Estimate:
    """Mean of repeats with its Type A uncertainty."""
    u = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(len(values) - 1), source=f"{len(values)} steps")  # fmt: skip
    return Estimate.of(float(np.mean(values)), influence)


def _each_way(identity: str, unit: str, values: Sequence[float], ways: Sequence[bool]) -> Estimate:
    """Mean of repeats to and fro: both ways differ by what the machine is, and scatter is what steps of one way do."""
    parts = [np.array([v for v, w in zip(values, ways, strict=True) if w == way]) for way in (True, False)]
    parts = [p for p in parts if len(p)]
    dof = sum(len(p) - 1 for p in parts)
    pooled = math.sqrt(sum(float(((p - p.mean()) ** 2).sum()) for p in parts) / dof)
    u = pooled * math.sqrt(sum(1 / len(p) for p in parts)) / len(parts)
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(dof), source=f"{len(values)} steps, each way by itself")  # fmt: skip
    return Estimate.of(float(np.mean([p.mean() for p in parts])), influence)


def _bound(identity: str, name: str, half: float, unit: str) -> Estimate:
    """Zero, within a half width."""
    influence = Influence(
        id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B", distribution="rectangular"
    )
    return Estimate.of(0.0, influence)


def _lowered(identity: str, raised: Sequence[Raised]) -> Estimate:
    """What noise adds to the peaks of a case, taken off, m."""
    by, off = (float(np.mean(values)) for values in ([x.by for x in raised], [x.off for x in raised]))
    return _bound(identity, "noise in a peak", off, "m") - by


def _gained(
    r: Sequence[Moved], towards: Callable[[Moved], np.ndarray], peak: Callable[[Moved], float],
    share: Mapping[str, float], gains: Mapping[str, Estimate],
) -> Estimate:  # fmt: skip
    """Zero, with what the gains of the position sensors do to a peak: dr = -(x^2 dg_x + y^2 dg_y) / r for one plane.

    At the motor each plane's sensors act by the plane's share in the extrapolation, both planes being off by much the same.
    """
    out = Estimate.exact(0.0, "m")
    for sensor, part in share.items():
        axis = 0 if sensor[0] == "x" else 1
        weight = float(np.mean([peak(x) * towards(x)[axis] ** 2 for x in r]))
        gain = gains[sensor]
        out = out + (gain - gain.value) * (-weight * part / gain.value)
    return Estimate(out.value, "m", out.sensitivities)
