"""From the recorded turns of the circle to means by its phase."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.requires import channels, positions
from procedures.servomotor.conventions import LOADS, PHASE, conventions

LOADS_SEEN, FACTS_SEEN = "from the loads", "from the facts"

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
STEP, BEFORE, AFTER = "circle", "before", "after"
FEWEST = 100  # bins of a turn: a parabola through two of them to either side of a peak is within 7.2 degrees of it


@dataclass(frozen=True)
class Around:
    """The turns of one step. By turn and by bins of the circle's phase: `segments` (turns, bins, 4) A as their sensors read,
    `path` (turns, bins) m, horizontal + j up, at the outboard sensors, and its `distance` from their zero (a chord is nearer
    than its arc, by 1 nm in 10 ms); with balancing, from the capture, `gamma` (turns, bins) rad, `observed` (turns, bins) N,
    the load as the controller has it, and `fastest` rad/s, of the phase angle. Then how far the rotor `turned` within the step,
    rad, its flags ORed, what stood still, and how many bins are `unheld`: no turn has a sample there, and they are NaN."""

    when: str
    way: str
    repeat: int
    segments: Array
    path: Complex
    distance: Array
    gamma: Array | None
    observed: Complex | None
    fastest: float
    turned: float
    flags: int
    stuck: tuple[str, ...]
    unheld: int

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return place(self.when, self.way, self.repeat)

    @property
    def branch(self) -> int:
        """The sign of i_x while i_y lifts."""
        i = mean_currents(self.segments.reshape(-1, 4))
        return 1 if float((i.real * i.imag).mean()) > 0 else -1


def mean_currents(segments: Array) -> Complex:
    """i_x + j i_y (n,) A of segments (n, 4), T (6.18)."""
    return (segments[..., 3] - segments[..., 1]) / 2 + 1j * (segments[..., 0] - segments[..., 2]) / 2


def place(when: str, way: str, repeat: int) -> str:
    """How a step is named to the reader."""
    return f"{when}, {way}, {repeat + 1}"


def bins(plan: Plan) -> int:
    """In how many parts a turn is looked at."""
    return max(round(plan.turn_s / plan.bin_s), FEWEST)


def read_around(recording: Recording[Plan]) -> list[Around]:
    """Every step, in time order.

    Raises:
        AnalysisError: there are none, or one lacks its capture or nearly all of its samples.
    """
    out = [_read(recording, step) for step in recording.steps(STEP)]
    if not out:
        raise AnalysisError("found no turns; expected those of the plan (was the run stopped early?)")
    return out


def of_way(around: Sequence[Around], way: str, when: str) -> list[Around]:
    """Those of one way round, by repeat."""
    return [a for a in around if (a.way, a.when) == (way, when)]


def _read(recording: Recording[Plan], step: Step) -> Around:
    plan, machine, labels = recording.plan, conventions(recording.rig), step.labels
    hz = plan.circle_hz * (1 if labels["way"] == "forward" else -1)
    data = step.read(*channels(machine))
    if len(data["t_ns"]) < 10 * plan.turns:
        raise AnalysisError(
            f"step {dict(labels)}: found {len(data['t_ns'])} samples; expected {10 * plan.turns} or more"
        )
    x, y = (data[c] for c in positions(machine))
    read = (*(data[c] for c in machine.segments), x, y, np.hypot(x, y))
    t = (data["t_ns"] - step.start_ns) * 1e-9
    zero = float(np.angle(((x + 1j * y) * np.exp(-2j * math.pi * hz * t)).mean()))
    folded = fold(t, np.array(read), zero, hz, plan)
    gamma = observed = None
    fastest = 0.0
    if labels["when"] == AFTER:
        gamma, observed, fastest = _captured(recording, step, zero, hz)
    flags = data[STATUS].astype(np.int64)
    return Around(
        str(labels["when"]), str(labels["way"]), int(labels["repeat"]), folded[..., :4], folded[..., 4] + 1j * folded[..., 5],
        folded[..., 6], gamma, observed, fastest, float(np.ptp(np.unwrap(data[ANGLE]))),
        int(np.bitwise_or.reduce(flags)),
        tuple(c for c in (*positions(machine), *machine.segments) if np.ptp(data[c]) == 0),
        max(_unheld(x) for x in (folded[..., 0], gamma) if x is not None),
    )  # fmt: skip


def _captured(recording: Recording[Plan], step: Step, zero: float, hz: float) -> tuple[Array, Complex, float]:
    found = recording.captures(way=step.labels["way"], repeat=step.labels["repeat"])
    if not found:
        raise AnalysisError(f"step {dict(step.labels)}: found no capture")
    data = found[0].arrays(PHASE, *LOADS)
    read = np.array([data[c] for c in (PHASE, *LOADS)])
    t = (data["t_ns"] - step.start_ns) * 1e-9
    folded = fold(t, read, zero, hz, recording.plan)
    fastest = float(np.abs(np.diff(read[0])).max()) * found[0].rate_hz
    return folded[..., 0], folded[..., 1] + 1j * folded[..., 2], fastest


def fold(t: Array, read: Array, zero: float, hz: float, plan: Plan) -> Array:
    """(turns, bins, channels): means of `read` (channels, n) at `t` s by the phase zero + 2 pi hz t of the circle.

    A bin of a turn that lost all its samples has the mean of the other turns there: a gap of 1e-3 of three turns is a bin or
    two, and the scatter of a peak, which has 17 of each turn, comes out about 1 % too small. Where no turn has any it is NaN.
    """
    count = bins(plan)
    turn = np.minimum(((t - t[0]) * abs(hz)).astype(int), plan.turns)
    part = np.floor((zero / (2 * math.pi) + hz * t) % 1.0 * count).astype(int) % count
    key, kept = turn * count + part, turn < plan.turns
    size = plan.turns * count
    number = np.bincount(key[kept], minlength=size)
    sums = [np.bincount(key[kept], row[kept], minlength=size) for row in read]
    with np.errstate(invalid="ignore"):
        means = (np.stack(sums, axis=-1) / number[:, None]).reshape(plan.turns, count, len(read))
        missing = (number == 0).reshape(plan.turns, count, 1)
        others = np.where(missing, 0.0, means).sum(axis=0) / (~missing).sum(axis=0)
    return np.where(missing, others, means)


def _unheld(folded: Array) -> int:
    """Bins (turns, bins) in which no turn has a sample."""
    return int(np.isnan(folded).any(axis=0).sum())
