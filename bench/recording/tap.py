"""Where somebody may look at samples while they are recorded: the newest few blocks of each stream, and never more."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable

from bench.samples import SampleBlock

HELD = 8  # blocks of a stream: what a live link brings in 160 ms, what a simulation makes in some tens of ms


class Tap:
    """One thread puts, another takes; neither waits, as both are one step of a deque. The newest wins.

    Args:
        streams: those that are looked at; blocks of others, such as captures, are not held.
    """

    def __init__(self, streams: Iterable[str]) -> None:
        self._held: dict[str, deque[tuple[int, SampleBlock]]] = {name: deque(maxlen=HELD) for name in streams}

    def put(self, block: SampleBlock) -> None:
        """A block that is not changed any more. Raises nothing."""
        held = self._held.get(block.stream)
        if held is not None:
            held.append((time.monotonic_ns(), block))

    def take(self, not_before_ns: int = 0) -> dict[str, list[tuple[int, SampleBlock]]]:
        """By stream what came since it was asked before, at most the newest few, each with the `time.monotonic_ns` at which it
        came; without those from before a moment, and without streams of which nothing came."""
        found: dict[str, list[tuple[int, SampleBlock]]] = {}
        for name, held in self._held.items():
            blocks = []
            while held:
                blocks.append(held.popleft())
            if blocks := [one for one in blocks if one[0] >= not_before_ns]:
                found[name] = blocks
        return found
