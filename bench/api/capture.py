"""A capture of a run: what the controller recorded inside itself at full rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.api.channel import Channel
from bench.api.pages import unknown
from bench.errors import ConfigError
from bench.recording import Captured, Step

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Capture:
    """One capture; `capture["pos_x"]` is a channel of it, on the time axis of the run's telemetry."""

    captured: Captured
    _steps: Callable[..., list[Step]]
    _origin_ns: int

    @property
    def labels(self) -> Mapping[str, Any]:
        """What it was taken with."""
        return self.captured.labels

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return self.captured.rate_hz

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of its channels."""
        return self.captured.channels

    def __getitem__(self, name: str) -> Channel:
        """A channel of it.

        Raises:
            ConfigError: it was not captured.
        """
        if name not in self.channels:
            what = self.captured.stream
            raise ConfigError(unknown(f"{what}: found no channel {name!r}", name, list(self.channels)))
        read = self.captured.arrays(name)
        layout = self.captured.recording.capture_streams[self.captured.stream]
        unit = next(c.unit for c in layout.channels if c.name == name)
        count = np.arange(len(read["t_s"]))
        return Channel(
            name, unit, read[name], (read["t_ns"] - self._origin_ns) / 1e9, count, self._steps, self._origin_ns
        )

    def to_pandas(self) -> pd.DataFrame:
        """All its channels side by side, by `t_s`."""
        return self.captured.frame()

    def __repr__(self) -> str:
        what = f"{self.captured.samples} samples of {', '.join(self.channels)} at {self.rate_hz:g} Hz"
        return f"<Capture {self.captured.stream}: {what}>"
