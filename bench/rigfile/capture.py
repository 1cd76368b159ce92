"""Captures: what a controller can record in its own memory at its full rate, what it waits for, and the buffer's layout.

A buffer is samples one after the other. A sample is one number for each recorded channel, in order of the channels'
indexes, little endian, without gaps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from bench.errors import BenchError
from bench.rigfile.part import Part

MESSAGES: Final = (
    "CaptureArm",
    "CaptureAsk",
    "CaptureRead",
    "CaptureFlow",
    "CaptureStatus",
    "CaptureBlock",
    "CaptureData",
)
BY_BLOCKS: Final = ("CaptureFlow", "CaptureBlock")
"""Those of them that only a capture in blocks of ISO 15765-2 needs."""
INDEXES: Final = 64
LONGEST_DIVIDER: Final = 0xFFFF
TYPES: Final = {"i16": "<i2", "u16": "<u2", "i32": "<i4", "u32": "<u4", "f32": "<f4"}
Kind = Literal["NOW", "RISES", "FALLS", "PULSE", "SPEED"]


class CaptureChannel(Part):
    """What can be recorded: bit `index` asks for it; value in SI = number of type `type` times `scale`."""

    index: int = Field(ge=0, lt=INDEXES)
    unit: str
    type: Literal["i16", "u16", "i32", "u32", "f32"]
    scale: float = Field(1.0, gt=0)
    about: str = ""


class CaptureSpec(Part):
    """The rig file's table `capture`."""

    memory_bytes: int = Field(gt=0, le=0xFFFFFFFF)
    channels: Mapping[str, CaptureChannel] = Field(min_length=1)


@dataclass(frozen=True)
class Trigger:
    """What a capture waits for. `level` is the channel's, or for SPEED the speed in rad/s, reached from either side."""

    kind: Kind
    channel: str = ""
    level: float = 0.0


NOW: Final = Trigger("NOW")
PULSE: Final = Trigger("PULSE")
"""The next once-per-turn pulse."""


def rises(channel: str, level: float) -> Trigger:
    """A channel crosses a level (SI) upwards: below it in one tick, at or above it in the next."""
    return Trigger("RISES", channel, level)


def falls(channel: str, level: float) -> Trigger:
    """A channel crosses a level (SI) downwards."""
    return Trigger("FALLS", channel, level)


def at_speed(rad_s: float) -> Trigger:
    """The rotor reaches a speed, from below or from above."""
    return Trigger("SPEED", level=rad_s)


@dataclass(frozen=True)
class CaptureData:
    """A capture that was uploaded: for deciding how to go on; results come from the recording.

    `trigger` is the index of the sample at the trigger, `start_ns` the first sample's time on the sample clock, `columns`
    values in SI (n,) by channel.
    """

    stream: str
    rate_hz: float
    first_tick: int
    start_ns: int
    trigger: int
    columns: Mapping[str, npt.NDArray[np.float64]]


@dataclass(frozen=True)
class Layout:
    """Which channels a buffer holds, in order of their indexes."""

    channels: Mapping[str, CaptureChannel]

    @classmethod
    def of(cls, spec: CaptureSpec, names: Sequence[str]) -> Layout:
        """The layout of a choice of channels.

        Raises:
            BenchError: none is chosen, or one that the controller cannot record.
        """
        if unknown := [n for n in names if n not in spec.channels]:
            known = ", ".join(spec.channels)
            raise BenchError(f"capture: the controller cannot record {', '.join(unknown)}; it can record {known}")
        if not names:
            raise BenchError("capture: no channel is chosen")
        chosen = sorted(set(names), key=lambda n: spec.channels[n].index)
        return cls({n: spec.channels[n] for n in chosen})

    @property
    def mask(self) -> int:
        """A bit for each index."""
        return sum(1 << c.index for c in self.channels.values())

    @property
    def sample(self) -> np.dtype[Any]:
        """One sample."""
        return np.dtype([(name, TYPES[c.type]) for name, c in self.channels.items()])

    def encoded(self, columns: Sequence[npt.NDArray[np.float64]]) -> bytes:
        """The buffer of columns (n,) in SI, one for each channel; what a type cannot hold is its nearest end."""
        out = np.empty(len(columns[0]), self.sample)
        for (name, c), x in zip(self.channels.items(), columns, strict=True):
            if c.type == "f32":
                out[name] = x / c.scale
            else:
                limits = np.iinfo(TYPES[c.type])
                out[name] = np.clip(np.rint(x / c.scale), limits.min, limits.max)
        return out.tobytes()

    def decoded(self, buffer: bytes) -> dict[str, npt.NDArray[np.float64]]:
        """Values in SI (n,) by channel.

        Raises:
            BenchError: the buffer does not hold whole samples.
        """
        size = self.sample.itemsize
        if len(buffer) % size:
            raise BenchError(f"capture: found {len(buffer)} bytes; expected whole samples of {size} bytes")
        rows = np.frombuffer(buffer, self.sample)
        with np.errstate(invalid="ignore"):  # a controller may send any pattern of a NaN; a signalling one is a NaN too
            return {name: rows[name].astype(np.float64) * c.scale for name, c in self.channels.items()}
