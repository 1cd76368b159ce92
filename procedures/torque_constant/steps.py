"""From the recorded steps of a torque calibration to arrays: loads on the lever, detent, and the wiring of the segments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.loads import load_index
from procedures.shared.step_table import Samples, StepTable, tabulate
from procedures.torque_constant.fit import Steps, resting
from procedures.torque_constant.plan import Plan

Array = npt.NDArray[np.float64]


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded while loads hang on the lever."""
    return ("angle", *machine.segments, *machine.coils_of("xo", "yo"), "flags")


@dataclass(frozen=True)
class TorqueData:
    """`steps` for the fit, and the `table` (n,) of these steps, with the torque current as "torque" and the outboard AMB's
    control currents as "side_x", "side_y", A.

    `detent_angle`, `detent_current` (m,): rad and A without load over a period of the detent.
    `wiring` (2, 2): control current x, y of the outboard AMB in A per A of i_x, i_y.
    """

    steps: Steps
    masses: tuple[str, ...]
    table: StepTable
    detent_angle: Array
    detent_current: Array
    wiring: Array


def read_torques(recording: Recording[Plan]) -> TorqueData:
    """Read all steps.

    Raises:
        AnalysisError: there are none, too few samples in one, or what hung is no mass of the plan.
    """
    found = list(recording.steps("lever"))
    if not found:
        raise AnalysisError("found no loads on the lever (was the run stopped early?)")
    machine, masses = conventions(recording.rig), recording.plan.masses
    table = _table(found, machine)
    load = load_index(table.labels["load"], masses, "lever")
    sides = {"left": 1, "right": -1, "": 0}
    steps = Steps(
        np.ascontiguousarray(table.stack(machine.segments).T),
        resting(table.mean["angle"], recording.plan.count_rad),
        table.labels["gamma_rad"],
        ((table.start_ns + table.end_ns) / 2 - table.start_ns[0]) * 1e-9,
        np.array([sides[side] for side in table.labels["side"]]),
        load,
        table.spread["torque"],
    )
    detent = _table(list(recording.steps("detent")), machine)
    return TorqueData(
        steps, masses, table, detent.mean["angle"], detent.stack(machine.segments).mean(axis=0),
        _wiring(_table(list(recording.steps("wiring")), machine)),
    )  # fmt: skip


def _table(steps: list[Step], machine: Servomotor) -> StepTable:
    return tabulate(steps, (*machine.segments, "angle", "torque", "side_x", "side_y"), _name, read=_reading(machine))


def _name(labels: Mapping[str, Any]) -> str:
    if "gamma_rad" not in labels:
        return "no load"
    what = f"{labels['load'] or 'nothing'} on the {labels['side']}" if labels["side"] else "no load"
    return f"gamma {np.degrees(labels['gamma_rad']):+.2f} deg, {what}"


def _reading(machine: Servomotor) -> Callable[[Step], Samples]:
    def read(step: Step) -> Samples:
        data = step.read(*channels(machine))
        n = len(data["angle"])
        if n < 20:
            raise AnalysisError(f"step {dict(step.labels)}: found {n} samples; expected 20 or more")
        data["angle"] = np.unwrap(data["angle"])
        data["torque"] = np.array([data[c] for c in machine.segments]).mean(axis=0)
        data |= {f"side_{axis}": machine.control(f"{axis}o", data.__getitem__) for axis in "xy"}
        return data

    return read


def _wiring(table: StepTable) -> Array:
    """Slopes of the outboard AMB's control currents over i_x and i_y, from the steps at plus and minus."""
    if not len(table):
        return np.zeros((2, 2))
    asked = np.stack([np.ones(len(table)), table.labels["i_x"], table.labels["i_y"]], axis=-1)
    answers = np.stack([table.mean["side_x"], table.mean["side_y"]], axis=-1)
    slopes: Array = np.linalg.lstsq(asked, answers, rcond=None)[0][1:].T
    return slopes
