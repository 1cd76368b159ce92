"""Samples: what decoded telemetry is between the decoder, the recorder and the reader."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

TICKS = "controller.tick"
"""Among samples by channel, the device's ticks; no channel's name has a dot."""


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel of a stream: name, SI unit, and numpy type on file ("f4" values, "f8" times of the device, "u2" codes)."""

    name: str
    unit: str
    dtype: str = "f4"


@dataclass(frozen=True)
class StreamLayout:
    """A stream: samples of all its channels at one period."""

    name: str
    period_ns: int
    channels: tuple[ChannelInfo, ...]


@dataclass(frozen=True)
class SampleBlock:
    """n consecutive samples. `first_index` counts samples since the start, those lost included; `lost_before` is how
    many are missing just before this block; `ticks` (n,) are the device's, `t_ns` (n,) the sample clock's."""

    stream: str
    first_index: int
    ticks: npt.NDArray[np.uint64]
    t_ns: npt.NDArray[np.int64]
    host_ns: int
    lost_before: int
    columns: Mapping[str, npt.NDArray[np.float64]]
    table: npt.NDArray[np.float64] | None = None
    """The columns as (channels, n), where they are rows of one array."""

    def __len__(self) -> int:
        return len(self.ticks)
