"""From the recorded steps of a force-constant run to arrays: the ramps of both axes, and a table of their steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.force_constant.fit import Ramps
from procedures.force_constant.requires import channels
from procedures.servomotor.conventions import conventions, displacement
from procedures.shared.step_table import Labels, StepTable, by_angle, tabulate

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class AtLevel(Labels):
    """Both currents as commanded, and whether each was reached by raising it (+1) or lowering it (-1)."""

    kind: ClassVar[str] = "level"
    angle_rad: float
    i_y_A: float
    i_x_A: float
    branch_y: int
    branch_x: int

    def __str__(self) -> str:
        return f"{np.degrees(self.angle_rad):.0f}°, i_y {self.i_y_A:+g} A, i_x {self.i_x_A:+g} A"


@dataclass(frozen=True)
class RampData:
    """`vertical` and `horizontal` for the fits, and the `table` (A, P) of the steps. `duration_s` from the first step's start
    to the last's end."""

    vertical: Ramps
    horizontal: Ramps
    table: StepTable[AtLevel]
    duration_s: float


def read_ramps(recording: Recording[Any]) -> RampData:
    """Read every step of a level, in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, or an angle lacks some.
    """
    steps, shape = by_angle(recording.steps(AtLevel.kind), "steps")
    table = tabulate(steps, AtLevel, channels(conventions(recording.rig)), shape=shape)
    return ramps(table, recording.rig)


def ramps(table: StepTable[AtLevel], rig: RigFile) -> RampData:
    """The ramps of a table (A, P) of their steps."""
    duration_s = (table.end_ns.flat[-1] - table.start_ns.flat[0]) * 1e-9
    y = _ramps(table, rig, "y", table.each(lambda at: at.i_y_A), table.each(lambda at: at.branch_y))
    x = _ramps(table, rig, "x", table.each(lambda at: at.i_x_A), table.each(lambda at: at.branch_x))
    return RampData(y, x, table, float(duration_s))


def _ramps(table: StepTable[AtLevel], rig: RigFile, axis: str, level: Array, branch: Array) -> Ramps:
    machine = conventions(rig)
    bearings = (f"{axis}i", f"{axis}o")
    begun = (table.start_ns - table.start_ns[0, 0]) * 1e-9
    return Ramps(
        axis,
        np.stack([table.stack(machine.coils[b]) for b in bearings]),
        table.stack(machine.segments),
        *planes(rig, *table.stack(machine.positions_of(*bearings))),
        branch,
        np.isin(level, (level.min(), level.max())).astype(np.float64),
        begun - begun.mean(axis=1, keepdims=True),
        table.each(lambda at: at.angle_rad)[:, 0].copy(),
    )


def planes(rig: RigFile, inboard: Array, outboard: Array) -> tuple[Array, Array]:
    """Displacement at the AMB planes (2, A, P) and at the motor (A, P) from both sensor planes (T 6.7)."""
    machine = conventions(rig)
    l_ia, l_oa, on = (rig.geometry[name].value for name in (*machine.ambs, "motor_to_outboard_amb"))
    at = [displacement(inboard, outboard, machine.sensor_share(z, rig)) for z in (-l_ia, l_oa, l_oa + on)]
    return np.stack(at[:2]), at[2]
