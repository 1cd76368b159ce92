"""The recorder: raw frames, decoded blocks, a 100 Hz view and events into one MCAP file, by one writer thread.

Everything but the metadata record `wall` is a function of what was recorded, so equal runs give equal files. A chunk is
closed every half second of bench time: what a killed process leaves behind holds all but the last second.
"""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from bench import layout
from bench.clock import Clock
from bench.errors import RecordingError
from bench.frames import FRAME, FrameBatch
from bench.samples import SampleBlock, StreamLayout

FLUSH_NS = 500_000_000
VIEW_NS = 10_000_000
QUEUE_ITEMS = 400  # a live link hands over at most some tens of batches a second, so this is seconds


@dataclass(frozen=True)
class RunHeader:
    """What stands first in the file: `metadata` records by name, and `attachments` by name. Nothing from the wall
    clock belongs here; that goes to `wall`."""

    metadata: Mapping[str, Mapping[str, str]]
    attachments: Mapping[str, bytes]


@dataclass
class Integrity:
    """Counts at close. Frames by link, samples and losses by stream."""

    frames: dict[str, int] = field(default_factory=dict)
    samples: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    events: int = 0
    steps: int = 0
    overflows: int = 0
    complete: bool = True


class Recorder:
    """Writes one recording. Use as a context manager; `close` is safe to call twice.

    Args:
        path: must not exist.
        clock: gives the time of events and steps.
        live: a full queue raises instead of blocking.

    Raises:
        RecordingError: the file cannot be made.
    """

    def __init__(
        self, path: Path, *, clock: Clock, streams: Sequence[StreamLayout], header: RunHeader, live: bool = False
    ) -> None:
        self.path, self._clock, self._live = path, clock, live
        self.integrity = Integrity()
        self.wall: dict[str, str] = {}
        self._streams = {s.name: s for s in streams}
        self._failure: BaseException | None = None
        self._closed = False
        self._high_water = 0
        try:
            self._file = path.open("xb")
            self._writer = _Writer(self._file, self._streams, header, clock.now_ns())
        except OSError as error:
            raise RecordingError(f"recording {path}: cannot be written: {error.strerror or error}") from error
        self._queue: queue.Queue[tuple[str, tuple[Any, ...]] | None] = queue.Queue(QUEUE_ITEMS)
        self._thread = threading.Thread(target=self._drain, name="recorder", daemon=True)
        self._thread.start()

    def frames(self, link: str, batch: FrameBatch) -> None:
        """Record frames as they came, or as they were sent (flag SENT)."""
        if len(batch):
            self.integrity.frames[link] = self.integrity.frames.get(link, 0) + len(batch)
            self._put("frames", link, int(batch["t_ns"][-1]), batch.astype(FRAME, copy=True))

    def samples(self, block: SampleBlock) -> None:
        """Record decoded samples; small blocks are merged."""
        counts = self.integrity
        counts.samples[block.stream] = counts.samples.get(block.stream, 0) + len(block)
        counts.lost[block.stream] = counts.lost.get(block.stream, 0) + block.lost_before
        self._put("samples", block)

    def event(self, kind: str, t_ns: int | None = None, **data: Any) -> None:
        """Record something that happened; `data` are JSON values."""
        self.integrity.events += 1
        at = self._clock.now_ns() if t_ns is None else t_ns
        self._put("event", at, json.dumps({"kind": kind, "t_ns": at, **data}, allow_nan=False).encode())

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        """A labelled interval of the recording; left open when the block raises."""
        index = self.integrity.steps
        self.integrity.steps += 1
        self.event("step-begin", step=index, name=kind, labels=labels)
        yield
        self.event("step-end", step=index, name=kind)

    def close(self) -> Integrity:
        """Write what is pending, the integrity and the wall record, and close the file.

        Raises:
            RecordingError: something could not be written, now or before.
        """
        if not self._closed:
            self._closed = True
            self._queue.put(None)
            self._thread.join()
            try:
                if self._failure is None:
                    self.wall["queue_high_water"] = str(self._high_water)
                    self._writer.finish(self.integrity, self.wall)
                self._file.close()
            except OSError as error:
                self._failure = error
        self._raise()
        return self.integrity

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            self.close()
        except RecordingError:
            if kind is None:
                raise

    def _raise(self) -> None:
        if self._failure is not None:
            why = getattr(self._failure, "strerror", None) or self._failure
            raise RecordingError(f"recording {self.path}: cannot be written: {why}") from self._failure

    def _put(self, what: str, *arguments: Any) -> None:
        self._raise()
        if self._closed:
            raise RecordingError(f"recording {self.path} is closed")
        try:
            self._queue.put((what, arguments), block=not self._live)
        except queue.Full:
            self.integrity.overflows += 1
            raise RecordingError(f"recording {self.path}: the disk does not keep up; samples were lost") from None
        self._high_water = max(self._high_water, self._queue.qsize())

    def _drain(self) -> None:
        while (item := self._queue.get()) is not None:
            if self._failure is None:
                try:
                    getattr(self._writer, item[0])(*item[1])
                except BaseException as error:
                    self._failure = error


class _Writer:
    """What the thread does with each item: owns the mcap writer, merges blocks, makes the view."""

    def __init__(self, file: Any, streams: Mapping[str, StreamLayout], header: RunHeader, start_ns: int) -> None:
        self._file, self._streams, self._start = file, streams, start_ns
        self._mcap: Any = Writer(file, chunk_size=1 << 20, compression=CompressionType.LZ4, index_types=IndexType.ALL,
                            enable_crcs=True, enable_data_crcs=True)  # fmt: skip
        self._mcap.start(profile="levbench", library="levbench")
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._pending: dict[str, list[SampleBlock]] = {name: [] for name in streams}
        self._next_flush = start_ns + FLUSH_NS
        self._mcap.add_metadata("layout", {"version": str(layout.VERSION)})
        for name, values in header.metadata.items():
            self._mcap.add_metadata(name, dict(values))
        for name, data in header.attachments.items():
            self._mcap.add_attachment(0, 0, name, "text/plain", data)
        for stream in streams.values():
            described = {"layout": json.dumps({"period_ns": stream.period_ns,
                         "channels": [[c.name, c.unit, c.dtype] for c in stream.channels]})}  # fmt: skip
            self._register(layout.block_topic(stream.name), f"levbench.Block_{stream.name}",
                           layout.block_schema(stream), described)  # fmt: skip
            self._register(layout.view_topic(stream.name), f"levbench.View_{stream.name}", layout.view_schema(stream))
        schema = self._mcap.register_schema("levbench.Event", "jsonschema", layout.EVENT_SCHEMA)
        self._channels[layout.EVENTS] = self._mcap.register_channel(layout.EVENTS, "json", schema)
        file.flush()

    def _register(self, topic: str, name: str, schema: bytes, metadata: Mapping[str, str] | None = None) -> None:
        number = self._mcap.register_schema(name, "protobuf", schema)
        self._channels[topic] = self._mcap.register_channel(topic, "protobuf", number, dict(metadata or {}))

    def frames(self, link: str, t_ns: int, batch: FrameBatch) -> None:
        topic = layout.raw_topic(link)
        if topic not in self._channels:
            self._register(topic, "levbench.Frames", layout.raw_schema())
        self._message(topic, t_ns, layout.encode_frames(t_ns, len(batch), batch.tobytes()))

    def samples(self, block: SampleBlock) -> None:
        pending = self._pending[block.stream]
        if block.lost_before and pending:
            self._write_blocks(block.stream)
            pending = self._pending[block.stream]
        pending.append(block)
        period = self._streams[block.stream].period_ns
        if sum(len(b) for b in pending) >= max(1, min(1000, FLUSH_NS // period)):
            self._write_blocks(block.stream)

    def event(self, t_ns: int, data: bytes) -> None:
        self._message(layout.EVENTS, t_ns, data)

    def _write_blocks(self, stream: str) -> None:
        blocks, self._pending[stream] = self._pending[stream], []
        if not blocks:
            return
        plan = self._streams[stream]
        ticks = np.concatenate([b.ticks for b in blocks])
        t_ns = np.concatenate([b.t_ns for b in blocks])
        columns = {c.name: np.concatenate([b.columns[c.name] for b in blocks]) for c in plan.channels}
        first = blocks[0]
        for start in range(0, len(ticks), 1000):
            part = slice(start, start + 1000)
            data = layout.encode_block(plan, first.first_index + start, first.lost_before if start == 0 else 0,
                                       first.host_ns, ticks[part], t_ns[part],
                                       {n: x[part] for n, x in columns.items()})  # fmt: skip
            self._message(layout.block_topic(stream), int(t_ns[start]), data)
        self._write_view(plan, t_ns, columns)

    def _write_view(self, plan: StreamLayout, t_ns: Any, columns: Mapping[str, Any]) -> None:
        edges = np.flatnonzero(np.diff(t_ns // VIEW_NS, prepend=-1))
        counts = np.diff(np.append(edges, len(t_ns)))
        values = []
        for c in plan.channels:
            x = columns[c.name]
            if c.dtype == "f4":
                values += [
                    np.add.reduceat(x, edges) / counts,
                    np.minimum.reduceat(x, edges),
                    np.maximum.reduceat(x, edges),
                ]
            else:
                values.append(x[edges + counts - 1])
        rows = np.zeros(len(edges), [(f"f{k}", [("tag", "u1", (2 if k >= 15 else 1,)), ("v", "<f4")])
                                     for k in range(len(values))])  # fmt: skip
        for k, x in enumerate(values):
            rows[f"f{k}"]["tag"] = list(layout.varint((k + 1) << 3 | 5))
            rows[f"f{k}"]["v"] = x
        topic = layout.view_topic(plan.name)
        for row, at in zip(rows, t_ns[edges].tolist(), strict=True):
            self._message(topic, at, row.tobytes())

    def _message(self, topic: str, t_ns: int, data: bytes) -> None:
        sequence = self._sequence.get(topic, 0)
        self._sequence[topic] = sequence + 1
        self._mcap.add_message(self._channels[topic], t_ns, data, t_ns, sequence & 0xFFFFFFFF)
        if t_ns >= self._next_flush:
            self._next_flush = t_ns + FLUSH_NS
            self._mcap.flush()
            self._file.flush()

    def finish(self, integrity: Integrity, wall: Mapping[str, str]) -> None:
        for stream in self._pending:
            self._write_blocks(stream)
        self._mcap.flush()
        counts = {k: json.dumps(v, sort_keys=True) for k, v in vars(integrity).items()}
        self._mcap.add_metadata("integrity", counts)
        if wall:
            self._mcap.add_metadata("wall", dict(wall))
        self._mcap.finish()
        self._file.flush()
