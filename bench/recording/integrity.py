"""What a recording counts of itself, and says at its end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from bench.link.frames import FRAME
from bench.recording import layout


@dataclass
class Integrity:
    """Counts at close: frames by link; samples, losses and blocks by stream. Only what was written is counted; `complete`
    is false when a live queue overflowed, `overflows` times."""

    frames: dict[str, int] = field(default_factory=dict)
    samples: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    blocks: dict[str, int] = field(default_factory=dict)
    events: int = 0
    steps: int = 0
    overflows: int = 0
    complete: bool = True

    def add(self, kind: Literal["frames", "samples", "lost"], name: str, count: int) -> None:
        """So many more, of a link or a stream."""
        counts: dict[str, int] = getattr(self, kind)
        counts[name] = counts.get(name, 0) + count

    def count(self, topic: str, data: bytes) -> None:
        """What a message of another recording of ours adds."""
        if topic == layout.EVENTS:
            self.events += 1
        elif topic.startswith(raw := layout.raw_topic("")):
            self.add("frames", topic.removeprefix(raw), len(layout.decode_frames(data)[1]) // FRAME.itemsize)
        elif topic.endswith("/block"):
            stream, (samples, lost) = topic[1:].removesuffix("/block"), layout.block_counts(data)
            self.add("samples", stream, samples)
            self.add("lost", stream, lost)
