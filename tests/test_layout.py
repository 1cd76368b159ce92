"""Columns to bytes and back, with the protobuf runtime as the judge, and bytes worked out by hand."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import RecordingError
from bench.recording import layout
from bench.samples import ChannelInfo, StreamLayout

TWO = StreamLayout("s", 1000, (ChannelInfo("a", "m"), ChannelInfo("code", "1", "u2")))


def message_class(schema: bytes, name: str) -> Any:
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"levbench.{name}"))


def encoded(count: int, plan: StreamLayout = TWO, **columns: Any) -> bytes:
    ticks = np.arange(count, dtype=np.uint64)
    given_columns = {c.name: np.asarray(columns[c.name]) for c in plan.channels}
    return layout.encode_block(plan, 7, 2, 99, ticks, np.arange(count, dtype=np.int64) * 1000 + 5, given_columns)


def test_a_block_of_one_sample_byte_by_byte() -> None:
    expected = (
        b"\x09" + struct.pack("<Q", 7)  # field 1, 64 bit: first sample index
        + b"\x15" + struct.pack("<I", 1)  # field 2, 32 bit: count
        + b"\x1d" + struct.pack("<I", 2)  # field 3: lost before
        + b"\x21" + struct.pack("<Q", 99)  # field 4: host time
        + b"\x29" + struct.pack("<Q", 1000)  # field 5: period
        + b"\x32\x08" + struct.pack("<Q", 0)  # field 6, 8 bytes: ticks
        + b"\x3a\x08" + struct.pack("<Q", 5)  # field 7: times
        + b"\x82\x01\x04" + struct.pack("<f", 1.5)  # field 16, two-byte tag (16 << 3 | 2 = 130), 4 bytes
        + b"\x8a\x01\x04" + struct.pack("<I", 3)  # field 17
    )  # fmt: skip
    assert encoded(1, a=[1.5], code=[3.0]) == expected


@settings(max_examples=60, deadline=None)
@given(
    kinds=st.lists(st.sampled_from(["f4", "f8", "u2"]), min_size=1, max_size=150),
    count=st.integers(1, 300),
    seed=st.integers(0, 2**32),
)
def test_the_protobuf_runtime_and_our_decoder_read_what_was_encoded(kinds: list[str], count: int, seed: int) -> None:
    """Up to 150 channels: tags of two bytes, and lengths of one, two and three."""
    plan = StreamLayout("s", 1000, tuple(ChannelInfo(f"c{k}", "1", kind) for k, kind in enumerate(kinds)))
    generator = np.random.default_rng(seed)
    columns = {
        c.name: generator.standard_normal(count).astype(c.dtype) if c.dtype != "u2"
        else generator.integers(0, 1 << 16, count) for c in plan.channels
    }  # fmt: skip
    data = encoded(count, plan, **columns)
    theirs = message_class(layout.block_schema(plan), "Block_s").FromString(data)
    ours = layout.DecodedBlock(plan, data)
    head = (theirs.first_sample_index, theirs.count, theirs.lost_before, theirs.host_time_ns, theirs.sample_period_ns)
    assert head == (7, count, 2, 99, 1000)
    assert (ours.first, ours.count, ours.lost, ours.host_ns) == (7, count, 2, 99)
    assert list(theirs.device_ticks) == ours.ticks.tolist() == list(range(count))
    assert list(theirs.t_ns) == ours.t_ns.tolist()
    for name, x in columns.items():
        assert np.array_equal(getattr(theirs, name), x)
        assert np.array_equal(ours.columns[name], x)


@settings(max_examples=120, deadline=None)
@given(data=st.one_of(st.binary(max_size=60), st.builds(
    lambda at, byte: encoded(3, a=[1, 2, 3], code=[4, 5, 6])[:at] + byte + encoded(3, a=[1, 2, 3], code=[4, 5, 6])[at + 1 :],
    st.integers(0, 120), st.binary(max_size=3))))  # fmt: skip
def test_bytes_that_are_no_block_are_refused_or_a_consistent_block(data: bytes) -> None:
    try:
        block = layout.DecodedBlock(TWO, data)
    except RecordingError:
        return
    assert {len(block.ticks), len(block.t_ns), *map(len, block.columns.values())} == {block.count}


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(RecordingError, match="columns of different lengths"):
        layout.DecodedBlock(TWO, encoded(2, a=[1, 2], code=[1]))


def view_of(
    parts: list[np.ndarray[Any, Any]], t_ns: np.ndarray[Any, Any], x: np.ndarray[Any, Any]
) -> list[tuple[int, bytes]]:
    windows = layout.ViewWindows(TWO, 10)
    out: list[tuple[int, bytes]] = []
    for part in parts:
        out += windows.take(t_ns[part], {"a": x[part], "code": np.arange(len(t_ns))[part] % 9})
    return out + windows.rest() + windows.rest()


@settings(max_examples=100, deadline=None)
@given(
    steps=st.lists(st.integers(1, 25), min_size=1, max_size=80),
    cuts=st.sets(st.integers(1, 79), max_size=12),
    seed=st.integers(0, 9),
)
def test_the_view_does_not_depend_on_how_the_samples_are_cut(steps: list[int], cuts: set[int], seed: int) -> None:
    t_ns = 1000 + np.cumsum(steps)
    x = np.random.default_rng(seed).standard_normal(len(t_ns))
    index = np.arange(len(t_ns))
    parts = [p for p in np.split(index, sorted(c for c in cuts if c < len(index))) if len(p)]
    pieces, whole = view_of(parts, t_ns, x), view_of([index], t_ns, x)
    assert pieces == whole
    kind = message_class(layout.view_schema(TWO), "View_s")
    groups = [index[t_ns // 10 == w] for w in np.unique(t_ns // 10)]
    assert [t for t, _ in whole] == [int(t_ns[g[0]]) for g in groups]
    for (_, data), g in zip(whole, groups, strict=True):
        m = kind.FromString(data)
        assert m.a == pytest.approx(float(np.mean(x[g])), rel=1e-6, abs=1e-7)
        assert (m.a_min, m.a_max, m.code) == (np.float32(x[g].min()), np.float32(x[g].max()), g[-1] % 9)


def test_frames_of_a_batch_come_back() -> None:
    data = layout.encode_frames(12, 2, b"ab" * 78)
    assert layout.decode_frames(data) == (12, b"ab" * 78)
    theirs = message_class(layout.raw_schema(), "Frames").FromString(data)
    assert (theirs.host_time_ns, theirs.count, theirs.frames) == (12, 2, b"ab" * 78)
