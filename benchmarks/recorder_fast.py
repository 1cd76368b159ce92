"""The recorder at 52 channels x 35 kHz: in real time for a minute, and fed as fast as it takes; beside the mcap package
used as its examples do, with one message for each sample.

    python benchmarks/recorder_fast.py [--seconds 60]
"""

from __future__ import annotations

import argparse
import json
import struct
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

CHANNELS, RATE, SLICE = 52, 35_000, 3500
START_NS = 1_767_225_600 * 10**9
STREAM = StreamLayout("fast", 10**9 // RATE, tuple(ChannelInfo(f"c{k}", "A") for k in range(CHANNELS)))
PREPARED = 20  # slices, used again and again


class StillClock:
    """Nothing here depends on the time."""

    def now_ns(self) -> int:
        return START_NS

    def sleep(self, seconds: float) -> None:
        raise AssertionError(f"nobody sleeps {seconds} s here")


def prepared() -> list[dict[str, Any]]:
    """Columns of slices of 0.1 s: sines with noise, in 16 bits."""
    generator = np.random.default_rng(0)
    out = []
    for n in range(PREPARED):
        index = np.arange(n * SLICE, (n + 1) * SLICE)[:, None]
        counts = 8000 * np.sin(index * np.linspace(0.001, 0.1, CHANNELS)) + generator.normal(0, 20, (SLICE, CHANNELS))
        columns = (np.round(counts) * 0.0005).astype(np.float32)
        out.append({c.name: np.ascontiguousarray(columns[:, k]) for k, c in enumerate(STREAM.channels)})
    return out


def blocks(seconds: float, columns: list[dict[str, Any]]) -> Iterator[SampleBlock]:
    for n in range(round(seconds * RATE / SLICE)):
        index = np.arange(n * SLICE, (n + 1) * SLICE)
        t_ns = START_NS + index * STREAM.period_ns
        yield SampleBlock("fast", n * SLICE, index.astype(np.uint64), t_ns, int(t_ns[-1]), 0, columns[n % len(columns)])


def written(path: Path, seconds: float, columns: list[dict[str, Any]], *, paced: bool) -> tuple[float, float]:
    """Wall and processor time, s, closing included."""
    path.unlink(missing_ok=True)
    wall, cpu = time.perf_counter(), time.process_time()
    with Recorder(path, clock=StillClock(), streams=[STREAM], header=RunHeader({}, {}), live=paced) as recorder:
        for n, block in enumerate(blocks(seconds, columns)):
            recorder.samples(block)
            if paced:
                time.sleep(max(0.0, wall + (n + 1) * SLICE / RATE - time.perf_counter()))
    return time.perf_counter() - wall, time.process_time() - cpu


def stock(path: Path, seconds: float, columns: list[dict[str, Any]]) -> float:
    """The mcap package, one message a sample."""
    begun = time.perf_counter()
    pack = struct.Struct(f"<{CHANNELS}f").pack
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sample", "", b"")
        channel = writer.register_channel("/fast", "raw", schema)
        for block in blocks(seconds, columns):
            rows = np.column_stack([block.columns[c.name] for c in STREAM.channels]).tolist()
            for t_ns, row in zip(block.t_ns.tolist(), rows, strict=True):
                writer.add_message(channel, t_ns, pack(*row), t_ns)
        writer.finish()
    return time.perf_counter() - begun


def kept(path: Path, seconds: float) -> int:
    """Samples missing from the file."""
    recording: Recording[Any] = Recording.open(path)
    assert recording.integrity is not None
    assert recording.integrity["overflows"] == 0
    count = sum(block.count for block in recording.blocks("fast"))
    return round(seconds * RATE) - count


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    seconds = parser.parse_args().seconds
    columns = prepared()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        _, cpu = written(path, seconds, columns, paced=True)
        lost = kept(path, seconds)
        size = path.stat().st_size
        fed, _ = written(path, seconds, columns, paced=False)
        lost += kept(path, seconds)
        one_by_one = stock(path, seconds / 10, columns) * 10
    print(f"in real time  {100 * cpu / seconds:.1f} % of a core, {lost} samples lost, {size / seconds / 1e6:.1f} MB/s")
    print(f"as fed        {seconds / fed:.1f} times real time, {CHANNELS * RATE * seconds / fed / 1e6:.0f} M values/s")
    print(f"mcap package  {seconds / one_by_one:.2f} times real time, one message a sample")
    found = {"core_share": cpu / seconds, "times_real_time": seconds / fed, "stock": seconds / one_by_one, "lost": lost}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
