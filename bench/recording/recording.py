"""A recording read back: the only thing that `analyse` and reports get to see.

Steps are read through the chunk index, block by block, so an hour-long file takes little memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError, RecordingError
from bench.link.frames import FrameBatch, frames_of
from bench.plan import BenchPlan
from bench.recording import layout, stored
from bench.recording.attachments import Attachments
from bench.recording.captured import CAPTURES, Captured
from bench.recording.kept import Kept
from bench.recording.layout import DecodedBlock
from bench.recording.mcapchunk import sound
from bench.recording.mcapfile import McapFile, index
from bench.recording.readlimits import MB
from bench.recording.steps import Step, Steps
from bench.rigfile import roles
from bench.samples import TICKS, StreamLayout

__all__ = ["Captured", "Recording", "Step", "Steps"]
P = TypeVar("P", bound=BenchPlan)
R = TypeVar("R")
KEPT = 160  # decoded blocks: views of the messages, which the file keeps as long
KEPT_BYTES = 64 << 20
BLOCK_NS = 2_000_000_000  # no block is longer: how far back a block that reaches into an interval can begin


class Recording(Attachments[P]):
    """One recording, closed. Open with `Recording.open`."""

    def __init__(
        self, file: McapFile, plan: type[P] | None, settings: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        super().__init__(file, plan, settings)
        self._kept: Kept[tuple[bytes, DecodedBlock]] = Kept(KEPT, KEPT_BYTES)
        self._made: dict[Callable[[Any], Any], Any] = {}
        self.version = int(file.metadata["layout"]["version"])
        self.integrity: Mapping[str, Any] | None = _integrity(file)
        self.truncated = file.truncated or self.integrity is None

    @classmethod
    def open(
        cls, path: Path, plan: type[P] | None = None, settings: Mapping[str, Any] = MappingProxyType({})
    ) -> Recording[P]:
        """Open and check a recording. `settings` take the place of those of its plan.

        Raises:
            RecordingError: not a recording of ours, of a newer layout, or damaged. A file that was only cut off opens
            with `truncated` set.
        """
        file = index(path)
        version = file.metadata.get("layout", {}).get("version", "")
        if file.profile != "levbench" or not (version.isascii() and version.isdigit() and len(version) < 10):
            raise RecordingError(
                f"{path} is MCAP but no Levbench recording (profile {file.profile[:40]!r}, layout {version[:40]!r})"
            )
        if int(version) > layout.VERSION:
            raise RecordingError(
                f"{path}: layout version: found {version}; expected at most {layout.VERSION}. It was recorded with a "
                "newer Levbench: use that one, or `bench export` there"
            )
        return cls(file, plan, settings)

    @cached_property
    def _layouts(self) -> dict[str, StreamLayout]:
        out = {}
        for topic, metadata in self._file.topics.values():
            if topic.endswith("/block") and "layout" in metadata:
                name = topic.removeprefix("/").removesuffix("/block")
                out[name] = stored.stream_of(name, metadata["layout"], f"recording {self.path}: topic {topic[:80]}")
        return out

    @property
    def streams(self) -> dict[str, StreamLayout]:
        """The streams that were recorded all the time, by name."""
        return {name: s for name, s in self._layouts.items() if not name.startswith(CAPTURES)}

    @property
    def capture_streams(self) -> dict[str, StreamLayout]:
        """The streams of captures, by name."""
        return {name: s for name, s in self._layouts.items() if name.startswith(CAPTURES)}

    def captures(self, **labels: Any) -> tuple[Captured, ...]:
        """The captures that were uploaded with these labels, in order; all of them by default."""
        found = (Captured.of(self, event) for event in self.events("capture") if event["stream"] in self._layouts)
        return tuple(c for c in found if labels.items() <= c.labels.items())

    @cached_property
    def start_ns(self) -> int:
        """Time of the first sample of the telemetry; what `t_s` counts from.

        Raises:
            AnalysisError: there is none.
        """
        for block in self.blocks("telemetry"):
            return int(block.t_ns[0])
        raise AnalysisError(f"{self.path.name} holds no telemetry")

    def blocks(self, stream: str, start_ns: int = 0, end_ns: int = 1 << 63) -> Iterator[DecodedBlock]:
        """Decoded blocks that may hold samples of an interval, in order."""
        for t_ns, data in self._file.messages(layout.block_topic(stream), max(0, start_ns - BLOCK_NS), end_ns):
            block = self._decoded(stream, t_ns, data)
            if block.count and block.t_ns[-1] >= start_ns:
                yield block

    def _decoded(self, stream: str, t_ns: int, data: bytes) -> DecodedBlock:
        """A block; the last few are kept, for steps are read one after the other and each more than once."""
        key = (stream, t_ns, id(data))
        kept = self._kept.get(key)
        if kept is None or kept[0] is not data:
            try:
                kept = (data, DecodedBlock(self._layouts[stream], data))
            except RecordingError as error:
                raise RecordingError(f"recording {self.path}: {error}") from error
            self._kept.put(key, kept, 2 * len(data))
        return kept[1]

    def read(self, channels: tuple[str, ...], start_ns: int, end_ns: int) -> dict[str, npt.NDArray[Any]]:
        """Samples with start <= t < end: float64 by channel or role (`bench.rigfile.roles`), `t_ns`, and `index` (counts lost
        samples too).

        Raises:
            AnalysisError: a channel was not recorded, or the channels are of different streams.
            Lacking: the rig has no channel for a role.
            RecordingError: more numbers than the limits allow.
        """
        if not any("." in name for name in channels):
            return self._read(channels, start_ns, end_ns)
        found = self._read(roles.resolved(self.rig, channels), start_ns, end_ns, ticks=roles.AGE in channels)
        return roles.answered(self.rig, (*channels, "t_ns", "index"), found)

    def _read(
        self, channels: tuple[str, ...], start_ns: int, end_ns: int, *, ticks: bool = False
    ) -> dict[str, npt.NDArray[Any]]:
        stream = self._stream_of(channels)
        count, more = 0, (TICKS,) if ticks else ()
        parts: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in (*channels, "t_ns", "index", *more)}
        for block in self.blocks(stream, start_ns, end_ns):
            a, b = np.searchsorted(block.t_ns, [start_ns, end_ns])
            count += int(b - a) * len(parts)
            self.limit_samples(count)
            parts["t_ns"].append(block.t_ns[a:b])
            parts["index"].append(np.arange(block.first + a, block.first + b))
            if ticks:
                parts[TICKS].append(block.ticks[a:b])
            for name in channels:
                parts[name].append(block.columns[name][a:b].astype(np.float64))
        empty = {"t_ns": np.zeros(0, np.int64), "index": np.zeros(0, np.int64)}
        names = tuple(parts)  # each part goes when its whole is there
        return {n: np.concatenate(x) if (x := parts.pop(n)) else empty.get(n, np.zeros(0)) for n in names}

    def limit_samples(self, count: int) -> None:
        """See that no more numbers are read at once than the limits allow.

        Raises:
            RecordingError: `count` is too many.
        """
        self._file.limits.check("samples", count, f"recording {self.path}", "numbers to read at once")

    def channel(self, name: str, start_ns: int = 0, end_ns: int = 1 << 62) -> dict[str, npt.NDArray[Any]]:
        """One channel with start <= t < end, float64, with `t_ns` and `index`; the whole recording by default."""
        return self.read((name,), start_ns, end_ns)

    def lost(self, stream: str, start_ns: int, end_ns: int) -> int:
        """How many samples with start <= t < end are missing: those that blocks count as lost before them, and those
        after the last block, where a recording was cut off."""
        period, missing, last = self._layouts[stream].period_ns, 0, None
        for block in self.blocks(stream, start_ns):
            first, last = int(block.t_ns[0]), int(block.t_ns[-1])
            # The k-th lost sample before a block was due at first - k periods.
            missing += max(0, min(block.lost, (first - start_ns) // period) - max(0, (first - end_ns) // period))
            if first >= end_ns:
                break
        if last is None:
            return round((end_ns - start_ns) / period)
        return missing + max(0, (end_ns - 1 - last) // period)

    def _stream_of(self, channels: tuple[str, ...]) -> str:
        for name, stream in self.streams.items():
            known = {c.name for c in stream.channels}
            if known.issuperset(channels):
                return name
        raise AnalysisError(f"channels {', '.join(channels)}: not all recorded in one stream of {self.path.name}")

    @cached_property
    def _events(self) -> list[dict[str, Any]]:
        out, size, where = [], 0, f"recording {self.path}"
        for _, data in self._file.messages(layout.EVENTS):
            size += len(data)
            self._file.limits.check("event_mb", size / MB, where, "MB of events")
            out.append(stored.event_of(data, f"{where}: an event"))
            self._file.limits.check("events", len(out), where, "events")
        return out

    def events(self, kind: str | None = None) -> list[dict[str, Any]]:
        """Events in order: `kind`, `t_ns` and their data."""
        return [e for e in self._events if kind is None or e["kind"] == kind]

    def steps(self, kind: str) -> Steps:
        """The completed steps of a kind, in time order."""
        return Steps(tuple(s for s in self.all_steps() if s.kind == kind))

    def all_steps(self) -> Steps:
        """The completed steps of every kind, in time order."""
        ends = {e["step"]: e["t_ns"] for e in self.events("step-end")}
        told: dict[int, dict[str, Any]] = {}
        for e in self.events("step-corrected"):
            told.setdefault(e["step"], {}).update(e["labels"])
        return Steps(tuple(
            Step(self, e["name"], {**e["labels"], **told.get(e["step"], {})}, e["t_ns"], ends[e["step"]])
            for e in self.events("step-begin") if e["step"] in ends
        ))  # fmt: skip

    def once(self, work: Callable[[Recording[P]], R]) -> R:
        """What `work` makes of this recording, made the first time it is asked for: results and figures share an evaluation."""
        if work not in self._made:
            self._made[work] = work(self)
        return cast(R, self._made[work])

    @property
    def links(self) -> tuple[str, ...]:
        """The links whose frames were recorded."""
        raw = layout.raw_topic("")
        return tuple(sorted({t.removeprefix(raw) for t, _ in self._file.topics.values() if t.startswith(raw)}))

    def frames(self, link: str) -> Iterator[FrameBatch]:
        """Raw frames, batch by batch as they were recorded."""
        with sound(self.path):
            for _, data in self._file.messages(layout.raw_topic(link)):
                _, records = layout.decode_frames(data)
                yield frames_of(records, self.version)

    def everything(self, end_ns: int = 1 << 63) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time and bytes of every message as it stands in the file; chunks that begin later are left out."""
        return self._file.everything(end_ns)

    def stored_events(self) -> Iterator[tuple[int, bytes]]:
        """Time and bytes of each of the `events`."""
        return self._file.messages(layout.EVENTS)

    def close(self) -> None:
        """Nothing stays open between reads; here for symmetry with the recorder."""


def _integrity(file: McapFile) -> dict[str, Any] | None:
    found = file.metadata.get("integrity")
    return None if found is None else stored.integrity_of(found, f"recording {file.path}: its integrity record")
