"""Steps of a recording: labelled intervals, and how they are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording.source import Source


@dataclass(frozen=True, slots=True)
class Step:
    """A labelled interval."""

    recording: Source
    kind: str
    labels: Mapping[str, Any]
    start_ns: int
    end_ns: int

    def read(self, *channels: str) -> dict[str, npt.NDArray[Any]]:
        """float64 samples by channel, with `t_ns` and `index`."""
        return self.recording.read(channels, self.start_ns, self.end_ns)

    def mean(self, channel: str) -> float:
        """Mean of a channel over the step.

        Raises:
            AnalysisError: the step holds no sample.
        """
        x = self.read(channel)[channel]
        if len(x) == 0:
            raise AnalysisError(f"step {self.kind} {dict(self.labels)}: no samples of {channel}")
        return float(x.mean())

    def expected(self, stream: str = "telemetry") -> int:
        """Samples that the step should hold at the stream's period."""
        return round((self.end_ns - self.start_ns) / self.recording.streams[stream].period_ns)

    def lost(self, stream: str = "telemetry") -> int:
        """Samples of the stream that are missing from the step."""
        return self.recording.lost(stream, self.start_ns, self.end_ns)


@dataclass(frozen=True)
class Steps:
    """Steps in time order."""

    items: tuple[Step, ...]

    def __iter__(self) -> Iterator[Step]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)

    def by(self, label: str) -> Iterator[tuple[Any, list[Step]]]:
        """Groups of equal label, in order of first appearance."""
        groups: dict[Any, list[Step]] = {}
        for step in self.items:
            groups.setdefault(step.labels[label], []).append(step)
        yield from groups.items()
