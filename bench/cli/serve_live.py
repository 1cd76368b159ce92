"""`bench serve --live`: a page that watches a served rig. It asks nothing and stops nothing; what it shows is what is sent."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from bench.cli.live import LivePage, PageRequest, opened
from bench.link.frames import FrameBatch, joined
from bench.link.telemetry import STREAM, TelemetryDecoder
from bench.rigfile import RigFile
from bench.samples import SampleBlock

if TYPE_CHECKING:
    from sim_backend.controller.controller import SimulatedController

HELD = 200  # slices of the loop: a page looks every 25th
ANEW_NS = 1_000_000_000  # after which the frames between are no loss: nobody looked


class Heard:
    """A controller whose frames a page may see as well. The loop appends them and waits for nobody."""

    def __init__(self, rig: RigFile, controller: SimulatedController) -> None:
        self._rig, self._controller = rig, controller
        self._frames: deque[tuple[int, FrameBatch]] = deque(maxlen=HELD)
        self._decoder, self._taken_ns = TelemetryDecoder(rig), 0

    def advance(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """As the controller does."""
        said = self._controller.advance(ticks, incoming, t0_ns)
        if len(said):
            self._frames.append((time.monotonic_ns(), said))
        return said

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)

    def take(self, not_before_ns: int = 0) -> dict[str, list[tuple[int, SampleBlock]]]:
        """As `bench.recording.tap.Tap` does: the samples of the newest frames, decoded when somebody looks."""
        held: list[tuple[int, FrameBatch]] = []
        while self._frames:
            held.append(self._frames.popleft())
        held = [one for one in held if one[0] >= not_before_ns]
        if not held:
            return {}
        if held[0][0] - self._taken_ns > ANEW_NS:
            self._decoder = TelemetryDecoder(self._rig)
        came_ns = self._taken_ns = held[-1][0]
        blocks = self._decoder.decode(joined([frames for _, frames in held]))
        return {STREAM: [(came_ns, block) for block in blocks]} if blocks else {}


class ServedPage:
    """The page of a served rig."""

    def __init__(self, page: LivePage) -> None:
        self.page = page

    def begin(self, rig: RigFile, heard: Heard, origin_ns: int, seed: int, visit: int) -> None:
        """Show what the controller sends from now on."""
        from bench.live.buckets import Buckets
        from bench.live.view import view_of

        view, started = view_of(rig, [TelemetryDecoder(rig).layout]), datetime.now(UTC)
        self.page.site.hub.tell("hello", {
            "schema": 1, "run_id": "", "procedure": "bench serve", "rig": rig.name, "title": rig.title, "backend": "sim",
            "served": True, "seed": seed, "visit": visit, "started": started.isoformat(timespec="seconds"), "simulated": True,
            "may_stop": False, **view.told(),
        })  # fmt: skip
        self.page.publisher.watch(heard, Buckets(view, STREAM, origin_ns), real_time=False)

    def say(self, text: str) -> None:
        """A line of status."""
        self.page.site.hub.tell("log", {"text": text})

    def end(self, why: str) -> None:
        """The rig is not served any more."""
        said = {"outcome": "ENDED", "status": 0, "reason": why, "report": None, "folder": "", "results": []}
        self.page.site.hub.tell("end", said)


@contextmanager
def watched(asked: PageRequest, say: Callable[[str], None]) -> Iterator[ServedPage]:
    """Serve a page within the block; its address is said.

    Raises:
        ConfigError: the port is in use, or there is no such address on this host.
    """
    with opened(asked, None) as page:
        say(page.announced)
        yield ServedPage(page)
