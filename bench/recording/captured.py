"""A capture read back from a recording: a full-rate stream on its own sample clock, on the same time axis as the telemetry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording.source import Source

if TYPE_CHECKING:
    import pandas as pd

CAPTURES: Final = "capture/"
"""What the names of their streams begin with."""


@dataclass(frozen=True)
class Captured:
    """One capture. `labels` are those it was uploaded with.

    Attributes:
        stream: `capture/1`, `capture/2`, ...
        rate_hz: samples a second.
        first_tick: control tick of the first sample, as the telemetry counts.
        start_ns: time of the first sample on the sample clock.
        trigger: index of the sample at the trigger.
        waited_for: what the trigger was: `kind`, `channel`, `level`.
    """

    recording: Source
    stream: str
    labels: Mapping[str, Any]
    rate_hz: float
    first_tick: int
    start_ns: int
    trigger: int
    samples: int
    waited_for: Mapping[str, Any]

    @classmethod
    def of(cls, recording: Source, event: Mapping[str, Any]) -> Captured:
        """What a `capture` event of a recording tells of."""
        names = ("stream", "labels", "rate_hz", "first_tick", "start_ns", "trigger", "samples", "waited_for")
        return cls(recording, **{name: event[name] for name in names})

    @property
    def channels(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(c.name for c in self.recording.capture_streams[self.stream].channels)

    @property
    def trigger_ns(self) -> int:
        """Time of the sample at the trigger."""
        return self.start_ns + round(self.trigger * 1e9 / self.rate_hz)

    def arrays(self, *channels: str) -> dict[str, npt.NDArray[Any]]:
        """Samples (n,) in SI by channel, float64, all channels by default; with `t_s`, seconds on the telemetry's clock
        since its first sample, `t_ns` and `tick`.

        Raises:
            AnalysisError: a channel that was not captured, or samples are missing from the file.
            RecordingError: more numbers than the limits allow.
        """
        chosen = channels or self.channels
        if missing := [name for name in chosen if name not in self.channels]:
            raise AnalysisError(f"{self.stream}: found no {', '.join(missing)}; it holds {', '.join(self.channels)}")
        self.recording.limit_samples(self.samples * (len(chosen) + 3))
        blocks = list(self.recording.blocks(self.stream))
        if sum(b.count for b in blocks) != self.samples:
            raise AnalysisError(f"{self.stream}: found {sum(b.count for b in blocks)} samples; expected {self.samples}")
        t_ns = np.concatenate([b.t_ns for b in blocks])
        out: dict[str, npt.NDArray[Any]] = {"t_s": (t_ns - self.recording.start_ns) * 1e-9, "t_ns": t_ns}
        out["tick"] = np.concatenate([b.ticks for b in blocks]).astype(np.int64)
        return out | {name: np.concatenate([b.columns[name] for b in blocks]).astype(np.float64) for name in chosen}

    def frame(self, *channels: str) -> pd.DataFrame:
        """As `arrays`, indexed by `t_s`."""
        import pandas as pd  # slow to import, and nobody who measures needs it

        columns = self.arrays(*channels)
        index = pd.Index(columns["t_s"], name="t_s")
        return pd.DataFrame({k: v for k, v in columns.items() if k not in ("t_s", "t_ns")}, index=index)
