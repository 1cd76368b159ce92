"""What steps and captures read from: the part of a recording that they need."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy.typing as npt

from bench.recording.layout import DecodedBlock
from bench.rigfile import RigFile
from bench.samples import StreamLayout


class Source(Protocol):
    """A recording, closed; see `bench.recording.Recording` for each."""

    @property
    def rig(self) -> RigFile: ...
    @property
    def start_ns(self) -> int: ...
    @property
    def streams(self) -> Mapping[str, StreamLayout]: ...
    @property
    def capture_streams(self) -> Mapping[str, StreamLayout]: ...

    def blocks(self, stream: str, start_ns: int = 0, end_ns: int = 1 << 63) -> Iterator[DecodedBlock]: ...
    def read(self, channels: tuple[str, ...], start_ns: int, end_ns: int) -> dict[str, npt.NDArray[Any]]: ...
    def lost(self, stream: str, start_ns: int, end_ns: int) -> int: ...
    def limit_samples(self, count: int) -> None: ...
    def events(self, kind: str | None = None) -> list[dict[str, Any]]: ...
