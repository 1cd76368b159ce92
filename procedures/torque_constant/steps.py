"""From the recorded steps of a torque calibration to arrays: loads on the lever, detent, and the wiring of the segments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.torque_constant.fit import Steps, resting

Array = npt.NDArray[np.float64]


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded while loads hang on the lever."""
    return ("angle", *machine.segments, *machine.coils_of("xo", "yo"), "flags")


@dataclass(frozen=True)
class TorqueData:
    """`steps` for the fit; per step (n,): `drift` of the torque current (second half less first) A, `length` s, control
    current of the outboard AMB `side_x`, `side_y` A, `lost`, `expected`, `flags`, `spread` (n, 4) of the segments' samples A.

    `detent_angle`, `detent_current` (m,): rad and A without load over a period of the detent.
    `wiring` (2, 2): control current x, y of the outboard AMB in A per A of i_x, i_y.
    """

    steps: Steps
    masses: tuple[str, ...]
    drift: Array
    length: Array
    side_x: Array
    side_y: Array
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]
    spread: Array
    detent_angle: Array
    detent_current: Array
    wiring: Array

    def where(self, k: int) -> str:
        """How a step is named to the reader."""
        s = self.steps
        what = f"{self.masses[s.load[k]]} on the {'left' if s.side[k] > 0 else 'right'}" if s.side[k] else "no load"
        return f"gamma {np.degrees(s.gamma[k]):+.2f} deg, {what}"

    def worst(self, values: Array) -> str:
        """The name of the step with the greatest of `values` (n,)."""
        return self.where(int(np.argmax(values)))


def read_torques(recording: Recording[Any], masses: tuple[str, ...], count: float) -> TorqueData:
    """Read all steps.

    Raises:
        AnalysisError: there are none, or too few samples in one.
    """
    found = list(recording.steps("lever"))
    if not found:
        raise AnalysisError("found no loads on the lever (was the run stopped early?)")
    machine = conventions(recording.rig)
    read = [_reduce(step, machine) for step in found]
    index = {"": -1} | {label: k for k, label in enumerate(masses)}
    if strange := sorted({str(s.labels["load"]) for s in found} - set(index)):
        raise AnalysisError(
            f"masses: found {', '.join(strange)} on the lever; expected those of the plan, {', '.join(masses)}"
        )
    sides = {"left": 1, "right": -1, "": 0}
    start = found[0].start_ns
    steps = Steps(
        np.array([r["segments"] for r in read]), resting(np.array([r["angle"] for r in read]), count),
        np.array([float(s.labels["gamma_rad"]) for s in found]),
        np.array([(s.start_ns + s.end_ns) / 2 - start for s in found]) * 1e-9,
        np.array([sides[str(s.labels["side"])] for s in found]), np.array([index[str(s.labels["load"])] for s in found]),
        np.array([r["jumps"] for r in read]),
    )  # fmt: skip
    turned = [_reduce(step, machine) for step in recording.steps("detent")]
    return TorqueData(
        steps, masses, np.array([r["drift"] for r in read]),
        np.array([(s.end_ns - s.start_ns) * 1e-9 for s in found]),
        np.array([r["x"] for r in read]), np.array([r["y"] for r in read]),
        np.array([float(s.lost()) for s in found]), np.array([float(s.expected()) for s in found]),
        np.array([r["flags"] for r in read]), np.array([r["spread"] for r in read]),
        np.array([r["angle"] for r in turned]), np.array([r["segments"].mean() for r in turned]),
        _wiring(recording, machine),
    )  # fmt: skip


def _reduce(step: Step, machine: Servomotor) -> Mapping[str, Any]:
    data = step.read(*channels(machine))
    n = len(data["angle"])
    if n < 20:
        raise AnalysisError(f"step {dict(step.labels)}: found {n} samples; expected 20 or more")
    segments = np.array([data[c] for c in machine.segments])
    current = segments.mean(axis=0)
    return {
        "segments": segments.mean(axis=1), "spread": segments.std(axis=1), "angle": float(np.unwrap(data["angle"]).mean()),
        "jumps": float(current.std()), "drift": float(current[n // 2 :].mean() - current[: n // 2].mean()),
        "x": float(machine.control("xo", data.__getitem__).mean()), "y": float(machine.control("yo", data.__getitem__).mean()),
        "flags": int(np.bitwise_or.reduce(data["flags"].astype(np.int64))),
    }  # fmt: skip


def _wiring(recording: Recording[Any], machine: Servomotor) -> Array:
    """Slopes of the outboard AMB's control currents over i_x and i_y, from the steps at plus and minus."""
    found = [(float(s.labels["i_x"]), float(s.labels["i_y"]), _reduce(s, machine)) for s in recording.steps("wiring")]
    if not found:
        return np.zeros((2, 2))
    asked = np.array([[1.0, x, y] for x, y, _ in found])
    answers = np.array([[r["x"], r["y"]] for _, _, r in found])
    slopes: Array = np.linalg.lstsq(asked, answers, rcond=None)[0][1:].T
    return slopes
