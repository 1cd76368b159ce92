"""From the recorded moves of an angle step to arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.angle_step.bounds import Swing, read_swing
from procedures.angle_step.requires import channels, positions
from procedures.angle_step.response import Move
from procedures.servomotor.conventions import Servomotor, conventions, displacement
from procedures.servomotor.parameters import parameter

Array = npt.NDArray[np.float64]
STEP = "move"
ANSWERS = 0.5  # of its greatest: the torque current that answers a step
ANSWER_A = 0.2  # of torque current: well above its noise, a twentieth of the smallest sensible step's


@dataclass(frozen=True)
class Case:
    """What was done: how segment currents are made, the size of the step in rad, the filter of the derivative in Hz."""

    allocation: str
    size: float
    filter_hz: float

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.allocation}, {np.degrees(self.size):g}°, {self.filter_hz:g} Hz"


@dataclass(frozen=True)
class Done:
    """One recorded move: its case, the move, its flags ORed, the channels that stood still, lost samples, and what was captured
    of its currents, if anything was."""

    case: Case
    move: Move
    flags: int
    rest_flags: int
    stuck: tuple[str, ...]
    lost: int
    expected: int
    swing: Swing | None = None
    target: float = 0.0  # rad, of the angle


def read_moves(recording: Recording[Any]) -> list[Done]:
    """Every move, in time order.

    Raises:
        AnalysisError: there are none, or one does not show its step.
    """
    machine, rig = conventions(recording.rig), recording.rig
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    out = [_read(recording, step, machine, share) for step in recording.steps(STEP)]
    if not out:
        raise AnalysisError("found no moves; expected those of the plan (was the run stopped early?)")
    return out


def by_case(moves: list[Done]) -> Mapping[Case, list[Done]]:
    """Moves of each case, in order of first appearance."""
    out: dict[Case, list[Done]] = {}
    for done in moves:
        out.setdefault(done.case, []).append(done)
    return out


def readings_of(moves: list[Done]) -> list[Array]:
    """Angles as the encoder tells them, rad, by steps: captured, or telemetry that is no mean."""
    found = [(d.swing.angle if d.swing is not None else None, d.move) for d in moves]
    return [a if a is not None else m.angle for a, m in found if a is not None or not m.means]


def _read(recording: Recording[Any], step: Step, machine: Servomotor, share: float) -> Done:
    data, reference = step.read(*channels(machine)), parameter(recording.rig, "angle.ref")
    written = [e["t_ns"] for e in recording.events("parameter")
               if e["name"] == reference and step.start_ns <= e["t_ns"] < step.end_ns]  # fmt: skip
    if not written:
        raise AnalysisError(f"move {dict(step.labels)}: found no write of the angle's reference within it")
    rest = standing(data["t_ns"], _torque(data, machine), written[-1])
    if rest.sum() < 20 or (~rest).sum() < 100:
        raise AnalysisError(f"move {dict(step.labels)}: found {int(rest.sum())} samples before it and "
                            f"{int((~rest).sum())} after; expected at least 20 and 100")  # fmt: skip
    labels = step.labels
    case = Case(str(labels["allocation"]), float(labels["size_rad"]), float(labels["filter_hz"]))
    flags = data[STATUS].astype(np.int64)
    return Done(
        case,
        _move(data, rest, labels, machine, share, recording.rig.binding.samples == "mean"),
        int(np.bitwise_or.reduce(flags[~rest])),
        int(np.bitwise_or.reduce(flags[rest])),
        tuple(c for c in (*positions(machine), *machine.segments) if np.ptp(data[c]) == 0),
        step.lost(),
        step.expected(),
        read_swing(recording, labels.get("number")),
        float(labels["target_rad"]),
    )


def standing(t_ns: npt.NDArray[np.int64], torque: Array, written_ns: int) -> npt.NDArray[np.bool_]:
    """Which samples (n,) are of the standstill before a step, by the host's time `written_ns` of the reference's write and the
    torque current (n,) A.

    Sample times are the device's ticks with one offset. A device that falls behind the host's clock has answered by its own
    samples before the host wrote: there the standstill ends with the answer, which is beyond half of what the step takes.
    """
    rest: npt.NDArray[np.bool_] = t_ns < written_ns
    size = np.abs(torque - np.median(torque))
    loud = int(np.argmax(size > ANSWERS * size.max()))
    if not rest[loud] or size[loud] <= ANSWER_A:
        return rest
    first = loud - 1 if loud and size[loud - 1] > ANSWER_A else loud  # a mean may hold a part of the answer
    return np.arange(len(rest)) < first


def _torque(data: Mapping[str, npt.NDArray[Any]], machine: Servomotor) -> Array:
    """The torque current (n,) A, as its sensors read."""
    mean: Array = np.array([data[c] for c in machine.segments])[:: machine.components].mean(axis=0)
    return mean


def _move(
    data: Mapping[str, npt.NDArray[Any]], rest: npt.NDArray[np.bool_], labels: Mapping[str, Any], machine: Servomotor,
    share: float, means: bool,
) -> Move:  # fmt: skip
    step = float(labels["step_rad"])
    segments = np.array([data[c] for c in machine.segments])
    torque = _torque(data, machine)
    level = float(torque[rest].mean())
    answers = np.flatnonzero(~rest & (np.abs(torque - level) > ANSWER_A))
    if not len(answers):
        raise AnalysisError(f"a step of {np.degrees(step):.2f} deg: the torque current never answers")
    first = max(int(answers[0]) - 1, int(np.flatnonzero(~rest)[0]))
    after = slice(first, None)
    angle = np.unwrap(data[ANGLE]) - (float(labels["target_rad"]) - step)
    angle -= 2 * np.pi * np.round(angle[rest].mean() / (2 * np.pi))
    inboard, outboard = (np.array([data[c] for c in machine.positions_of(f"x{b}", f"y{b}")]) for b in "io")
    motor = displacement(inboard, outboard, share)
    return Move(
        step=step,
        t=(data["t_ns"][after] - data["t_ns"][first]).astype(np.float64) * 1e-9,
        angle=angle[after],
        orbit=outboard[:, after],
        motor=motor[:, after],
        segments=segments[:, after],
        saturated=(data[STATUS][after].astype(np.int64) & machine.segment_limit) != 0,
        rest_orbit=outboard[:, rest],
        rest_motor=motor[:, rest],
        rest_segments=segments[:, rest],
        components=machine.components,
        rest_angle=angle[rest],
        means=means,
    )


def cases(steps: Mapping[str, tuple[float, ...]], filters: tuple[float, ...]) -> Iterator[Case]:
    """Steps by allocation, in the order in which they are done: small ones first."""
    for filter_hz in filters:
        for size in sorted({size for sizes in steps.values() for size in sizes}):
            yield from (Case(allocation, size, filter_hz) for allocation, sizes in steps.items() if size in sizes)
