"""The thread between a run and its pages: twenty times a second it takes what is newest. It is the only one that works."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Protocol

from bench.clock import WallClock
from bench.live.buckets import Buckets
from bench.live.hub import Hub
from bench.samples import SampleBlock

logger = logging.getLogger("bench.live")
PERIOD_S = 0.05
OLD_NS = 300_000_000  # of a machine that moves: what was taken by nobody for so long is not shown any more


class Source(Protocol):
    """Where samples are taken, such as `bench.recording.tap.Tap`."""

    def take(self, not_before_ns: int = 0) -> Mapping[str, Sequence[tuple[int, SampleBlock]]]:
        """By stream what came since it was asked before, each block with the `time.monotonic_ns` at which it came."""
        ...


class Publisher:
    """Moves what a run told to what stands, and makes messages of samples while a page waits for one."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._watched: tuple[Source, Buckets, WallClock | None] | None = None
        self._end = threading.Event()

    def watch(self, tap: Source, buckets: Buckets, *, real_time: bool) -> None:
        """Show the samples of a tap from now on. In real time their age counts from when the host heard them, by a clock that
        does not step as the links' does not; else from when they came into the tap."""
        self._watched = tap, buckets, WallClock() if real_time else None

    def look(self) -> None:
        """Once: what was told, and the newest samples if a page waits."""
        self._hub.settle()
        if self._watched is None or not self._hub.wanted:
            return
        tap, buckets, host = self._watched
        now = time.monotonic_ns()
        # A simulation stands still while somebody is asked: who looks then sees where it stands, and how long ago that was.
        taken = tap.take(now - OLD_NS if host else 0)
        if taken:
            message = buckets.message(
                {name: [b for _, b in blocks] for name, blocks in taken.items()},
                _age_ms(taken.get(buckets.main, ()), now, host),
            )
            if message is not None:
                self._hub.publish("samples", message)

    @contextmanager
    def publishing(self) -> Iterator[Publisher]:
        """Look again and again within the block, in a thread of its own; once more at its end."""
        thread = threading.Thread(target=self._run, name="live-publisher", daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self._end.set()
            thread.join()
            self._looked()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._end.wait(max(0.0, due - time.monotonic())):
            due = max(due + PERIOD_S, time.monotonic())
            self._looked()

    def _looked(self) -> None:
        try:
            self.look()
        except Exception:
            logger.debug("the live page could not be served", exc_info=True)


def _age_ms(blocks: Sequence[tuple[int, SampleBlock]], now: int, host: WallClock | None) -> float:
    """How old the newest block is; 0 of none. Of the main stream: a polled device's is stamped by the sample clock, which may
    be ahead of the host's."""
    if not blocks:
        return 0.0
    came_ns, newest = blocks[-1]
    return (host.now_ns() - newest.host_ns if host else now - came_ns) * 1e-6
