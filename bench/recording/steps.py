"""Steps of a recording: labelled intervals, and how they are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording.source import Source

# A block tells when its first samples came, to some 0.1 s: what is later than so much is no matter of blocks.
LATE_S = 0.5


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

    def late(self, stream: str = "telemetry") -> tuple[int, float]:
        """How many of its samples came LATE_S or more later than the timeliest of the recording, and how much later the latest
        of them did, s."""
        whole = [(block.host_ns - int(block.t_ns[0]), block.t_ns) for block in self.recording.blocks(stream)]
        least = min((lateness for lateness, _ in whole), default=0)
        count, most = 0, 0.0
        for lateness, t_ns in whole:
            low, high = np.searchsorted(t_ns, [self.start_ns, self.end_ns])
            if high > low and (late := (lateness - least) * 1e-9) >= LATE_S:
                count, most = count + int(high - low), max(most, late)
        return count, most


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
