"""From the recorded captures to arrays: what was injected, the position as the law took it, the velocity beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import STATUS, Status
from procedures.derivative.plan import Plan
from procedures.one_axis.bank import Bank, bank
from procedures.one_axis.conventions import VELOCITY, conventions

Array = npt.NDArray[np.float64]
LINE, QUIET, OFFSET = "line", "quiet", "offset"
STEPS = (LINE, QUIET, OFFSET)


@dataclass(frozen=True)
class Taken:
    """A capture: `kind`, the line's `hz` or the set point `at` m, position `y` (n,) m and velocity `v` (n,) m/s, by ticks."""

    kind: str
    hz: float
    at: float
    y: Array
    v: Array
    tick_s: float
    status: Status
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return {LINE: f"{self.hz:g} Hz", QUIET: "quiet", OFFSET: f"{self.at * 1e6:+g} µm"}[self.kind]


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """All captures, in time order.

    Raises:
        AnalysisError: there are none, or one is missing.
    """
    found = [(kind, step) for kind in STEPS for step in recording.steps(kind)]
    if not found:
        raise AnalysisError("found no captures; expected those of the plan (was the run stopped early?)")
    return [_read(recording, *one) for one in sorted(found, key=lambda one: one[1].start_ns)]


def _read(recording: Recording[Plan], kind: str, step: Step) -> Taken:
    machine, labels = conventions(recording.rig), step.labels
    captured = recording.captures(number=labels["number"])
    if not captured:
        raise AnalysisError(f"step {dict(labels)}: found no capture")
    columns: dict[str, npt.NDArray[Any]] = captured[0].arrays(*machine.captured)
    told = step.read(STATUS)[STATUS].astype(np.int64)
    status = Status(int(np.bitwise_or.reduce(told)) if len(told) else 0)
    return Taken(
        kind, float(labels["hz"]), float(labels["at_m"]), columns[machine.position], columns[VELOCITY],
        1 / captured[0].rate_hz, status, step.lost(), step.expected(),
    )  # fmt: skip


def lines_of(taken: Sequence[Taken]) -> list[Taken]:
    """Those with a line, by frequency."""
    return sorted((t for t in taken if t.kind == LINE), key=lambda t: t.hz)


def asked(plan: Plan, tick_s: float) -> Bank:
    """The weights of what the firmware was told to do."""
    return bank(plan.degree, round(plan.window_s / tick_s), plan.rule, tick_s)
