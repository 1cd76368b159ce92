"""The recorded steps of lifts by the phase angle, and the ramps as arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.lift_off.plan import Plan
from procedures.lift_off.requires import channels
from procedures.servomotor.conventions import conventions, radial_currents
from procedures.servomotor.parameters import parameter
from procedures.shared.step_table import Kind, Labels, StepTable, tabulate

Array = npt.NDArray[np.float64]
LAST = 100  # samples just before a lift
FEWEST = 16  # of which a scatter is told
SHAKEN_S = 1.0  # before a lift, over which i_x is watched
BEFORE_S = (0.2, 0.06)  # before a lift: at 0.2 deg/s the ring carries 0.5 N still, and is pressed by some 10 nm


@dataclass(frozen=True)
class Rest(Labels):
    """Both ends on their rings."""

    kind: ClassVar[str] = "rest"

    def __str__(self) -> str:
        return "at rest"


@dataclass(frozen=True)
class Lift(Labels):
    """One lift: its number, and the sign of the phase angle."""

    repeat: int
    way: int

    def __str__(self) -> str:
        return f"lift {self.repeat + 1}, gamma {'above' if self.way > 0 else 'below'} 0"


class Dwell(Lift):
    """The inboard end is up, the outboard one on its ring, gamma is 0."""

    kind: ClassVar[str] = "dwell"


class Ramp(Lift):
    """Gamma is turned until the outboard end has left its ring."""

    kind: ClassVar[str] = "ramp"


class Held(Lift):
    """Both ends are up, gamma is 0 again."""

    kind: ClassVar[str] = "held"


@dataclass(frozen=True)
class Ramped:
    """A ramp: time `t` (n,) s from when gamma began to turn; readings (n,) m of the four probes by axis; `touches` (n,),
    whether the controller tells contact of the outboard end; `i_x`, `i_y` (n,) A as the sensors read; `gamma` (n,) rad as it
    was told; `angle` (n,) rad of the rotor."""

    labels: Ramp
    t: Array
    positions: dict[str, Array]
    touches: npt.NDArray[np.bool_]
    i_x: Array
    i_y: Array
    gamma: Array
    angle: Array

    @property
    def y(self) -> Array:
        """By the outboard vertical probe."""
        return self.positions["yo"]

    def turned(self, lifted: int) -> float:
        """How far the rotor is off its home angle just before the lift, rad, as its encoder reads."""
        return float(self.angle[max(0, lifted - LAST) : lifted].mean())

    def shaken(self, lifted: int) -> float:
        """Scatter of i_x before the lift, A, about the parabola by which it goes with gamma; 0 of too few samples."""
        last = min(lifted, max(int(np.searchsorted(self.t, self.t[lifted] - BEFORE_S[1])), FEWEST))
        use = slice(int(np.searchsorted(self.t, self.t[last] - SHAKEN_S)), last)
        t, i = self.t[use], self.i_x[use]
        if len(t) < FEWEST:
            return 0.0
        about = (t - t.mean()) / SHAKEN_S
        left = i - np.polyval(np.polyfit(about, i, 2), about)
        return float(np.sqrt((left**2).sum() / (len(t) - 3)))

    def before(self, lifted: int, early_s: tuple[float, float] = BEFORE_S) -> dict[str, float]:
        """Mean readings by axis from so long until so long before the sample of the lift: the ring carries hardly anything
        then, and is no longer pressed."""
        use = (self.t > self.t[lifted] - early_s[0]) & (self.t < self.t[lifted] - early_s[1])
        return {axis: float(x[use].mean()) for axis, x in self.positions.items()}


def read_table(recording: Recording[Any], kind: type[Kind]) -> StepTable[Kind] | None:
    """Every step of a kind in time order; None where there is none.

    Raises:
        AnalysisError: one of them holds no samples.
    """
    steps = list(recording.steps(kind.kind))
    machine = conventions(recording.rig)

    def samples(step: Step) -> dict[str, npt.NDArray[Any]]:
        data = step.read(*channels(machine), STATUS)
        data[ANGLE] = (data[ANGLE] + np.pi) % (2 * np.pi) - np.pi
        return data

    return tabulate(steps, kind, channels(machine), read=samples) if steps else None


def always(recording: Recording[Any], kind: type[Labels], bits: int) -> list[float]:
    """Of each step of a kind, the share of samples in which any of the status `bits` is set."""
    return [
        float(((step.read(STATUS)[STATUS].astype(np.int64) & bits) != 0).mean()) for step in recording.steps(kind.kind)
    ]


def read_ramps(recording: Recording[Plan]) -> list[Ramped]:
    """Every ramp, in time order.

    Raises:
        AnalysisError: one does not show when gamma began to turn.
    """
    return [_ramp(recording, step) for step in recording.steps(Ramp.kind)]


def _ramp(recording: Recording[Plan], step: Step) -> Ramped:
    machine, plan, told = conventions(recording.rig), recording.plan, parameter(recording.rig, "motor.phase")
    labels = Ramp(int(step.labels["repeat"]), int(step.labels["way"]))
    begun = [
        e["t_ns"]
        for e in recording.events("parameter")
        if e["name"] == told and step.start_ns <= e["t_ns"] < step.end_ns
    ]
    if not begun:
        raise AnalysisError(f"{labels}: found no write of {told} within its ramp")
    data = step.read(*channels(machine), STATUS)
    t = (data["t_ns"] - begun[0]) * 1e-9
    i_x, i_y = radial_currents(*(data[c] for c in machine.segments))
    gamma = labels.way * np.clip(plan.rate_rad_s * t, 0.0, plan.gamma_max_rad)
    contact = (data[STATUS].astype(np.int64) & machine.contact_outboard) != 0
    angle = (data[ANGLE] + math.pi) % (2 * math.pi) - math.pi
    positions = {axis: data[channel] for axis, channel in machine.positions.items()}
    return Ramped(labels, t, positions, contact, i_x, i_y, gamma, angle)
