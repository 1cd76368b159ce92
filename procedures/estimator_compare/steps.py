"""From the recorded captures to arrays: position, velocity, disturbance and current of each switch and of each load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import STATUS, Status
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.requires import ENGAGE, HANG, captured
from procedures.one_axis.conventions import HARMONIC, LOAD, VELOCITY, conventions

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Taken:
    """A capture: what was done (`kind`), with which estimator, in which repeat; position `y` (n,) m, velocity `v` (n,) m/s,
    the estimated `disturbance` (n,) N and the control `current` (n,) A, empty where they were not captured."""

    kind: str
    estimator: str
    repeat: int
    y: Array
    v: Array
    disturbance: Array
    current: Array
    tick_s: float
    status: Status
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.estimator}, {'switched' if self.kind == ENGAGE else 'loaded'}, {self.repeat + 1}"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """All captures, in time order.

    Raises:
        AnalysisError: there are none, or one is missing.
    """
    found = [(kind, step) for kind in (ENGAGE, HANG) for step in recording.steps(kind)]
    if not found:
        raise AnalysisError("found no captures; expected those of the plan (was the run stopped early?)")
    return [_read(recording, *one) for one in sorted(found, key=lambda one: one[1].start_ns)]


def _read(recording: Recording[Plan], kind: str, step: Step) -> Taken:
    machine, labels = conventions(recording.rig), step.labels
    found = recording.captures(number=labels["number"])
    if not found:
        raise AnalysisError(f"step {dict(labels)}: found no capture")
    columns: Mapping[str, npt.NDArray[Any]] = found[0].arrays(*captured(machine, kind))
    told = step.read(STATUS)[STATUS].astype(np.int64)
    status = Status(int(np.bitwise_or.reduce(told)) if len(told) else 0)
    switched = kind == ENGAGE
    positive, negative = machine.currents
    return Taken(
        kind, str(labels["estimator"]), int(labels["repeat"]), columns[machine.position], columns[VELOCITY],
        columns[LOAD] + columns[HARMONIC] if switched else np.empty(0),
        (columns[positive] - columns[negative]) / 2 if switched else np.empty(0),
        1 / found[0].rate_hz, status, step.lost(), step.expected(),
    )  # fmt: skip


def of_kind(taken: Sequence[Taken], kind: str, estimator: str) -> list[Taken]:
    """Those of one estimator, by repeat."""
    return sorted((t for t in taken if (t.kind, t.estimator) == (kind, estimator)), key=lambda t: t.repeat)
