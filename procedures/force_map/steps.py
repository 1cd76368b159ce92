"""From the recorded points of a force map to arrays of step means, and what their signals can say about what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile.roles import STATUS
from procedures.force_map.plan import Plan
from procedures.force_map.requires import channels
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.shared.step_table import Labels, Samples, StepTable, tabulate

Array = npt.NDArray[np.float64]
WANDER_N = (
    0.05  # of the motor's force between two points of an angle at which nothing is set; constants then move by half a U
)
SLIP = 0.1  # of the torque current of a load; friction makes 2 %
SIGNIFICANT = 6.0  # standard uncertainties


@dataclass(frozen=True)
class AtPoint(Labels):
    """The angle by its index, the load on the lever, and what is set: currents, references of the outboard AMB."""

    kind: ClassVar[str] = "point"
    turn: int
    side: str
    load: str
    i_y_A: float
    i_x_A: float
    y_m: float
    x_m: float


@dataclass(frozen=True)
class MapData:
    """The `table` (n,) of the points, with the inboard AMB's control current as "control", A. By point: index of the
    calibration's `angle`; `group`, equal where angle and load are, with the `loads` by group."""

    table: StepTable[AtPoint]
    angle: npt.NDArray[np.int64]
    group: npt.NDArray[np.int64]
    loads: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.angle)


def read_points(recording: Recording[Any]) -> MapData:
    """Every point, in time order.

    Raises:
        AnalysisError: there are none, or one holds no samples.
    """
    steps = list(recording.steps(AtPoint.kind))
    if not steps:
        raise AnalysisError("found no points; expected those of the plan (was the run stopped early?)")
    machine = conventions(recording.rig)
    read = channels(machine)

    def samples(step: Step) -> Samples:
        data = step.read(*read, STATUS)
        if len(data[STATUS]) < 2:
            raise AnalysisError(f"point {dict(step.labels)}: found no samples")
        return data | {"control": machine.control("yi", data.__getitem__)}

    table = tabulate(steps, AtPoint, (*read, "control"), read=samples)
    keys = [(point.turn, f"{point.side} {point.load}".strip()) for point in table.labels]
    groups = list(dict.fromkeys(keys))
    return MapData(
        table,
        np.array([turn for turn, _ in keys]),
        np.array([groups.index(key) for key in keys]),
        tuple(load for _, load in groups),
    )


def of_signals(data: MapData, machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Lost samples, stuck channels, limits, contact, points that had not settled."""
    table = data.table
    lost = float((table.lost / np.maximum(table.expected, 1)).max())
    if lost > plan.max_lost:
        yield Finding("missing-samples", f"{lost:.2%} of the samples of a point are missing ({plan.max_lost:.2%} is "
                      "allowed). Look at the link: load, cable, gateway.", "", Effect.INDETERMINATE)  # fmt: skip
    for channel in channels(machine):
        if count := int((table.ptp[channel] == 0).sum()):
            text = f"{channel} does not move at all in {count} of {len(data)} points; a live sensor has noise."
            yield Finding("stuck-channel", text, channel, Effect.ERROR)
    for bits, code, text in (
        (machine.amb_limit, "current-saturated", "an AMB amplifier was at its limit"),
        (machine.segment_limit, "current-saturated", "a segment of the motor was at its limit"),
        (machine.contact, "contact", "the rotor touched a touchdown bearing"),
    ):
        if hit := int(((table.flags & bits) != 0).sum()):
            yield Finding(code, f"{text} in {hit} of {len(data)} points", "", Effect.INDETERMINATE)
    worst = float(np.abs(table.drift["control"]).max())
    if worst > plan.max_drift_A:
        yield Finding("unsettled", f"the inboard control current drifts by {worst * 1e3:.1f} mA within a point "
                      f"({plan.max_drift_A * 1e3:g} mA allowed): settle longer.", "", Effect.INDETERMINATE)  # fmt: skip


def drifts(data: MapData, force: Array, i_theta: Array) -> Iterator[Finding]:
    """Each angle and load begins and ends with nothing set: what differs then has drifted meanwhile, and is no constant's.
    `force` of the motor, N, and torque current, A, of every point."""
    first, last = np.array([np.flatnonzero(data.group == g)[[0, -1]] for g in np.unique(data.group)]).T
    apart = force[last] - force[first]
    mean, u = float(apart.mean()), float(apart.std(ddof=1)) / math.sqrt(len(apart))
    if abs(mean) > max(WANDER_N, SIGNIFICANT * u):
        text = (f"with nothing set the motor's force is {mean:+.3g} N more at the end of an angle than at its start "
                f"({WANDER_N:g} N allowed): a coil sensor of the inboard AMB's vertical axis drifts, or that of segment 1 or 3."
                )  # fmt: skip
        yield Finding("drifting-sensor", text, "i_yi", Effect.INDETERMINATE)
    for a, b in zip(first, last, strict=True):
        if data.loads[data.group[a]] and abs(i_theta[b] - i_theta[a]) > SLIP * abs(i_theta[a]):
            took = f"{i_theta[a]:+.3f} A of torque current at first and {i_theta[b]:+.3f} A in the end"
            text = f"the load took {took}: does it slip?"
            yield Finding("lever-slips", text, data.loads[data.group[a]], Effect.INDETERMINATE)
