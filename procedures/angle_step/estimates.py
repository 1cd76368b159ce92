"""From the moves of an angle step to estimates with influences: scatter of the repeats, sensors, sampling, encoder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.angle_step import captured, counted, steps
from procedures.angle_step.budget import OUTBOARD, at_motor, gained, placed, within
from procedures.angle_step.response import Excursion, Response, response
from procedures.angle_step.steps import Case, Done
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_gain


@dataclass(frozen=True)
class Result:
    """Responses of the moves of one case, and the mean of each quantity with its influences; no settling time where the angle
    does not settle. How many captures are `short`: they end before their step does."""

    case: Case
    responses: tuple[Response, ...]
    estimates: Mapping[str, Estimate]
    short: int = 0


def by_case(moves: list[Done], rig: RigFile, band: float, count_rad: float, kp: float) -> dict[Case, Result]:
    """Every case's result; `band` is a share of the step, `count_rad` one encoder count, `kp` A/rad of the angle's loop.

    Raises:
        AnalysisError: a move does not reach its step.
    """
    machine = conventions(rig)
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    gains = {axis: certified_gain(rig, channel) for axis, channel in machine.positions.items()}
    period = _period(moves)
    tick = rig.devices["controller"].tick_s
    bands = {case: max(band * case.size, 2 * count_rad) for case in steps.by_case(moves)}
    responses = {c: tuple(response(d.move, bands[c]) for d in done) for c, done in steps.by_case(moves).items()}
    finer, short = captured.by_case(moves, responses, rig, bands, count_rad, kp)
    out = {}
    for case, done in steps.by_case(moves).items():
        r = responses[case]
        found = _estimates(case, r, gains, share, count_rad, period, tick)
        grows = float(np.mean([x.motor.peak for x in r])) / share  # the inboard plane is held
        found["peak_motor"] = found["peak_motor"] + placed(rig, machine, grows)
        if all(math.isfinite(x.settling) for x in r) and case not in finer:
            found["settling_time"] = counted.settling_time(case.where, done, bands[case], count_rad)
        out[case] = Result(case, r, found | finer.get(case, {}), short.get(case, 0))
    return out


def _period(moves: list[Done]) -> float:
    t = moves[0].move.t
    return float(t[1] - t[0])


def _estimates(
    case: Case, r: Sequence[Response], gains: Mapping[str, Estimate], share: float, count: float, period: float, tick: float
) -> dict[str, Estimate]:  # fmt: skip
    where = case.where

    def mean(name: str, unit: str, of: Callable[[Response], float]) -> Estimate:
        return _repeated(f"{name}/{where}", unit, [of(x) for x in r])

    slope = 1 / math.sqrt(np.mean([1 / x.slopes[0] ** 2 + 1 / x.slopes[1] ** 2 for x in r]))
    encoder = within(f"encoder/{where}", "encoder count", count / 2, "rad")
    outboard, motor = [x.outboard for x in r], [x.motor for x in r]
    sensed = gained([(x.peak, x.towards) for x in outboard], OUTBOARD, gains)
    at_rest = gained([(x.away, x.rest / max(x.away, 1e-300)) for x in outboard], OUTBOARD, gains)
    at_outboard = sensed + _raised(f"outboard/{where}", outboard)
    return {
        "rise_time": mean("rise_time", "s", lambda x: x.rise) + encoder * (1 / slope),
        "overshoot": mean("overshoot", "1", lambda x: x.overshoot) + encoder * (1 / case.size),
        "final_error": mean("final_error", "rad", lambda x: x.final_error) + encoder,
        "peak_outboard": mean("peak_outboard", "m", lambda x: x.outboard.peak) + at_outboard,
        "peak_motor": mean("peak_motor", "m", lambda x: x.motor.peak) + _raised(f"motor/{where}", motor)
        + gained([(x.peak, x.towards) for x in motor], at_motor(share), gains),
        "excess": mean("excess", "m", lambda x: x.outboard.peak - x.outboard.away) + at_outboard - at_rest,
        "saturated": _cut(where, mean("saturated", "s", lambda x: x.saturated), period, tick),
    }  # fmt: skip


def _raised(identity: str, found: Sequence[Excursion]) -> Estimate:
    """What peaks of means are off, m: noise raises them by its floor at most, and a curve of more samples says otherwise."""
    floor, otherwise = (float(np.mean(values)) for values in ([x.floor for x in found], [x.otherwise for x in found]))
    noise = within(f"noise/{identity}", "noise in a peak", floor / 2, "m")
    return noise - floor / 2 + within(f"noise/shape/{identity}", "shape of a peak between samples", otherwise, "m")


def _cut(where: str, samples: Estimate, period: float, tick: float) -> Estimate:
    """How long an amplifier cut, s, of the samples that a cut fell in: each holds a `tick` of it at least, and all of its own
    at most. With a filter of 1 kHz the derivative cuts from count to count."""
    least = tick / period
    open_to = within(f"sampling/cut/{where}", "how much of a sample was cut", (1 - least) / 2 * samples.value, "s")
    return samples * ((1 + least) / 2) + open_to + within(f"sampling/each/{where}", "sampling", tick / 2, "s")


def _repeated(identity: str, unit: str, values: Sequence[float]) -> Estimate:
    """Mean of repeats with its Type A uncertainty."""
    u = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(len(values) - 1), source=f"{len(values)} steps")  # fmt: skip
    return Estimate.of(float(np.mean(values)), influence)
