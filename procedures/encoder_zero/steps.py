"""Labels of what is recorded, and from a recording to the answers of currents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.encoder_zero.groups import ALONG, Group, captured, groups, loop_of
from procedures.encoder_zero.plan import Plan

Array = npt.NDArray[np.float64]
STEP = "hold"


@dataclass(frozen=True)
class Taken:
    """A current of one sign, `asked` A: means (channels,) over the window, and over each half of it (2, channels), of the
    mover's reading and of i_d and i_q of each motor; None where it was not captured. `noise` (channels,) are their standard
    deviations. `limited`: share of the telemetry at the loop's limit."""

    loop: str
    place: int
    trial: str
    motor: str
    way: str
    repeat: int
    sign: int
    asked: float
    means: Array | None
    halves: Array
    noise: Array
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        trial = f", zero of {self.trial} changed" if self.trial else ""
        return f"{self.motor}, {self.way}, place {self.place + 1}, repeat {self.repeat + 1}{trial}"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """All of them, in time order."""
    of = {g.loop: g for g in groups(recording.rig, recording.plan)}
    return [_read(recording, step, of[str(step.labels["loop"])]) for step in recording.steps(STEP)]


def _read(recording: Recording[Plan], step: Step, group: Group) -> Taken:
    rig, labels = recording.rig, step.labels
    bit, names = loop_of(rig, group.loop).limited, rig.choices(STATE)
    told = step.read(STATE, *([bit.channel] if bit is not None else []))
    limited = 0.0
    if bit is not None and len(told[STATE]):
        flags = told[bit.channel].astype(np.int64)
        limited = float(np.mean(flags != 0 if bit.mask is None else flags & bit.mask != 0))
    found = recording.captures(number=labels["number"])
    means, halves, noise = None, np.empty((2, 0)), np.empty(0)
    if found and found[0].samples >= 2:
        columns = found[0].arrays(*captured(rig, group))
        x = np.array([columns[name] for name in captured(rig, group)])
        means, half = x.mean(axis=1), x.shape[1] // 2
        halves, noise = np.array([x[:, :half].mean(axis=1), x[:, half:].mean(axis=1)]), x.std(axis=1)
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(told[STATE]))
    return Taken(
        group.loop, int(labels["place"]), str(labels["trial"]), str(labels["motor"]), str(labels["way"]), int(labels["repeat"]),
        int(labels["sign"]), float(labels["current_A"]), means, halves, noise, limited, states, step.lost(), step.expected(),
    )  # fmt: skip


@dataclass(frozen=True)
class Answers:
    """Of a group at a place: `pairs` (repeats, currents, channels), half of what + shows less what - shows, of the mover's
    reading and of i_d and i_q of each motor; `halves` alike (2, repeats, currents, channels) of each half of the windows.
    `reading` is the mover's mean, `noise` (channels,) standard deviations in a window."""

    group: Group
    place: int
    trial: str
    pairs: Array
    halves: Array
    reading: float
    noise: Array

    @property
    def rows(self) -> Array:
        """Answers (repeats, currents, 2 n) of the currents alone."""
        return self.pairs[:, :, 1:]


def answers(taken: Sequence[Taken], group: Group, place: int, trial: str = "") -> Answers | None:
    """Of whole pairs; None where there are none of some current."""
    some = [t for t in taken if (t.loop, t.place, t.trial) == (group.loop, place, trial) and t.means is not None]
    by = {(t.motor, t.way, t.repeat, t.sign): t for t in some}
    repeats = sorted({r for *_, r, _ in by if all((m, w, r, s) in by for m, w in group.stepped for s in (1, -1))})
    if not repeats:
        return None
    whole = [[(by[m, w, r, 1], by[m, w, r, -1]) for m, w in group.stepped] for r in repeats]
    pairs = np.array([[(a.means - b.means) / 2 for a, b in row] for row in whole])  # type: ignore[operator]
    halves = np.array([[[(a.halves[k] - b.halves[k]) / 2 for a, b in row] for row in whole] for k in (0, 1)])
    reading = float(np.mean([t.means[0] for t in some if t.means is not None]))
    return Answers(group, place, trial, pairs, halves, reading, np.mean([t.noise for t in some], axis=0))


def column(group: Group, motor: str, way: str) -> int:
    """Of a motor's current among the channels of a group."""
    return 1 + 2 * group.motors.index(motor) + (0 if way == ALONG else 1)
