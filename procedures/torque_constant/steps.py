"""From the recorded steps of a torque calibration to arrays: loads on the lever, detent, and the wiring of the segments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.recording.earlier import AGAIN
from bench.rigfile.roles import ANGLE
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.loads import load_index
from procedures.shared.continued import half_of
from procedures.shared.step_table import Labels, Read, Samples, StepTable, tabulate
from procedures.torque_constant.fit import Steps, resting
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.requires import channels

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class OnLever(Labels):
    """Which load hangs on which side; both "" without one."""

    kind: ClassVar[str] = "lever"
    gamma_rad: float
    side: str
    load: str

    def __str__(self) -> str:
        what = f"{self.load or 'nothing'} on the {self.side}" if self.side else "no load"
        return f"gamma {np.degrees(self.gamma_rad):+.2f} deg, {what}"


@dataclass(frozen=True)
class OverDetent(Labels):
    """Where the rotor is held without load."""

    kind: ClassVar[str] = "detent"
    angle_rad: float


@dataclass(frozen=True)
class Sideways(Labels):
    """Currents that push the rotor aside, A."""

    kind: ClassVar[str] = "wiring"
    i_x: float
    i_y: float


@dataclass(frozen=True)
class TorqueData:
    """`steps` for the fit, and the `table` (n,) of these steps, with the torque current as "torque" and the outboard AMB's
    control currents as "side_x", "side_y", A.

    `detent_angle`, `detent_current` (m,): rad and A without load over a period of the detent.
    `wiring` (2, 2): control current of the outboard AMB across and along the motor's first segment, in A per A of i_x, i_y.
    """

    steps: Steps
    masses: tuple[str, ...]
    table: StepTable[OnLever]
    detent_angle: Array
    detent_current: Array
    wiring: Array


def read_torques(recording: Recording[Plan]) -> TorqueData:
    """Read all steps.

    Raises:
        AnalysisError: there are none, too few samples in one, or what hung is no mass of the plan.
    """
    table = _table(recording, OnLever)
    if not len(table):
        raise AnalysisError("found no loads on the lever (was the run stopped early?)")
    detent = _table(recording, OverDetent)
    return TorqueData(
        _steps(recording, table), recording.plan.masses, table, detent.mean[ANGLE], detent.stack(
            conventions(recording.rig).turning).mean(axis=0), read_wiring(recording),
    )  # fmt: skip


def read_all(recording: Recording[Plan]) -> Steps:
    """The steps with those that repeat the last one before a stop."""
    return _steps(recording, _table(recording, OnLever, "", AGAIN))


def _steps(recording: Recording[Plan], table: StepTable[OnLever]) -> Steps:
    half = half_of(recording, table.start_ns)
    sides = {"left": 1, "right": -1, "": 0}
    return Steps(
        np.ascontiguousarray(table.stack(conventions(recording.rig).turning).T),
        resting(table.mean[ANGLE], recording.plan.count_rad),
        table.each(lambda step: step.gamma_rad),
        ((table.start_ns + table.end_ns) / 2 - table.start_ns[0] - paused(table, half)) * 1e-9,
        np.array([sides[step.side] for step in table.labels]),
        load_index([step.load for step in table.labels], recording.plan.masses, "lever"),
        table.spread["torque"],
        half,
    )


def paused(table: StepTable[OnLever], half: Ints) -> Array:
    """How long a run that was continued had rested before each step, ns: what drifts does so while the machine runs. A pause is
    from the end of a step to the start of the next, less what lies between two others at least."""
    between = table.start_ns[1:] - table.end_ns[:-1]
    pauses = np.where(np.diff(half) > 0, between - between.min(initial=between.max(initial=0)), 0)
    return np.concatenate([[0], np.cumsum(pauses)]).astype(np.float64)


def _table(recording: Recording[Plan], kind: type[Read], *ends: str) -> StepTable[Read]:
    machine = conventions(recording.rig)

    def samples(step: Step) -> Samples:
        data = step.read(*channels(machine))
        n = len(data[ANGLE])
        if n < 20:
            raise AnalysisError(f"step {dict(step.labels)}: found {n} samples; expected 20 or more")
        data[ANGLE] = np.unwrap(data[ANGLE])
        data["torque"] = np.array([data[c] for c in machine.turning]).mean(axis=0)
        data |= {f"side_{axis}": machine.control(f"{axis}o", data.__getitem__) for axis in "xy"}
        return data

    reduced = (*machine.segments, ANGLE, "torque", "side_x", "side_y")
    steps = [s for s in recording.all_steps() if s.kind in [kind.kind + end for end in ends or ("",)]]
    return tabulate(steps, kind, reduced, read=samples)


def read_wiring(recording: Recording[Plan]) -> Array:
    """The outboard AMB's answers (2, 2) in the steps, A per A."""
    return wiring(_table(recording, Sideways), conventions(recording.rig))


def wiring(table: StepTable[Sideways], machine: Servomotor) -> Array:
    """Slopes of the outboard AMB's control currents, across and along the motor's first segment, over i_x and i_y, from the
    steps at plus and minus."""
    if not len(table):
        return np.zeros((2, 2))
    asked = np.array([[1.0, step.i_x, step.i_y] for step in table.labels])
    answers = np.stack([table.mean["side_x"], table.mean["side_y"]], axis=-1)
    slopes: Array = np.linalg.lstsq(asked, answers, rcond=None)[0][1:].T
    return np.array(machine.pushed(slopes[0], slopes[1]))
