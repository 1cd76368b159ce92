"""From the recorded steps of a spindown to arrays: one coast each, with its fits of speed and of angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, SPEED, STATUS
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.spindown import fit
from procedures.spindown.fit import Coast
from procedures.spindown.plan import Plan
from procedures.spindown.requires import channels, coils

Array = npt.NDArray[np.float64]
ANGLE_LAGS = 60  # samples of 1 ms over which its residuals repeat themselves
SPEED_LAGS = 200
"""The speed is the angle differentiated: its noise takes back what it adds, and only far beyond the 8 ms of its filter
does the sum over the lags come near what is left."""
LONG_SAMPLES = 400
"""Fewer, and the speed is not fitted: its filter's transient and correlation take too much of so short a run-down."""
SHORT_LAGS = 5  # for the angle then: it moves by two counts and more a sample, whose errors hardly repeat
SMALLEST_SAMPLES = 150
RELEASE_S = 0.01  # a command and the amplifiers: what drove the rotor is gone
LED_SAMPLES = 20  # of a step that begins before the motor is let go
GONE, GONE_SAMPLES = 0.1, 10  # of the torque current before: let go, if it stays so
LEAST_A, ZERO_A = 0.03, 0.01  # that holds a speed; of its sensors without any


@dataclass(frozen=True)
class RunDown:
    """One coast. `t` (n,) s from the first sample used, `speed` (n,) rad/s and `angle` (n,) rad in the direction of turning;
    fits of both, of a short one of the angle alone; mean coil currents A by channel; mean segment currents (4,) A; `around`
    (n,) rad, where the rotor stands."""

    bias_A: float
    direction: int
    repeat: int
    ring: bool
    t: Array
    speed: Array
    angle: Array
    of_speed: Coast | None
    of_angle: Coast
    coils: Mapping[str, float]
    segments: Array
    lost: int
    expected: int
    flags: int
    around: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def where(self) -> str:
        """How a coast is named to the reader."""
        way = "forward" if self.direction > 0 else "backward"
        return f"{self.bias_A:g} A, {way}, run {self.repeat + 1}{', with the ring' if self.ring else ''}"


def read_run_downs(recording: Recording[Plan]) -> list[RunDown]:
    """Every "coast" step, fitted between the filter's transient and the end speed; a short one from its release.

    Raises:
        AnalysisError: there are none, or one is too short to be fitted.
    """
    plan, machine = recording.plan, conventions(recording.rig)
    out = [_read(step, machine, plan.start_delay_s, plan.end_speed_rad_s) for step in recording.steps("coast")]
    if not out:
        raise AnalysisError("found no run-down (was the run stopped early?)")
    return out


def _read(step: Step, machine: Servomotor, delay_s: float, end: float) -> RunDown:
    labels = step.labels
    direction = int(labels["direction"])
    data = step.read(*channels(machine))
    name = f"{labels['bias_A']:g} A, {'forward' if direction > 0 else 'backward'}, run {int(labels['repeat']) + 1}"
    if labels.get("by") == "motor":
        begins = released(np.mean([data[c] for c in machine.segments], axis=0))
        data = {channel: x[begins:] for channel, x in data.items()}
    t = (data["t_ns"] - data["t_ns"][0]).astype(np.float64) * 1e-9 if len(data["t_ns"]) else np.zeros(0)
    speed, angle = direction * data[SPEED], direction * np.unwrap(data[ANGLE])
    used = _span(t, speed, delay_s, end)
    long = used.stop - used.start >= LONG_SAMPLES
    if not long:
        used = _span(t, speed, min(delay_s, RELEASE_S), end)
    if used.stop - used.start < SMALLEST_SAMPLES:
        raise AnalysisError(_too_short(name, t, used, end))
    t, speed, angle = t[used] - t[used.start], speed[used], angle[used] - angle[used.start]
    return RunDown(
        bias_A=float(labels["bias_A"]), direction=direction, repeat=int(labels["repeat"]), ring=bool(labels["ring"]),
        t=t, speed=speed, angle=angle,
        of_speed=fit.of_speed(t, speed, SPEED_LAGS) if long else None,
        of_angle=fit.of_angle(t, angle, ANGLE_LAGS if long else SHORT_LAGS, SMALLEST_SAMPLES),
        coils={c: float(data[c][used].mean()) for c in coils(machine)},
        segments=np.array([float(data[c][used].mean()) for c in machine.segments]),
        lost=step.lost(), expected=step.expected(), flags=int(np.bitwise_or.reduce(data[STATUS].astype(np.int64))),
        around=data[ANGLE][used],
    )  # fmt: skip


def released(torque: Array) -> int:
    """From which sample on the motor gives no torque, by its torque current (n,) A: the first of all where it gave none to
    begin with, as in a recording that begins at the release, or where it never lets go."""
    size = np.abs(torque)
    before = float(size[:LED_SAMPLES].mean()) if len(size) >= LED_SAMPLES else 0.0
    if before < LEAST_A:
        return 0
    stays = np.convolve(size < max(GONE * before, ZERO_A), np.ones(GONE_SAMPLES), "valid") > GONE_SAMPLES - 0.5
    return int(np.argmax(stays))


def _too_short(name: str, t: Array, used: slice, end: float) -> str:
    """Why a run-down cannot be fitted, and what to do: the rotor stops too soon, or samples are missing."""
    found = used.stop - used.start
    lasted = float(t[used.stop - 1] - t[used.start]) if found else 0.0
    start = f"run-down {name}: found {found} samples between the release and {end:g} rad/s; expected {SMALLEST_SAMPLES} or more"
    if used.stop >= len(t):
        return f"{start}. The recording ends there: look for a run that was stopped, or give a longer coast_s"
    return (
        f"{start}. The rotor stops too soon: it falls to {end:g} rad/s within {lasted:.2f} s. Give a higher speed_rad_s or a "
        "lower end_speed_rad_s; if it ran longer before, look for a brake, a rub or a bearing current that drags"
    )


def _span(t: Array, speed: Array, delay_s: float, end: float) -> slice:
    """From the end of the filter's transient to the first time that the speed is below the end speed."""
    first = int(np.searchsorted(t, delay_s))
    below = np.flatnonzero(speed[first:] < end)
    return slice(first, first + int(below[0]) if len(below) else len(t))
