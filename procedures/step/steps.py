"""From the recorded set-point steps to arrays: the shaft along the axis, its tilt, the axis across, freed of what
turns with it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, SPEED, STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.onset import pushing
from procedures.step import acting, capturing
from procedures.step.acting import START_S, UNLIKE
from procedures.step.following import Push, by_distance
from procedures.step.held import asked_over_sent
from procedures.step.position import ends_of, made_of, shares
from procedures.step.requires import channels
from procedures.step.response import trailing

Array = npt.NDArray[np.float64]
STEP = "set-point"
ORDERS = (1, 2, 3, 4)  # per turn: unbalance and the runout of the journals
TURNING_RAD_S = 20.0
AT_REST_S = 6e-3  # what a position is averaged over where the shaft does not turn
EARLY_TICKS = (
    1.5  # a sample's last reading is one tick old, and stands for half a tick either way; the law acts at the next
)


@dataclass(frozen=True)
class Case:
    """Which setting of the controller, at which speed, along which axis, how far, and which way (1 up, -1 down)."""

    setting: str
    speed: float
    axis: str
    size: float
    way: int

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.group}, {self.size * 1e6:g} µm {'up' if self.way > 0 else 'down'}"

    @property
    def group(self) -> str:
        """The same without size and direction."""
        return f"{self.setting}, {self.axis}, {self.speed * 30 / math.pi:.0f} r/min"


@dataclass(frozen=True)
class Done:
    """One recorded step from the set point `begin` m. `t` s from where the set point acts (n,), with some samples before it;
    `y`, `tilt`, `across` m along the way of the step: from where they rested, what turns with the shaft taken away; `raw` as
    `y` with it; `rest` m the same before the step; `control` A, difference of the coils, both bearings; `answered`: it did;
    `kicks` A, of each bearing's at first. `noise` m of the mean over `samples`. The `machine`.
    `apart` s from the first to the last write of the step's set points; how `unlike` to that of a jump the answer is;
    `within` what of `t` the set points surely acted, s; they did `late_s` after t = 0, give or take `start_s`, and
    `start_noise` (a standard uncertainty) of each by itself."""

    case: Case
    begin: float
    t: Array
    y: Array
    raw: Array
    tilt: Array
    across: Array
    control: Array
    rest: Array
    noise: float
    samples: float
    synchronous: float
    slope: float
    answered: bool
    kicks: tuple[float, ...]
    speeds: tuple[float, float]
    flags: int
    stuck: tuple[str, ...]
    lost: int
    expected: int
    machine: AmbRotor
    apart: float = 0.0
    unlike: float = 0.0
    within: tuple[float, float] = (0.0, 0.0)
    late_s: float = 0.0
    start_s: float = START_S
    start_noise: float = 0.0


def read_steps(recording: Recording[Any]) -> list[Done]:
    """Every step, in time order.

    Raises:
        AnalysisError: there are none, or one holds too few samples.
    """
    read = [_read(recording, step) for step in recording.steps(STEP)]
    if not read:
        raise AnalysisError("found no set-point steps; expected those of the plan (was the run stopped early?)")
    out = [done for done, _ in read]
    groups = {
        group: iter(told(_started(of, [p for d, p in read if d.case.group == group])))
        for group, of in by_group(out).items()
    }
    return [next(groups[done.case.group]) for done in out]


def _started(steps: Sequence[Done], pushes: Sequence[Push]) -> list[Done]:
    """Steps of one group, each counted from where its set point acted."""
    found = acting.acted_together(pushes, [d.case.size for d in steps], by_distance=by_distance(steps[0].machine))
    return [
        replace(d, t=d.t - a.began, unlike=a.unlike, within=a.within, start_s=a.half, start_noise=a.noise)
        for d, a in zip(steps, found, strict=True)
    ]


def by_case(steps: list[Done]) -> dict[Case, list[Done]]:
    """Steps of each case, in order of first appearance."""
    out: dict[Case, list[Done]] = {}
    for done in steps:
        out.setdefault(done.case, []).append(done)
    return out


def by_group(steps: list[Done]) -> dict[str, list[Done]]:
    """Steps of one setting, axis and speed."""
    out: dict[str, list[Done]] = {}
    for done in steps:
        out.setdefault(done.case.group, []).append(done)
    return out


def unlike(steps: Sequence[Done]) -> float:
    """How unlike to that of a jump the currents' answer is: of the size of step that shows it most, over the jump."""
    return max(
        float(np.mean([d.unlike for d in steps if d.case.size == size])) for size in {d.case.size for d in steps}
    )


def told(steps: Sequence[Done]) -> list[Done]:
    """Steps of one group with how well their start is known: as the currents tell it, or by what is sure of those of a case in
    the mean."""
    if unlike(steps) <= UNLIKE:
        return list(steps)
    sure = {d.case: np.mean([e.within for e in steps if e.case == d.case], axis=0) for d in steps}
    return [
        replace(d, late_s=float(sure[d.case].mean()), start_s=float(np.ptp(sure[d.case])) / 2 + START_S) for d in steps
    ]


def _read(recording: Recording[Any], step: Step) -> tuple[Done, Push]:
    """With times from a tick and a half before those of its samples on, until it is known when the set point acted."""
    machine = conventions(recording.rig)
    data, labels = _whole(capturing.read(step, channels(recording.rig))), step.labels
    axis, signed = str(labels["axis"]), float(labels["step_m"])
    case = Case(str(labels["setting"]), float(labels["speed_rad_s"]), axis, abs(signed), 1 if signed > 0 else -1)
    written = [e["t_ns"] for e in recording.events("parameter")
               if e["name"] in machine.point(axis, 0.0) and step.start_ns <= e["t_ns"] < step.end_ns]  # fmt: skip
    if not written:
        raise AnalysisError(f"{case.where}: found no write of the set point within the step")
    rest = acting.still_at(data["t_ns"], made_of(data, shares(recording.rig, axis), len(data["t_ns"])), written[0])
    if rest.sum() < 50 or (~rest).sum() < 100:
        raise AnalysisError(f"{case.where}: found {int(rest.sum())} samples before the step and {int((~rest).sum())} after; "
                            "expected at least 50 and 100")  # fmt: skip
    done, push = _done(recording.rig, step, case, data, rest)
    return replace(done, apart=(written[-1] - written[0]) * 1e-9), push


def _whole(data: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Samples at every index: lost ones by straight lines, flags and angle by the sample before. How many were lost is told."""
    index = data["index"]
    if not len(index) or index[-1] - index[0] + 1 == len(index):
        return data
    every = np.arange(index[0], index[-1] + 1)
    held = np.searchsorted(index, every, "right") - 1
    out = {c: x[held] if c == STATUS else np.interp(every, index, x) for c, x in data.items()}
    out[ANGLE] = np.interp(every, index, np.unwrap(data[ANGLE]))
    out["t_ns"] = np.interp(every, index, data["t_ns"] - data["t_ns"][0]).round().astype(np.int64) + data["t_ns"][0]
    return out


def _done(
    rig: RigFile, step: Step, case: Case, data: Mapping[str, npt.NDArray[Any]], rest: npt.NDArray[np.bool_]
) -> tuple[Done, Push]:
    axis, other, machine = case.axis, {"y": "z", "z": "y", "x": "y"}[case.axis], conventions(rig)
    # in steps as they were asked for, each of which is what was sent: overshoot, band and error are about that
    of_sent = asked_over_sent(rig, axis, float(step.labels["begin_m"]), case.way * case.size)
    raw, across = (of_sent * made_of(data, shares(rig, one), len(rest)) for one in (axis, other))
    ends = [of_sent * made_of(data, of, len(rest)) for of in ends_of(rig, axis)]
    tilt = (ends[1] - ends[0]) / 2 if len(ends) > 1 else np.zeros(len(rest))
    ones = [pushing(machine, axis, a, data) for a in machine.along(axis)]
    control = sum(ones, np.zeros(len(rest)))
    t = (data["t_ns"] - data["t_ns"][0]) * 1e-9
    turning = float(np.median(data[SPEED])) > TURNING_RAD_S
    signals = np.array([raw, tilt, across, control, *ones])
    clean, amplitude = _still(t, signals, data[ANGLE], rest) if turning else (signals, np.zeros(len(signals)))
    clean = case.way * (clean - clean[:, rest].mean(axis=1, keepdims=True))
    first, answered = acting.answer(clean[4:], rest, acting.before_it_moves(clean[0], rest))
    period = float(np.median(np.diff(t)))
    samples = 2 * math.pi / float(np.median(data[SPEED])) / period if turning else AT_REST_S / period
    push = acting.pushed(
        rig, step, t, clean[3], clean[0] / case.size, first, origin_ns=int(data["t_ns"][0]), turning=turning
    )
    since = t - EARLY_TICKS * rig.devices["controller"].tick_s
    keep = slice(max(first - 20, 0), None)
    quiet = clean[0][rest]
    slope = float(np.polyfit(t[rest], quiet, 1)[0])
    level = quiet - slope * (t[rest] - t[rest].mean())
    flags = data[STATUS].astype(np.int64)
    done = Done(
        case, float(step.labels["begin_m"]), since[keep], clean[0][keep], (case.way * (raw - raw[rest].mean()))[keep],
        clean[1][keep], clean[2][keep], clean[3][keep], quiet,
        float(trailing(level, samples)[round(samples) :].std()), samples, float(amplitude[0]), slope, answered,
        acting.kicks(clean[4:], case.way * np.array(ends), rest, first),
        (float(data[SPEED].min()), float(data[SPEED].max())), int(np.bitwise_or.reduce(flags)),
        tuple(c for c in (*machine.all_positions, *machine.all_currents) if np.ptp(data[c]) == 0), step.lost(), step.expected(),
        machine,
    )  # fmt: skip
    return done, push


def _still(t: Array, signals: Array, angle: Array, rest: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Signals (k, n) without what turns with the shaft, and its first order's amplitude (k,): orders of the angle,
    fitted before
    the step and in the last third of the record, each with its own straight line."""
    phase = np.unwrap(angle)
    turning = [f(n * phase) for n in ORDERS for f in (np.cos, np.sin)]
    late = t > t[-1] - (t[-1] - t[rest][-1]) / 3
    lines = [m * c for m in (rest.astype(float), late.astype(float)) for c in (np.ones_like(t), t - t.mean())]
    a = np.array([*turning, *lines]).T
    used = rest | late
    found = np.linalg.lstsq(a[used], signals[:, used].T, rcond=None)[0]
    n = len(turning)
    return signals - (a[:, :n] @ found[:n]).T, np.hypot(found[0], found[1])


def cases(settings: tuple[str, ...], speeds: tuple[float, ...], axes: tuple[str, ...], sizes: tuple[float, ...]) -> Iterator[
    tuple[str, float, str, float]
]:  # fmt: skip
    """In the order in which they are done: small steps first, every setting at one speed before the next."""
    for speed in sorted(speeds):
        for setting in settings:
            for axis in axes:
                for size in sorted(sizes):
                    yield setting, speed, axis, size
