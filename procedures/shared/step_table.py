"""Recorded steps as arrays: what each says of its channels, how it is labelled, and what was lost of it.

A kind of step is a class with its labels as fields: `record_step` writes them, `tabulate` reads them back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording.earlier import AGAIN
from bench.recording.recorder import Recorder
from bench.recording.steps import Step, Steps
from bench.rigfile.roles import STATUS

Array = npt.NDArray[np.float64]
Samples = Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Labels:
    """Labels of a kind of step; `str` of them is what the reader of a finding calls the step."""

    kind: ClassVar[str]


Kind = TypeVar("Kind", bound=Labels, covariant=True)
Read = TypeVar("Read", bound=Labels)


def record_step(record: Recorder, labels: Labels, *, again: bool = False) -> AbstractContextManager[None]:
    """A step with these labels; `again`: it repeats one of a stopped run that goes on, and is of a kind of its own."""
    return record.step(f"{labels.kind}{AGAIN}" if again else labels.kind, **asdict(labels))


@dataclass(frozen=True)
class StepTable(Generic[Kind]):
    """One entry per step: (N,) in time order, or (A, P) by angle and time. By channel `mean`, `drift` (second half less first
    half of the step), `spread` (standard deviation of the samples) and `ptp` (greatest less least); `start_ns`, `end_ns`;
    `lost` and `expected` samples; `flags` ORed over the step. `labels` are those of the N steps."""

    mean: dict[str, Array]
    drift: dict[str, Array]
    spread: dict[str, Array]
    ptp: dict[str, Array]
    labels: tuple[Kind, ...]
    start_ns: npt.NDArray[np.int64]
    end_ns: npt.NDArray[np.int64]
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def time_s(self) -> Array:
        """Middle of each step in s since the middle of the first."""
        middle = (self.start_ns + self.end_ns) / 2
        out: Array = (middle - middle.flat[0]) * 1e-9
        return out

    def where(self, values: Array) -> str:
        """The name of the step with the greatest of `values`."""
        return str(self.labels[int(np.argmax(values))])

    def each(self, label: Callable[[Kind], float]) -> Array:
        """A label of every step."""
        return np.array([float(label(one)) for one in self.labels]).reshape(self.flags.shape)

    def stack(self, channels: Sequence[str]) -> Array:
        """Means (C, N) or (C, A, P) of several channels."""
        return np.stack([self.mean[c] for c in channels])


def tabulate(
    steps: Sequence[Step],
    kind: type[Read],
    channels: Sequence[str],
    *,
    shape: tuple[int, ...] = (-1,),
    read: Callable[[Step], Samples] | None = None,
) -> StepTable[Read]:
    """The steps, which are of this kind, with `channels` reduced. `read` gives the samples where they are not just those of the
    channels: one array (n,) for each, and `flags`.

    Raises:
        AnalysisError: a step holds fewer than two samples.
    """
    read = read or (lambda step: step.read(*channels, STATUS))
    rows = [reduced(read(step), channels, step.labels) for step in steps]

    def array(values: Sequence[Any]) -> npt.NDArray[Any]:
        return np.array(values).reshape(shape)

    def by_channel(kind: str) -> dict[str, Array]:
        return {c: array([row[kind][c] for row in rows]) for c in channels}

    return StepTable(
        by_channel("mean"), by_channel("drift"), by_channel("spread"), by_channel("ptp"),
        tuple(kind(**{field.name: s.labels[field.name] for field in fields(kind)}) for s in steps),
        array([s.start_ns for s in steps]), array([s.end_ns for s in steps]),
        array([float(s.lost()) for s in steps]), array([float(s.expected()) for s in steps]),
        array([row["flags"] for row in rows]),
    )  # fmt: skip


def of_samples(
    labels: Sequence[Read],
    samples: Sequence[Mapping[str, Array]],
    t_ns: Sequence[int],
    *,
    shape: tuple[int, ...] = (-1,),
) -> StepTable[Read]:
    """Steps as a run sees them while it goes on, from the samples (n,) of each channel and the time at which they were there:
    means and drifts; nothing scatters or is lost."""

    def each(of: Callable[[Array], float]) -> dict[str, Array]:
        return {c: np.array([of(step[c]) for step in samples]).reshape(shape) for c in samples[0]}

    def drift(x: Array) -> float:
        return float(x[len(x) // 2 :].mean() - x[: len(x) // 2].mean()) if len(x) > 1 else 0.0

    mean, none = each(lambda x: float(x.mean())), np.zeros(len(labels)).reshape(shape)
    nothing, at = dict.fromkeys(mean, none), np.array(t_ns, np.int64).reshape(shape)
    return StepTable(mean, each(drift), nothing, nothing, tuple(labels), at, at, none, none, none.astype(np.int64))


def by_angle(steps: Steps, what: str) -> tuple[list[Step], tuple[int, int]]:
    """The steps, those of one angle after those of the other, and how many angles and steps per angle (A, P) there are.

    Raises:
        AnalysisError: there are no steps, or an angle lacks some; `what` they are called.
    """
    rows = [row for _, row in steps.by("angle_rad")]
    counts = {len(row) for row in rows}
    if len(counts) != 1:
        raise AnalysisError(
            f"{what} per angle: found {sorted(counts) or 'none'}; expected the same number at each angle "
            "(was the run stopped early?)"
        )
    return [step for row in rows for step in row], (len(rows), counts.pop())


def reduced(data: Samples, channels: Sequence[str], labels: Mapping[str, Any]) -> dict[str, Any]:
    """`mean`, `drift` (second half less first half), `spread` and `ptp` by channel, and `flags`, the bits or-ed together.

    `data` are the samples of a step, one array (n,) for each of the `channels` and for `flags`; `labels` name the step.

    Raises:
        AnalysisError: a channel has fewer than two samples.
    """
    x = np.array([data[c] for c in channels])  # all at once: a look at each channel costs more than the sums
    half = x.shape[1] // 2
    if half == 0:
        raise AnalysisError(f"step {dict(labels)}: found {x.shape[1]} samples of {channels[0]}; expected at least 2")
    drift = x[:, half:].mean(axis=1) - x[:, :half].mean(axis=1)
    ptp = np.ptp(x, axis=1)
    spread = np.where(ptp > 0, x.std(axis=1), 0.0)  # of a constant the mean is rounded, and it would not be nothing
    found = (("mean", x.mean(axis=1)), ("drift", drift), ("spread", spread), ("ptp", ptp))
    out: dict[str, Any] = {kind: dict(zip(channels, values, strict=True)) for kind, values in found}
    out["flags"] = int(np.bitwise_or.reduce(data[STATUS].astype(np.int64)))
    return out
