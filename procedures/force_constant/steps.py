"""From the recorded steps of a force-constant run to arrays: step means, drifts, losses and flags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.force_constant.fit import Ramps
from procedures.servomotor.conventions import Servomotor, conventions, displacement
from procedures.shared.step_table import reduced

Array = npt.NDArray[np.float64]

STEP = "level"
AXES = ("yi", "yo", "xi", "xo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded at a level."""
    return (*machine.coils_of(*AXES), *machine.segments, *machine.positions_of(*AXES), "flags")


@dataclass(frozen=True)
class RampData:
    """`vertical` and `horizontal` for the fits, and per step (A, P): `level_x`, `level_y` A as commanded; by channel
    `mean`, `drift` (second half less first half of the step) and `spread` (standard deviation of the samples);
    `lost` and `expected` samples; `flags` ORed over the step. `duration_s` from the first step's start to the last's end."""

    vertical: Ramps
    horizontal: Ramps
    level_x: Array
    level_y: Array
    mean: dict[str, Array]
    drift: dict[str, Array]
    spread: dict[str, Array]
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]
    duration_s: float

    def where(self, turn: int, point: int) -> str:
        """How a step is named to the reader."""
        angle = np.degrees(self.vertical.angles[turn])
        return f"{angle:.0f}°, i_y {self.level_y[turn, point]:+g} A, i_x {self.level_x[turn, point]:+g} A"


def read_ramps(recording: Recording[Any]) -> RampData:
    """Read every step of a level, in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, or an angle lacks some.
    """
    groups = [(float(angle), list(steps)) for angle, steps in recording.steps(STEP).by("angle_rad")]
    counts = {len(steps) for _, steps in groups}
    if len(counts) != 1:
        raise AnalysisError(
            f"steps per angle: found {sorted(counts) or 'none'}; expected the same number at each angle "
            "(was the run stopped early?)"
        )
    steps = [row for _, row in groups]
    machine = conventions(recording.rig)
    names = channels(machine)
    read = [[reduced(step.read(*names), names, step.labels) for step in row] for row in steps]

    def label(name: str) -> Array:
        return np.array([[float(s.labels[name]) for s in row] for row in steps])

    mean, drift, spread = (
        {c: np.array([[one[kind][c] for one in row] for row in read]) for c in names}
        for kind in ("mean", "drift", "spread")
    )
    begun = np.array([[(s.start_ns - steps[0][0].start_ns) * 1e-9 for s in row] for row in steps])
    time = begun - begun.mean(axis=1, keepdims=True)
    angles = np.array([angle for angle, _ in groups])

    def ramps(axis: str) -> Ramps:
        level = label(f"i_{axis}_A")
        branch = label(f"branch_{axis}")
        return Ramps(
            axis,
            np.stack([np.stack([mean[c] for c in machine.coils[f"{axis}{b}"]]) for b in "io"]),
            np.stack([mean[c] for c in machine.segments]),
            *planes(recording.rig, *(mean[c] for c in machine.positions_of(f"{axis}i", f"{axis}o"))),
            branch,
            np.isin(level, (level.min(), level.max())).astype(np.float64),
            time,
            angles,
        )

    return RampData(
        ramps("y"), ramps("x"), label("i_x_A"), label("i_y_A"), mean, drift, spread,
        np.array([[float(s.lost()) for s in row] for row in steps]),
        np.array([[float(s.expected()) for s in row] for row in steps]),
        np.array([[one["flags"] for one in row] for row in read]),
        (steps[-1][-1].end_ns - steps[0][0].start_ns) * 1e-9,
    )  # fmt: skip


def planes(rig: RigFile, inboard: Array, outboard: Array) -> tuple[Array, Array]:
    """Displacement at the AMB planes (2, A, P) and at the motor (A, P) from both sensor planes (T 6.7)."""
    machine = conventions(rig)
    l_ia, l_oa, on = (rig.geometry[name].value for name in (*machine.ambs, "motor_to_outboard_amb"))
    at = [displacement(inboard, outboard, machine.sensor_share(z, rig)) for z in (-l_ia, l_oa, l_oa + on)]
    return np.stack(at[:2]), at[2]
