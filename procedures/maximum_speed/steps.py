"""From the recorded windows of a run at the torque limit to numbers, one window each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Captured, Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.maximum_speed import fit
from procedures.maximum_speed.fit import Turning
from procedures.maximum_speed.plan import HALF, OP, WORDS, Plan
from procedures.maximum_speed.requires import ACROSS, BOUND, DEMANDS, GIVEN, SHARE, TURNED, _of_law, channels, coils
from procedures.servomotor.conventions import Servomotor, conventions

Array = npt.NDArray[np.float64]
RUN = "run"
CARRIED_A = 0.05  # near enough to the i_y that was asked for
GUARDED, UNSTEADY, NOT_CARRIED, SET_POINT = "guarded", "unsteady", "not-carried", "set-point"
SHARED = "sharing"  # event: the segments are shared another way from now on
"""Events: the rotor reached the speed that guards the run; its speed did not become steady; no set point makes the motor carry
what was asked for; where it holds its end."""
AT_BOUND_A = 1e-3  # of the bound, and what is given is all there is


@dataclass(frozen=True)
class Told:
    """A window's capture, means over it: `sizes` of i_x, i_y (2,) A; the `bound` and `share` that follow from them at every
    instant, and the share that the other sharing would make; what the law told of bound, share and torque current; `at_bound`,
    in which share of the samples it gave all; segments `along` and `across` the field (4,) A; the largest amplitude of a
    segment A."""

    sizes: Array
    bound: float
    share: float
    other_share: float
    told_bound: float
    told_share: float
    given: float
    at_bound: float
    along: Array
    across: Array
    largest: float


@dataclass(frozen=True)
class Window:
    """One window: what was asked, how it turned, what its speed `swings` by with the turn (8,) rad/s, mean currents of segments
    (4,) and coils, flags, its capture."""

    sharing: str
    direction: int
    repeat: int
    turning: Turning
    swings: Array
    segments: Array
    coils: Mapping[str, float]
    flags: int
    told: Told
    lost: int
    expected: int

    @property
    def speed(self) -> float:
        """In the direction that was asked for, rad/s."""
        return self.direction * self.turning.speed

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        way = "forward" if self.direction > 0 else "backward"
        return f"{WORDS[self.sharing]}, {way}, run {self.repeat + 1}"


def read_windows(recording: Recording[Plan], limit_A: float) -> list[Window]:
    """Every window, in time order.

    Raises:
        AnalysisError: there are none, one has no capture, or the rotor hardly turns in it.
    """
    machine = conventions(recording.rig)
    found = [_read(recording, step, machine, limit_A) for step in recording.steps(RUN)]
    if not found:
        raise AnalysisError(
            "found no runs at the torque limit; expected those of the plan (was the run stopped early?)"
        )
    return found


def turned(recording: Recording[Plan]) -> list[Array]:
    """The captured angles of all windows, rad, as the encoder tells them."""
    found = (c for step in recording.steps(RUN) for c in recording.captures(number=step.labels["number"]))
    return [c.arrays(TURNED)[TURNED] for c in found if TURNED in c.channels]


def _read(recording: Recording[Plan], step: Step, machine: Servomotor, limit_A: float) -> Window:
    labels = step.labels
    data = step.read(*channels(machine))
    if len(data["t_ns"]) < 50:
        raise AnalysisError(f"run {dict(labels)}: found {len(data['t_ns'])} samples; expected 50 or more")
    captures = recording.captures(number=labels["number"])
    if not captures:
        raise AnalysisError(f"run {dict(labels)}: found no capture")
    t = (data["t_ns"] - data["t_ns"][0]).astype(np.float64) * 1e-9
    flags: npt.NDArray[Any] = data[STATUS].astype(np.int64)
    turning = fit.turning(t, data[ANGLE])
    whole = slice(turning.samples)
    return Window(
        sharing=str(labels["sharing"]), direction=int(labels["direction"]), repeat=int(labels["repeat"]),
        turning=turning,
        swings=swings_of(captures[0], turning, t[whole], data[ANGLE][whole]),
        segments=np.array([float(data[c][whole].mean()) for c in machine.segments]),
        coils={c: float(data[c].mean()) for c in coils(machine)},
        flags=int(np.bitwise_or.reduce(flags)),
        told=_told(captures[0], machine, str(labels["sharing"]), limit_A, turning.speed),
        lost=step.lost(), expected=step.expected(),
    )  # fmt: skip


def swings_of(capture: Captured, turning: Turning, t: Array, angle: Array) -> Array:
    """Of the captured angle. Recordings from before it was captured have that of the telemetry, (n,) of the same turns."""
    if TURNED in capture.channels:
        angle = capture.arrays(TURNED)[TURNED][: _whole(capture, turning.speed)]
        t = np.arange(len(angle)) / capture.rate_hz
    return fit.swings(t, np.unwrap(angle))


def _whole(capture: Captured, speed: float) -> int:
    """Samples of a capture that are whole turns.

    Raises:
        AnalysisError: there is none.
    """
    whole = fit.whole_turns(capture.samples, capture.rate_hz, speed)
    if not whole:
        raise AnalysisError(
            f"capture of a run at {speed:.1f} rad/s: found less than a turn; expected one at least. Give a longer capture_s"
        )
    return whole


def _told(capture: Captured, machine: Servomotor, sharing: str, limit_A: float, speed: float) -> Told:
    whole = _whole(capture, speed)
    data = {name: x[:whole] for name, x in capture.arrays(*_of_law(machine)).items()}
    i_x, i_y = (data[name] for name in DEMANDS)
    along, across = (np.array([data[c] for c in names]) for names in (machine.segments, ACROSS))
    return Told(
        sizes=np.array([np.abs(i_x).mean(), np.abs(i_y).mean()]),
        bound=float(fit.bound(limit_A, i_x, i_y, sharing).mean()),
        share=float(fit.share(limit_A, i_x, i_y, sharing).mean()),
        other_share=float(fit.share(limit_A, i_x, i_y, OP if sharing == HALF else HALF).mean()),
        told_bound=float(data[BOUND].mean()),
        told_share=float(data[SHARE].mean()),
        given=float(data[GIVEN].mean()),
        at_bound=float((np.abs(data[GIVEN]) >= data[BOUND] - AT_BOUND_A).mean()),
        along=along.mean(axis=1),
        across=across.mean(axis=1),
        largest=float(np.hypot(along, across).max()),
    )


def by_sharing(windows: list[Window], sharing: str, direction: int) -> list[Window]:
    """Those of one sharing in one direction, by repeat."""
    found = [w for w in windows if (w.sharing, w.direction) == (sharing, direction)]
    return sorted(found, key=lambda w: w.repeat)
