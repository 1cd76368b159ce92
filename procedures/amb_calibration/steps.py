"""From the recorded steps of a mass-hanging calibration to arrays: the hangings, and a table of their steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.amb_calibration.fit import Hangings
from procedures.amb_calibration.plan import Plan
from procedures.servomotor.conventions import Servomotor, conventions, displacement
from procedures.servomotor.loads import load_index
from procedures.shared.step_table import Labels, StepTable, by_angle, tabulate

Array = npt.NDArray[np.float64]
AXES = ("yi", "yo", "xi", "xo")
VERTICAL = ("yi", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded while masses hang, besides the flags."""
    return (*machine.coils_of(*AXES), *machine.positions_of(*AXES))


@dataclass(frozen=True)
class Hang(Labels):
    """What hangs ("" for nothing but the hanger), reached by loading (+1) or unloading (-1)."""

    kind: ClassVar[str] = "hang"
    angle_rad: float
    load: str
    branch: int

    def __str__(self) -> str:
        way = "loading" if self.branch > 0 else "unloading"
        return f"{np.degrees(self.angle_rad):.0f}°, {self.load or 'no load'}, {way}"


@dataclass(frozen=True)
class HangingData:
    """`hangings` for the fit, and the `table` (A, P) of their steps."""

    hangings: Hangings
    table: StepTable[Hang]
    masses: tuple[str, ...]


def read_hangings(recording: Recording[Plan]) -> HangingData:
    """Read every "hang" step, in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, an angle lacks some, or what hung is no mass of the plan.
    """
    machine, masses = conventions(recording.rig), recording.plan.masses
    steps, shape = by_angle(recording.steps(Hang.kind), "hangings")
    table = tabulate(steps, Hang, channels(machine), shape=shape)
    inboard, outboard, motor = _plane_positions(recording.rig, *table.stack(machine.positions_of(*VERTICAL)))
    hangings = Hangings(
        np.stack([table.stack(machine.coils[axis]) for axis in VERTICAL]),
        np.stack([inboard, outboard]),
        motor,
        load_index([hang.load for hang in table.labels], masses, "hanger").reshape(shape),
        table.each(lambda hang: hang.branch),
        table.each(lambda hang: hang.angle_rad)[:, 0].copy(),
    )
    return HangingData(hangings, table, masses)


def _plane_positions(rig: RigFile, y_inboard: Array, y_outboard: Array) -> tuple[Array, Array, Array]:
    """Displacement at the inboard AMB, the outboard AMB and the motor from both sensor planes (T 6.7)."""
    machine = conventions(rig)
    inboard, outboard, motor = (rig.geometry[name].value for name in (*machine.ambs, "com_to_motor"))
    at = [displacement(y_inboard, y_outboard, machine.sensor_share(z, rig)) for z in (-inboard, outboard, motor)]
    return at[0], at[1], at[2]
