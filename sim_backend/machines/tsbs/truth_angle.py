"""The truth of an angle step while the motor carries: the same machine makes the same steps more often, read exactly.

The encoder's counts stay, for the controller knows no other angle: what they make of each step is what repeats scatter by, and
the truth is the mean over many.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.controller.parameters import Parameters
from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.core.plant import PERIOD_TICKS, TICK_S
from sim_backend.machine import Truth
from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import TRACE, Plant
from sim_backend.motion import AngleAsked, AngleCase

Array = npt.NDArray[np.float64]
REPEATS = 10  # each way
SEGMENT_SATURATED = 2
ANSWER_A = 0.2
POSITIONS = [TRACE.index(f"pos_{axis}{end}") for end in "io" for axis in "xy"]
SEGMENTS = [TRACE.index(f"i_m{k}") for k in range(1, 5)]
LAW = {name: TRACE.index(name) for name in ("demand_x", "demand_y", "torque_given")}


def quiet(p: PlantParams) -> PlantParams:
    """Without noise and rounding, but for the encoder's."""
    return dataclasses.replace(p, position_noise=0.0, current_noise=0.0, position_lsb=0.0, current_lsb=0.0)


def angle_steps(rig: RigFile, drawn: Truth, asked: AngleAsked) -> Mapping[tuple[str, str], float]:
    """Means over the steps by quantity and case."""
    machine = _Carried(rig, drawn, asked)
    out: dict[tuple[str, str], float] = {}
    for where, case in asked.cases.items():
        found = [dict(machine.moved(case, k)) for k in range(2 * REPEATS)]
        out |= {(name, where): float(np.mean([f[name] for f in found])) for name in found[0]}
    return out


class _Carried:
    """The machine with the motor carrying, as it goes from step to step."""

    def __init__(self, rig: RigFile, drawn: Truth, asked: AngleAsked) -> None:
        self.p, self.asked = drawn.plant, asked
        self.plant: Plant = drawn.machine.make(quiet(drawn.plant), 1, 2)  # type: ignore[assignment]
        self._parameters = Parameters(rig, drawn, self.plant)
        self._write({**asked.settings})
        self.plant.mode = READY
        self.plant.run(1000)
        self.plant.mode = LIFT
        while not self.plant.moved:
            self.plant.run(100)
        self.plant.mode = LEVITATE
        self.plant.run(5000)
        self._write(asked.carries)
        self._wait(asked.settle_s)

    def _write(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self._parameters.set(name, value, owner=True, resting=True)

    def _wait(self, seconds: float) -> None:
        self.plant.run(round(seconds / TICK_S))

    def moved(self, case: AngleCase, k: int) -> Iterator[tuple[str, float]]:
        """One step, to the angle (even `k`) or back."""
        if k == 0:
            self._write(case.settings)
            self._wait(self.asked.standstill_s)
        rest = self.plant.run(round(self.asked.standstill_s / TICK_S), 1)[1]
        way = 1 if k % 2 == 0 else -1
        target = case.size if way > 0 else 0.0
        self._write({self.asked.reference: target})
        angle, flags, trace = self._recorded()
        torque = trace[:, SEGMENTS[:: 2 if self.p.phases == 6 else 1]].mean(axis=1)
        standing = rest[:, SEGMENTS[:: 2 if self.p.phases == 6 else 1]].mean()
        first = int(np.argmax(np.abs(torque - standing) > ANSWER_A))
        yield from _response(way * (angle - (target - way * case.size)), first, case)
        tail = angle[-round(0.3 / TICK_S) :]
        yield "final_error", float((tail - target).mean())
        yield from self._excursion(rest, trace)
        yield "saturated", float((flags & SEGMENT_SATURATED != 0).sum()) * PERIOD_TICKS * TICK_S
        if self.p.phases == 6:
            yield "amplitude", self._amplitude(trace)
        if case.bounded:
            yield "bound_excess", _beyond(trace, self.asked.limit)

    def _recorded(self) -> tuple[Array, npt.NDArray[np.int64], Array]:
        """The true angle of each tick, the flags of each sample of telemetry, and the readings of each tick."""
        ends, rows, trace = [self.plant.state()["s"][5]], [], []
        for _ in range(round(self.asked.record_s / TICK_S / PERIOD_TICKS)):
            row, ticks = self.plant.run(PERIOD_TICKS, 1)
            ends.append(self.plant.state()["s"][5])
            rows.append(row)
            trace.append(ticks)
        from scipy import interpolate

        whole = np.arange(len(ends)) * PERIOD_TICKS
        angle = interpolate.CubicSpline(whole, np.array(ends) + self.p.encoder_offset)(np.arange(whole[-1]))
        return angle, np.concatenate(rows)[:, -1].astype(np.int64), np.concatenate(trace)

    def _excursion(self, rest: Array, trace: Array) -> Iterator[tuple[str, float]]:
        p, gains = self.p, np.array(self.p.position_gain[:4])
        share = (p.z_motor - p.z_sensor[0]) / (p.z_sensor[1] - p.z_sensor[0])
        before, after = (x[:, POSITIONS] / gains for x in (rest, trace))
        peak, at_rest = (float(np.hypot(x[:, 2], x[:, 3]).max()) for x in (after, before))
        motor = after[:, :2] * (1 - share) + after[:, 2:] * share
        yield from (
            ("peak_outboard", peak),
            ("excess", peak - at_rest),
            ("peak_motor", float(np.hypot(*motor.T).max())),
        )

    def _amplitude(self, trace: Array) -> float:
        gain, offset = (np.array(x) for x in (self.p.segment_sense, self.p.segment_offset))
        true = (trace[:, SEGMENTS] - offset) / gain
        return float(np.hypot(true[:, ::2], true[:, 1::2]).max())


def _response(y: Array, first: int, case: AngleCase) -> Iterator[tuple[str, float]]:
    """`y` (n,) rad from where the reference stood, in the direction of the step; the torque current answers at `first`."""
    low, high = (int(np.argmax(y > share * case.size)) for share in (0.1, 0.9))
    yield "rise_time", (high - low) * TICK_S
    yield "overshoot", max(float(y.max()) / case.size - 1, 0.0)
    outside = np.flatnonzero(np.abs(y - case.size) > case.band)
    yield "settling_time", (float(outside[-1]) + 1 - first) * TICK_S if len(outside) else 0.0


def _beyond(trace: Array, limit: float) -> float:
    """|i_theta| less T (7.18), put right, of what the law asks for."""
    x, y, torque = (trace[:, LAW[name]] for name in ("demand_x", "demand_y", "torque_given"))
    scale = np.minimum(1.0, limit / np.maximum(np.hypot(x, y), 1e-12))
    room = np.sqrt(np.maximum(limit**2 - (x * scale) ** 2, 0.0)) - np.abs(y * scale)
    return float((np.abs(torque) - np.maximum(room, 0.0)).max()) if math.isfinite(limit) else math.nan
