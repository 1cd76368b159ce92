"""The truth of an angle step while the motor carries: the same machine makes the same steps more often, seen exactly.

Noise and counts stay in what its controller reads: where the rotor stands before a step, within its encoder's count, is their
doing, and the truth is the mean over many steps of what the shaft itself does.
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
REPLICAS = 4  # of the run, each in noise of its own: a mean of steps that scatter is a truth only where they are many
ANSWERS = 0.5  # of its greatest: the torque current that answers a step
SWINGS_S, TAIL_S = 0.3, 0.3  # of a record: where the shaft is looked at closely at least, and where it stands again
CALM_S = 0.1  # within its band for so long, twice as long as a swing: then the angle has settled
TURNED_S, HELD_S = 0.12, 7.0  # as long as the checks before the motor carries
SEED = 20_000_001  # of noise that no run has; every rig has its own, for one that all share would be a bias of all
SEGMENTS = [TRACE.index(f"i_m{k}") for k in range(1, 5)]
LAW = {name: TRACE.index(name) for name in ("demand_x", "demand_y", "torque_given", "lambda")}


def seen_exactly(p: PlantParams) -> PlantParams:
    """With the motor's currents told as they are: nothing in the machine hears of that."""
    return dataclasses.replace(p, current_noise=0.0, current_lsb=0.0)


def angle_steps(rig: RigFile, drawn: Truth, asked: AngleAsked) -> Mapping[tuple[str, str], float]:
    """Means over the steps by quantity and case. Each step begins where the one before has left the angle and its integrator,
    so that the order is that of the run."""
    found: dict[tuple[str, str], list[float]] = {}
    paths: dict[str, list[_Path]] = {}
    for replica in range(REPLICAS):
        machine = _Carried(rig, drawn, asked, (drawn.noise + SEED * (1 + replica)) % 2**63)
        machine.begin(next(iter(asked.cases.values())))
        idle = iter(asked.idle)
        for where, case in asked.cases.items():
            for k in range(2 * asked.repeats):
                path, values = machine.moved(case, k, next(idle, 0.0))
                paths.setdefault(where, []).append(path)
                for name, value in values:
                    found.setdefault((name, where), []).append(value)
    true = {key: float(np.mean(values)) for key, values in found.items()}
    return true | {(name, where): value for where, p in paths.items() for name, value in _peaks(p)}


@dataclasses.dataclass(frozen=True)
class _Path:
    """The shaft of one step, `forward` or back: `planes` (2, 2, n) m from when the torque current answers, and its mean place
    before, `rest` (2, 2) m."""

    forward: bool
    planes: Array
    rest: Array


def _peaks(paths: list[_Path]) -> Iterator[tuple[str, float]]:
    """Of the mean path each way, as a mean over both ways: what the noise of one step does is none of the machine's."""
    ends = []
    for way in (True, False):
        of = [p for p in paths if p.forward is way]
        n = min(p.planes.shape[-1] for p in of)
        path, rest = np.mean([p.planes[..., :n] for p in of], axis=0), np.mean([p.rest for p in of], axis=0)
        ends.append((np.hypot(path[:, 0], path[:, 1]).max(axis=-1), np.hypot(rest[:, 0], rest[:, 1])))
    peaks, at_rest = np.mean(ends, axis=0)
    yield "peak_outboard", float(peaks[0])
    yield "excess", float(peaks[0] - at_rest[0])
    yield "peak_motor", float(peaks[1])


@dataclasses.dataclass(frozen=True)
class _Seen:
    """The true angle (n,) rad and displacement of two planes (2, 2, n) m of each tick, and the readings of each tick."""

    angle: Array
    planes: Array
    trace: Array


class _Carried:
    """The machine with the motor carrying, as it goes from step to step."""

    def __init__(self, rig: RigFile, drawn: Truth, asked: AngleAsked, seed: int) -> None:
        self.p, self.asked = drawn.plant, asked
        self.plant: Plant = drawn.machine.make(seen_exactly(drawn.plant), seed, 2)  # type: ignore[assignment]
        self._parameters = Parameters(rig, drawn, self.plant)
        self._write({**asked.settings})
        self.plant.mode = READY
        self.plant.run(1000)
        self.plant.mode = LIFT
        while not self.plant.moved:
            self.plant.run(100)
        self.plant.mode = LEVITATE
        self._write(asked.turned)  # released, and turned a little: what the angle's integrator has learned is gone
        self._wait(TURNED_S)
        for values, seconds in ((asked.holds, HELD_S), (asked.gains, 0.0), (asked.carries, asked.settle_s)):
            self._write(values)
            self._wait(seconds)

    def _write(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self._parameters.set(name, value, owner=True, resting=True)

    def _wait(self, seconds: float) -> None:
        self.plant.run(round(seconds / TICK_S))

    def begin(self, case: AngleCase) -> None:
        """A step each way that is not recorded, as the run begins."""
        self._write(case.settings)
        for target in (case.size, 0.0):
            self._write({self.asked.reference: target})
            self._wait(self.asked.standstill_s + self.asked.record_s)

    def moved(self, case: AngleCase, k: int, idle_s: float) -> tuple[_Path, list[tuple[str, float]]]:
        """One step, to the angle (even `k`) or back, after nothing was recorded for `idle_s`."""
        if k == 0:
            self._write(case.settings)
        self._wait(max(idle_s, self.asked.standstill_s if k == 0 else 0.0))
        rest = self._recorded(self.asked.standstill_s)
        way = 1 if k % 2 == 0 else -1
        target = case.size if way > 0 else 0.0
        self._write({self.asked.reference: target})
        after = self._swung(target, case.band)
        left = self.asked.record_s - len(after.trace) * TICK_S - TAIL_S
        self.plant.run(round(left / TICK_S))
        tail = self._standing(TAIL_S)
        torque = after.trace[:, SEGMENTS[:: 2 if self.p.phases == 6 else 1]].mean(axis=1)
        first = int(np.argmax(np.abs(torque) > ANSWERS * np.abs(torque).max()))
        values = list(_response(way * (after.angle - (target - way * case.size)), first, case))
        values.append(("final_error", way * (tail - target)))
        values.append(("saturated", _cut(after.trace, self.p.segment_limit, self.p.phases)))
        if self.p.phases == 6:
            values.append(("amplitude", self._amplitude(after.trace)))
        if case.bounded:
            values.append(("bound_excess", _beyond(after.trace, self.asked.limit)))
        return _Path(way > 0, after.planes[..., first:], rest.planes.mean(axis=-1)), values

    def _swung(self, target: float, band: float) -> _Seen:
        """Until the angle has been within the band for a while, SWINGS_S at least: a swing that goes on would have too short a
        time of settling."""
        pieces, most = [self._recorded(SWINGS_S)], self.asked.record_s - TAIL_S
        size = SWINGS_S + CALM_S
        while size < most and np.abs(pieces[-1].angle[-round(CALM_S / TICK_S) :] - target).max() > band:
            pieces.append(self._recorded(CALM_S))
            size += CALM_S
        return _Seen(
            np.concatenate([x.angle for x in pieces]),
            np.concatenate([x.planes for x in pieces], axis=-1),
            np.concatenate([x.trace for x in pieces]),
        )

    def _standing(self, seconds: float) -> float:
        """The mean angle, rad."""
        angles = []
        for _ in range(round(seconds / 0.01)):
            self.plant.run(round(0.01 / TICK_S))
            angles.append(self.plant.shaft()[5] + self.p.encoder_offset)
        return float(np.mean(angles))

    def _recorded(self, seconds: float) -> _Seen:
        """What the shaft does, from places and speeds every millisecond: it moves smoothly in between, but for what the
        derivative of the encoder's counts kicks it by, which a spline of its places alone would round off."""
        from scipy import interpolate

        states, trace = [self.plant.shaft()], []
        for _ in range(round(seconds / TICK_S / PERIOD_TICKS)):
            _, ticks = self.plant.run(PERIOD_TICKS, 1)
            states.append(self.plant.shaft())
            trace.append(ticks)
        whole = np.arange(len(states)) * PERIOD_TICKS
        places, speeds = np.array(states)[:, :6], np.array(states)[:, 6:12] * TICK_S
        s = interpolate.CubicHermiteSpline(whole, places, speeds)(np.arange(whole[-1])).T
        return _Seen(s[5] + self.p.encoder_offset, self._planes(s), np.concatenate(trace))

    def _planes(self, s: Array) -> Array:
        """(2, 2, n) m off the sensors' zero: x and y at the outboard sensor and at the motor, of places (6, n)."""
        p, at = self.p, []
        for b, z in enumerate(p.z_sensor):
            turn = np.arange(1, 5)[:, None] * s[5] + np.array(p.target_phase[4 * b : 4 * b + 4])[:, None]
            size = np.array(p.target[4 * b : 4 * b + 4])[:, None]
            zero = [p.position_offset[2 * b + k] / p.position_gain[2 * b + k] for k in (0, 1)]
            at.append(np.array([s[0] + z * s[4] + (size * np.cos(turn)).sum(axis=0) + zero[0],
                                s[1] - z * s[3] + (size * np.sin(turn)).sum(axis=0) + zero[1]]))  # fmt: skip
        share = (p.z_motor - p.z_sensor[0]) / (p.z_sensor[1] - p.z_sensor[0])
        return np.array([at[1], at[0] * (1 - share) + at[1] * share])

    def _amplitude(self, trace: Array) -> float:
        gain, offset = (np.array(x) for x in (self.p.segment_sense, self.p.segment_offset))
        true = (trace[:, SEGMENTS] - offset) / gain
        return float(np.hypot(true[:, ::2], true[:, 1::2]).max())


def _response(y: Array, first: int, case: AngleCase) -> Iterator[tuple[str, float]]:
    """`y` (n,) rad from where the reference stood, in the direction of the step; the torque current answers at `first`."""
    low, high = (_crossing(y, share * case.size) for share in (0.1, 0.9))
    yield "rise_time", (high - low) * TICK_S
    yield "overshoot", max(float(y.max()) / case.size - 1, 0.0)
    size = np.abs(y - case.size)
    outside = np.flatnonzero(size > case.band)
    k = int(outside[-1]) if len(outside) else first
    inside = len(outside) and k + 1 < len(size)  # else it is never outside, or still is at the end
    part = (size[k] - case.band) / (size[k] - size[k + 1]) if inside else float(len(outside) > 0)
    yield "settling_time", (k + float(part) - first) * TICK_S


def _crossing(y: Array, level: float) -> float:
    """The tick, and part of one, at which `y` first passes a level: steps that are alike would all be rounded alike."""
    k = max(int(np.argmax(y > level)), 1)
    return k - 1 + float((level - y[k - 1]) / (y[k] - y[k - 1]))


def _cut(trace: Array, limit: float, phases: int) -> float:
    """How long an amplifier has cut its current, s: by T (7.12) amplitudes of six phases, by T (6.19) of twelve. Samples of
    telemetry that a cut fell in, which this was, go by where in a sample the step comes, and are up to two too many."""
    x, y, torque = (np.abs(trace[:, LAW[name]]) for name in ("demand_x", "demand_y", "torque_given"))
    share = trace[:, LAW["lambda"]]
    most = np.hypot(torque + y, x) if phases == 6 else np.maximum(2 * share * torque + y, 2 * (1 - share) * torque + x)
    return float((most > limit * (1 + 1e-9)).sum()) * TICK_S


def _beyond(trace: Array, limit: float) -> float:
    """|i_theta| less T (7.18), put right, of what the law asks for."""
    x, y, torque = (trace[:, LAW[name]] for name in ("demand_x", "demand_y", "torque_given"))
    scale = np.minimum(1.0, limit / np.maximum(np.hypot(x, y), 1e-12))
    room = np.sqrt(np.maximum(limit**2 - (x * scale) ** 2, 0.0)) - np.abs(y * scale)
    return float((np.abs(torque) - np.maximum(room, 0.0)).max()) if math.isfinite(limit) else math.nan
