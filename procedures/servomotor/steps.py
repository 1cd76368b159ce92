"""From the recorded steps of a shaft that the motor or the AMBs displace to arrays: step means, drifts, losses, flags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.shared.step_table import reduced

Array = npt.NDArray[np.float64]
POSITIONS = ("yi", "yo", "xi", "xo")
"""Axes in the order in which they are read."""


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a displaced shaft."""
    return (*machine.segments, *machine.coils_of("yi", "yo"), *machine.positions_of(*POSITIONS), "angle", "flags")


@dataclass(frozen=True)
class StepMeans:
    """Steps of one kind in time order, N of them. Per channel (N,): `mean`, `drift` (second half less first half of the
    step), `spread` (standard deviation of the samples); `time_s` of the middle since the first; `labels` of each step;
    `lost` and `expected` samples; `flags` ORed over the step; `names` for the reader."""

    mean: dict[str, Array]
    drift: dict[str, Array]
    spread: dict[str, Array]
    time_s: Array
    labels: dict[str, Array]
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.time_s)

    def where(self, values: Array) -> str:
        """The name of the step with the greatest of `values` (N,)."""
        return self.names[int(np.argmax(values))]

    def stack(self, channels: Sequence[str]) -> Array:
        """Means (C, N) of several channels."""
        return np.array([self.mean[c] for c in channels])

    def only(self, chosen: npt.NDArray[np.bool_]) -> StepMeans:
        """The steps that `chosen` (N,) marks."""

        def cut(table: dict[str, Array]) -> dict[str, Array]:
            return {k: v[chosen] for k, v in table.items()}

        names = tuple(n for n, keep in zip(self.names, chosen, strict=True) if keep)
        return StepMeans(cut(self.mean), cut(self.drift), cut(self.spread), self.time_s[chosen], cut(self.labels),
                         self.lost[chosen], self.expected[chosen], self.flags[chosen], names)  # fmt: skip


def read_steps(
    recording: Recording[Any], kind: str, labels: Sequence[str], name: Callable[[dict[str, Any]], str]
) -> StepMeans:
    """Read every step of `kind` with its numeric `labels`; `name` makes the reader's name from a step's labels.

    Raises:
        AnalysisError: there are no steps, or one of them holds no samples.
    """
    steps = list(recording.steps(kind))
    if not steps:
        raise AnalysisError(f"steps of kind {kind!r}: found none; expected the run's (was it stopped early?)")
    names = channels(conventions(recording.rig))
    read = [_reduce(step, names) for step in steps]
    middle = np.array([(s.start_ns + s.end_ns) / 2 for s in steps])
    return StepMeans(
        {c: np.array([r["mean"][c] for r in read]) for c in names},
        {c: np.array([r["drift"][c] for r in read]) for c in names},
        {c: np.array([r["spread"][c] for r in read]) for c in names},
        (middle - middle[0]) * 1e-9,
        {key: np.array([float(s.labels[key]) for s in steps]) for key in labels},
        np.array([float(s.lost()) for s in steps]),
        np.array([float(s.expected()) for s in steps]),
        np.array([r["flags"] for r in read]),
        tuple(name(dict(s.labels)) for s in steps),
    )


def _reduce(step: Step, names: tuple[str, ...]) -> dict[str, Any]:
    data = step.read(*names)
    data["angle"] = (data["angle"] + np.pi) % (2 * np.pi) - np.pi  # home is angle 0: no mean across the turn's end
    return reduced(data, names, step.labels)
