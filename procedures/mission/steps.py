"""Labels of what is recorded, and from a recording to arrays: captures with their moves, what the controller's state was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.mission.plan import Plan
from procedures.position_loops.movers import motion, radial

Array = npt.NDArray[np.float64]
TURN, LIFT, MOVE = "turn", "lift", "move"
PLACES = 2


def captured(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Channels of a capture."""
    at = motion(rig)
    return (*radial(rig).values(), at.place_channel, at.angle_channel, *(at.currents if plan.currents else ()))


@dataclass(frozen=True)
class Piece:
    """A capture: `t` (n,) s since the recording began, columns (n,) SI by channel."""

    t: Array
    columns: Mapping[str, Array]

    def cut(self, begin: float, end: float) -> slice:
        """Its samples between two times."""
        return slice(*(int(k) for k in np.searchsorted(self.t, (begin, end))))


@dataclass(frozen=True)
class Move:
    """A move to place and angle `there` (1) or back (0), of a repeat: commanded at `begin`, over at `end`, s."""

    repeat: int
    there: int
    begin: float
    end: float


def holds(piece: Piece, move: Move) -> bool:
    """Whether a capture has a move from its command to its end."""
    return bool(len(piece.t)) and piece.t[0] <= move.begin and move.end <= piece.t[-1] + 1e-3


@dataclass(frozen=True)
class Flight:
    """What was recorded: `lift` and `pieces` are captures, `states` what the controller said, name by name with the time of the
    first sample of each, `telemetry` the radial readings, place and angle, with `t` s."""

    lift: Piece | None
    pieces: Sequence[Piece]
    moves: Sequence[Move]
    states: Sequence[tuple[str, float]]
    telemetry: Mapping[str, Array]

    def since(self, mode: str) -> float | None:
        """When the controller was first in a state that amounts to `mode`."""
        return next((t for name, t in self.states if name == mode), None)


def read(recording: Recording[Plan]) -> Flight:
    """The whole flight."""
    rig = recording.rig
    lifts = [_piece(c.arrays()) for c in recording.captures(part=LIFT)]
    pieces = [_piece(c.arrays()) for c in recording.captures(part=MOVE)]
    told = _telemetry(recording, (*radial(rig).values(), motion(rig).place_channel, motion(rig).angle_channel, STATE))
    zero = recording.start_ns
    moves = [
        Move(int(s.labels["repeat"]), int(s.labels["there"]), 1e-9 * (s.start_ns - zero), 1e-9 * (s.end_ns - zero))
        for s in recording.steps(MOVE)
    ]
    return Flight(lifts[0] if lifts else None, pieces, moves, list(_states(rig, told)), told)


def _telemetry(recording: Recording[Plan], channels: tuple[str, ...]) -> dict[str, Array]:
    data = recording.read(channels, 0, 1 << 62)
    out = {name: np.asarray(data[name], np.float64) for name in channels}
    return out | {"t": (data["t_ns"] - recording.start_ns) * 1e-9}


def _piece(arrays: Mapping[str, Array]) -> Piece:
    return Piece(arrays["t_s"], {k: v for k, v in arrays.items() if k not in ("t_s", "t_ns", "tick")})


def _states(rig: RigFile, told: Mapping[str, Array]) -> Iterator[tuple[str, float]]:
    """Modes one after the other, each with the time at which it was first seen."""
    codes, names = told[STATE].astype(np.int64), rig.choices(STATE)
    for k in np.flatnonzero(np.diff(codes, prepend=codes[:1] - 1)):
        name = names.get(int(codes[k]), "")
        yield rig.binding.mode(name) or name, float(told["t"][k])
