"""From the recorded steps of a mass-hanging calibration to arrays: step means, drifts, losses and flags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.amb_calibration.fit import Hangings
from procedures.servomotor.conventions import Servomotor, conventions, displacement
from procedures.shared.step_table import reduced

Array = npt.NDArray[np.float64]
AXES = ("yi", "yo", "xi", "xo")
VERTICAL = ("yi", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded while masses hang."""
    return (*machine.coils_of(*AXES), *machine.positions_of(*AXES), "flags")


@dataclass(frozen=True)
class HangingData:
    """`hangings` for the fit, and per channel and step (A, P): `mean`, `drift` (second half less first half of the
    step), `spread` (standard deviation of the samples); `lost` and `expected` samples; `flags` ORed over the step."""

    hangings: Hangings
    mean: dict[str, Array]
    drift: dict[str, Array]
    spread: dict[str, Array]
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]
    masses: tuple[str, ...]

    def where(self, turn: int, point: int) -> str:
        """How a step is named to the reader."""
        load = self.hangings.load[turn, point]
        label = self.masses[load] if load >= 0 else "no load"
        way = "loading" if self.hangings.branch[turn, point] > 0 else "unloading"
        return f"{np.degrees(self.hangings.angles[turn]):.0f}°, {label}, {way}"


def read_hangings(recording: Recording[Any], masses: tuple[str, ...]) -> HangingData:
    """Read every "hang" step, in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, or an angle lacks some.
    """
    groups = [(float(angle), list(steps)) for angle, steps in recording.steps("hang").by("angle_rad")]
    counts = {len(steps) for _, steps in groups}
    if len(counts) != 1:
        raise AnalysisError(
            f"hangings per angle: found {sorted(counts) or 'none'}; expected the same number at each angle "
            "(was the run stopped early?)"
        )
    machine = conventions(recording.rig)
    names = channels(machine)
    read = [[reduced(step.read(*names), names, step.labels) for step in steps] for _, steps in groups]

    def stack(key: str, channel: str) -> Array:
        return np.array([[one[key][channel] for one in row] for row in read])

    mean = {c: stack("mean", c) for c in names}
    steps = [s for _, s in groups]
    labels = {"": -1} | {label: k for k, label in enumerate(masses)}
    hung = [[str(s.labels["load"]) for s in row] for row in steps]
    if strange := sorted({label for row in hung for label in row} - set(labels)):
        raise AnalysisError(
            f"masses: found {', '.join(strange)} on the hanger; expected those of the plan, {', '.join(masses)}"
        )
    load = np.array([[labels[label] for label in row] for row in hung])
    branch = np.array([[float(s.labels["branch"]) for s in row] for row in steps])
    currents = np.stack([np.stack([mean[c] for c in machine.coils[axis]]) for axis in VERTICAL])
    inboard, outboard, motor = _plane_positions(recording.rig, *(mean[c] for c in machine.positions_of(*VERTICAL)))
    hangings = Hangings(
        currents, np.stack([inboard, outboard]), motor, load, branch, np.array([angle for angle, _ in groups])
    )
    return HangingData(
        hangings,
        mean,
        {c: stack("drift", c) for c in names},
        {c: stack("spread", c) for c in names},
        np.array([[float(s.lost()) for s in row] for row in steps]),
        np.array([[float(s.expected()) for s in row] for row in steps]),
        np.array([[one["flags"] for one in row] for row in read]),
        masses,
    )


def _plane_positions(rig: RigFile, y_inboard: Array, y_outboard: Array) -> tuple[Array, Array, Array]:
    """Displacement at the inboard AMB, the outboard AMB and the motor from both sensor planes (T 6.7)."""
    machine = conventions(rig)
    inboard, outboard, motor = (rig.geometry[name].value for name in (*machine.ambs, "com_to_motor"))
    at = [displacement(y_inboard, y_outboard, machine.sensor_share(z, rig)) for z in (-inboard, outboard, motor)]
    return at[0], at[1], at[2]
