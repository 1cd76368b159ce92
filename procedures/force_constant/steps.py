"""From the recorded steps of a force-constant run to arrays: the ramps of both axes, and a table of their steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.force_constant.fit import Ramps
from procedures.servomotor.conventions import Servomotor, conventions, displacement
from procedures.shared.step_table import StepTable, by_angle, tabulate

Array = npt.NDArray[np.float64]

STEP = "level"
AXES = ("yi", "yo", "xi", "xo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded at a level, besides the flags."""
    return (*machine.coils_of(*AXES), *machine.segments, *machine.positions_of(*AXES))


@dataclass(frozen=True)
class RampData:
    """`vertical` and `horizontal` for the fits, and the `table` (A, P) of the steps, whose labels `i_y_A`, `i_x_A` are what was
    commanded. `duration_s` from the first step's start to the last's end."""

    vertical: Ramps
    horizontal: Ramps
    table: StepTable
    duration_s: float


def read_ramps(recording: Recording[Any]) -> RampData:
    """Read every step of a level, in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, or an angle lacks some.
    """
    steps, shape = by_angle(recording.steps(STEP), "steps")
    table = tabulate(steps, channels(conventions(recording.rig)), _name, shape=shape)
    duration_s = (steps[-1].end_ns - steps[0].start_ns) * 1e-9
    return RampData(_ramps(table, recording.rig, "y"), _ramps(table, recording.rig, "x"), table, duration_s)


def _name(labels: Mapping[str, Any]) -> str:
    return f"{np.degrees(labels['angle_rad']):.0f}°, i_y {labels['i_y_A']:+g} A, i_x {labels['i_x_A']:+g} A"


def _ramps(table: StepTable, rig: RigFile, axis: str) -> Ramps:
    machine, level = conventions(rig), table.labels[f"i_{axis}_A"]
    bearings = (f"{axis}i", f"{axis}o")
    begun = (table.start_ns - table.start_ns[0, 0]) * 1e-9
    return Ramps(
        axis,
        np.stack([table.stack(machine.coils[b]) for b in bearings]),
        table.stack(machine.segments),
        *planes(rig, *table.stack(machine.positions_of(*bearings))),
        table.labels[f"branch_{axis}"],
        np.isin(level, (level.min(), level.max())).astype(np.float64),
        begun - begun.mean(axis=1, keepdims=True),
        table.labels["angle_rad"][:, 0].copy(),
    )


def planes(rig: RigFile, inboard: Array, outboard: Array) -> tuple[Array, Array]:
    """Displacement at the AMB planes (2, A, P) and at the motor (A, P) from both sensor planes (T 6.7)."""
    machine = conventions(rig)
    l_ia, l_oa, on = (rig.geometry[name].value for name in (*machine.ambs, "motor_to_outboard_amb"))
    at = [displacement(inboard, outboard, machine.sensor_share(z, rig)) for z in (-l_ia, l_oa, l_oa + on)]
    return np.stack(at[:2]), at[2]
