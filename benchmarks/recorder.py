"""The recorder alone: 30 channels at 1 kHz for 60 s of bench time, raw frames, decoded blocks and the 100 Hz view to
disk, closing included; then the reading back. A sample is one channel value. No simulator, no decoder.

    python benchmarks/recorder.py
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.link.frames import FRAME, FrameBatch
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

CHANNELS, RATE, SECONDS, SLICE, REPEATS = 30, 1000, 60, 100, 3
START_NS = 1_767_225_600 * 10**9
STREAM = StreamLayout("telemetry", 10**9 // RATE, tuple(ChannelInfo(f"c{k}", "A") for k in range(CHANNELS)))


class StillClock:
    """Nothing here depends on the time."""

    def now_ns(self) -> int:
        return START_NS

    def sleep(self, seconds: float) -> None:
        raise AssertionError(f"nobody sleeps {seconds} s here")


def made() -> list[tuple[FrameBatch, SampleBlock]]:
    """Telemetry as a controller sends it, in slices of 0.1 s: sines with noise, in 16 bits."""
    generator = np.random.default_rng(0)
    index = np.arange(RATE * SECONDS)
    phase = index[:, None] * np.linspace(0.01, 0.3, CHANNELS)
    counts = np.round(8000 * np.sin(phase) + generator.normal(0, 20, phase.shape)).astype("<i2")
    out = []
    for a in range(0, len(index), SLICE):
        part = slice(a, a + SLICE)
        t_ns = START_NS + index[part] * STREAM.period_ns
        frames = np.zeros(SLICE, FRAME)
        frames["t_ns"], frames["id"], frames["length"] = t_ns, 0x100, 64
        frames["data"][:, : 2 * CHANNELS] = counts[part].copy().view(np.uint8)
        columns = {c.name: counts[part, k] * 0.0005 for k, c in enumerate(STREAM.channels)}
        ticks = (index[part] * 10).astype(np.uint64)
        out.append((frames, SampleBlock("telemetry", a, ticks, t_ns, int(t_ns[-1]), 0, columns)))
    return out


def write(path: Path, telemetry: list[tuple[FrameBatch, SampleBlock]]) -> float:
    path.unlink(missing_ok=True)
    begun = time.perf_counter()
    with Recorder(path, clock=StillClock(), streams=[STREAM], header=RunHeader({}, {})) as recorder:
        for frames, samples in telemetry:
            recorder.frames("can0", frames)
            recorder.samples(samples)
    return time.perf_counter() - begun


def read(path: Path) -> float:
    begun = time.perf_counter()
    recording: Recording[Any] = Recording.open(path)
    found = recording.read(tuple(c.name for c in STREAM.channels), 0, 1 << 62)
    assert len(found["t_ns"]) == RATE * SECONDS
    return time.perf_counter() - begun


def main() -> None:
    telemetry = made()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        writing = min(write(path, telemetry) for _ in range(REPEATS))
        reading = min(read(path) for _ in range(REPEATS))
        size = path.stat().st_size
    samples = CHANNELS * RATE * SECONDS
    for what, took in (("write", writing), ("read", reading)):
        print(f"{what:5}  {took:.2f} s: {SECONDS / took:.0f} times real time, {samples / took / 1e6:.1f} M samples/s")
    print(f"file   {size / 1e6:.1f} MB, {size / SECONDS / 1e3:.0f} kB per second of bench time")
    print(json.dumps({"write_s": writing, "read_s": reading, "bytes": size, "samples": samples}))


if __name__ == "__main__":
    main()
