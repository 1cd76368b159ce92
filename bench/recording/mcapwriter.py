"""What the recorder's thread does with each item: merges samples into blocks, makes the view, writes MCAP.

Half a second of bench time after the last flush, what is pending is written and the chunk is closed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from bench.link.frames import FrameBatch
from bench.recording import layout
from bench.samples import SampleBlock, StreamLayout

FLUSH_NS = 500_000_000
VIEW_NS = 10_000_000
BLOCK_NS = 1_000_000_000
BLOCK_ROWS = 1000


class McapWriter:
    """Owns the mcap writer: header first, then frames, samples and events as they come, then counts.

    `blocks` counts the blocks written, by stream. Not safe for more than one thread.
    """

    def __init__(
        self,
        file: BinaryIO,
        streams: Mapping[str, StreamLayout],
        metadata: Mapping[str, Mapping[str, str]],
        attachments: Mapping[str, bytes],
        start_ns: int,
        *,
        view: bool = True,
    ) -> None:
        from mcap.writer import CompressionType, IndexType, Writer

        self._file, self._view = file, view
        self._streams: dict[str, StreamLayout] = {}
        self.blocks: dict[str, int] = {}
        self._mcap: Any = Writer(file, chunk_size=1 << 20, compression=CompressionType.LZ4, index_types=IndexType.ALL,
                            enable_crcs=True, enable_data_crcs=True)  # fmt: skip
        self._mcap.start(profile="levbench", library="levbench")
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._pending: dict[str, list[SampleBlock]] = {}
        self._windows: dict[str, layout.ViewWindows] = {}
        self._next_flush = start_ns + FLUSH_NS
        self._mcap.add_metadata("layout", {"version": str(layout.VERSION)})
        for name, values in metadata.items():
            self._mcap.add_metadata(name, dict(values))
        for name, data in attachments.items():
            self._mcap.add_attachment(0, 0, name, "text/plain", data)
        for stream in streams.values():
            self.stream(stream)
        event = self._mcap.register_schema("levbench.Event", "jsonschema", layout.EVENT_SCHEMA)
        self._channels[layout.EVENTS] = self._mcap.register_channel(layout.EVENTS, "json", event)
        file.flush()

    def stream(self, stream: StreamLayout) -> None:
        """Add a stream; its samples come later."""
        name, described = stream.name, {"layout": json.dumps({
            "period_ns": stream.period_ns, "channels": [[c.name, c.unit, c.dtype] for c in stream.channels]})}  # fmt: skip
        self._streams[name], self._pending[name], self.blocks[name] = stream, [], 0
        kind = layout.type_name("Block", name)
        self._register(layout.block_topic(name), f"levbench.{kind}", layout.block_schema(stream), described)
        if self._view:
            self._windows[name] = layout.ViewWindows(stream, VIEW_NS)
            kind = layout.type_name("View", name)
            self._register(layout.view_topic(name), f"levbench.{kind}", layout.view_schema(stream))

    def _register(self, topic: str, name: str, schema: bytes, metadata: Mapping[str, str] | None = None) -> None:
        number = self._mcap.register_schema(name, "protobuf", schema)
        self._channels[topic] = self._mcap.register_channel(topic, "protobuf", number, dict(metadata or {}))

    def frames(self, link: str, lag_ns: int, batch: FrameBatch) -> None:
        host_ns = int(batch["t_ns"][-1])
        t_ns = host_ns - lag_ns
        topic = layout.raw_topic(link)
        if topic not in self._channels:
            self._register(topic, "levbench.Frames", layout.raw_schema())
        self._message(topic, t_ns, layout.encode_frames(host_ns, len(batch), batch.tobytes()))
        self._flush_if_due(t_ns)

    def samples(self, block: SampleBlock) -> None:
        stream = block.stream
        pending, plan = self._pending[stream], self._streams[stream]
        if pending and not _follows(pending[-1], block, plan.period_ns):
            self._write_blocks(stream)
        self._pending[stream].append(block)
        if sum(map(len, self._pending[stream])) >= _rows(plan):
            self._write_blocks(stream)
        self._flush_if_due(int(block.t_ns[-1]))

    def event(self, t_ns: int, data: bytes) -> None:
        self._message(layout.EVENTS, t_ns, data)
        self._flush_if_due(t_ns)

    def taken(self, messages: Sequence[tuple[str, int, bytes]]) -> None:
        """Messages of another recording with the same streams, as they stand there; views only where there are such here."""
        for topic, t_ns, data in messages:
            if topic not in self._channels and topic.startswith(layout.raw_topic("")):
                self._register(topic, "levbench.Frames", layout.raw_schema())
            if topic in self._channels:
                self._message(topic, t_ns, data)
            if topic.endswith("/block"):
                self.blocks[topic.removeprefix("/").removesuffix("/block")] += 1

    def _write_blocks(self, stream: str) -> None:
        blocks, self._pending[stream] = self._pending[stream], []
        if not blocks:
            return
        plan, first = self._streams[stream], blocks[0]
        ticks = np.concatenate([b.ticks for b in blocks])
        t_ns = np.concatenate([b.t_ns for b in blocks])
        columns = _joined(blocks, plan)
        for start in range(0, len(ticks), _rows(plan)):
            part = slice(start, start + _rows(plan))
            data = layout.encode_block(plan, first.first_index + start, first.lost_before if start == 0 else 0,
                                       first.host_ns, ticks[part], t_ns[part],
                                       {n: x[part] for n, x in columns.items()})  # fmt: skip
            self._message(layout.block_topic(stream), int(t_ns[start]), data)
            self.blocks[stream] += 1
        if stream in self._windows:
            self._write_view(stream, self._windows[stream].take(t_ns, columns))

    def _write_view(self, stream: str, view: Iterable[tuple[int, bytes]]) -> None:
        for t_ns, data in view:
            self._message(layout.view_topic(stream), t_ns, data)

    def _message(self, topic: str, t_ns: int, data: bytes) -> None:
        sequence = self._sequence.get(topic, 0)
        self._sequence[topic] = sequence + 1
        self._mcap.add_message(self._channels[topic], t_ns, data, t_ns, sequence & 0xFFFFFFFF)

    def _flush_if_due(self, t_ns: int) -> None:
        if t_ns >= self._next_flush:
            self._next_flush = t_ns + FLUSH_NS
            for stream in self._pending:
                self._write_blocks(stream)
            self._mcap.flush()
            self._file.flush()

    def write_pending(self) -> None:
        """Write the samples that wait for more; no more may come. `blocks` is final afterwards."""
        for stream in self._pending:
            self._write_blocks(stream)
            if stream in self._windows:
                self._write_view(stream, self._windows[stream].rest())
        self._mcap.flush()

    def finish(self, counts: Mapping[str, str], wall: Mapping[str, str]) -> None:
        """Write the counts as metadata `integrity`, the wall record and the summary."""
        self._mcap.add_metadata("integrity", dict(counts))
        if wall:
            self._mcap.add_metadata("wall", dict(wall))
        self._mcap.finish()
        self._file.flush()


def _rows(stream: StreamLayout) -> int:
    """Samples in a block at most: 1000, or a second."""
    return max(1, min(BLOCK_ROWS, BLOCK_NS // stream.period_ns))


def _follows(before: SampleBlock, after: SampleBlock, period_ns: int) -> bool:
    """Whether a block continues the one before: no loss, no restart of the sample clock between them."""
    return (
        after.lost_before == 0
        and after.first_index == before.first_index + len(before)
        and int(after.t_ns[0]) == int(before.t_ns[-1]) + period_ns
    )


def _joined(blocks: Sequence[SampleBlock], plan: StreamLayout) -> dict[str, npt.NDArray[np.float64]]:
    """The blocks' columns end to end: all at once, where each block's are rows of one array, for thirty joins of a few
    hundred numbers cost more than all the rest of a block."""
    tables = [b.table for b in blocks if b.table is not None]
    if len(tables) == len(blocks):
        return dict(zip(blocks[0].columns, np.concatenate(tables, axis=1), strict=True))
    return {c.name: np.concatenate([b.columns[c.name] for b in blocks]) for c in plan.channels}
