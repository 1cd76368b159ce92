"""A small recording that several tests make: made-up samples with a gap, steps, events, raw frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.link.frames import FD, SENT, FrameBatch, frame
from bench.recording.integrity import Integrity
from bench.recording.recorder import Recorder, RunHeader
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

START_NS = 1_767_225_600 * 10**9
PERIOD_NS = 1_000_000
STREAM = StreamLayout(
    "telemetry", PERIOD_NS, (ChannelInfo("pos_yi", "m"), ChannelInfo("i_yi_p", "A"), ChannelInfo("state", "1", "u2"))
)
HEADER = RunHeader(
    {"run": {"procedure": "amb-calibration", "seed": "7"}, "versions": {"levbench": "0"}},
    {"rig.toml": b"schema = 1\n", "plan.json": b'{"angles": 8}'},
)


class SetClock:
    """A clock that stands where it was set."""

    def __init__(self, now_ns: int = START_NS) -> None:
        self.now = now_ns

    def now_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


def block(first: int, count: int, lost: int = 0) -> SampleBlock:
    """Samples that follow from their index alone, so any mistake in order or place shows."""
    index = np.arange(first, first + count)
    columns = {
        "pos_yi": 1e-6 * np.sin(0.7 * index) + 1e-9 * index,
        "i_yi_p": 3 + 0.25 * np.cos(1.3 * index),
        "state": (index // 7 % 8).astype(np.float64),
    }
    return SampleBlock("telemetry", first, (index * 10).astype(np.uint64), START_NS + index * PERIOD_NS,
                       START_NS + (first + count) * PERIOD_NS, lost, columns)  # fmt: skip


def frames_of(part: SampleBlock) -> FrameBatch:
    """One frame a sample; its bytes tell its index."""
    batch = np.concatenate([frame(0x100, int(t).to_bytes(8, "little"), flags=FD) for t in part.ticks])
    batch["t_ns"] = part.t_ns
    return batch


def record(
    path: Path, blocks: list[SampleBlock], *, header: RunHeader = HEADER, note: str = "", captured: int = 0
) -> Integrity:
    """Blocks with their frames; a step around each block, labelled with its number; captures of 1500 samples at the end."""
    clock = SetClock()
    with Recorder(path, clock=clock, streams=[STREAM], header=header) as recorder:
        recorder.event("state", now="LEVITATED", note=note)
        for k, part in enumerate(blocks):
            clock.now = int(part.t_ns[0])
            with recorder.step("dwell", block=k, odd=bool(k % 2)):
                recorder.frames("controller", frames_of(part))
                recorder.samples(part)
                clock.now = int(part.t_ns[-1]) + PERIOD_NS
        recorder.frames("controller", frame(0x11, b"\1\0\0\0\4\0\0\0", t_ns=clock.now, flags=SENT | FD))
        for n in range(1, captured + 1):
            _capture(recorder, n)
        recorder.event("state", now="READY")
        recorder.wall["started"] = "2026-01-01"
        return recorder.close()


def _capture(recorder: Recorder, number: int) -> None:
    """At 10 kHz over the second block; its channel counts."""
    name, index, start = f"capture/{number}", np.arange(1500), START_NS + 100 * PERIOD_NS
    recorder.stream(StreamLayout(name, 100_000, (ChannelInfo("inject", "A"),)))
    columns = {"inject": index.astype(np.float64)}
    recorder.samples(SampleBlock(name, 0, (1000 + index).astype(np.uint64), start + 100_000 * index, start, 0, columns))
    recorder.event("capture", stream=name, labels={"n": number}, samples=1500, rate_hz=1e4, first_tick=1000, start_ns=start,
                   trigger=0, waited_for={"kind": "NOW", "channel": "", "level": 0.0})  # fmt: skip


def gapped() -> list[SampleBlock]:
    """2.3 s in blocks of 100 samples; 5 samples are lost before index 1205."""
    return [block(n, 100) for n in range(0, 1200, 100)] + [
        block(n, 100, lost=5 if n == 1205 else 0) for n in range(1205, 2305, 100)
    ]
