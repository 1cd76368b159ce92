"""What stands of a run, for pages that connect early, late or twice: each reader keeps a place in the order of events.

The run's thread appends to a bounded box (`tell`); the publisher moves what is in it to what stands (`settle`), and readers
`follow`. Nothing is queued for a reader: of what changes the newest stands, of findings, log lines and answers the last ones.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

logger = logging.getLogger("bench.live")
BOX = 5000  # events that the run may tell between two looks of the publisher; of more the oldest are lost
KEPT: Mapping[str, int] = {"log": 200, "answered": 50}
"""Events of which the last ones stand; of every other kind the newest, with its key."""
FIRST, END = "hello", ("end", "")
Place = tuple[str, str]  # kind and key
Told = tuple[Place, Mapping[str, Any] | None]


class Hub:
    """Of one run. `tell` is for the run's thread, `settle` and `publish` for the publisher's, `follow` for those of clients."""

    def __init__(self) -> None:
        self._told: deque[Told] = deque(maxlen=BOX)
        self._changed = threading.Condition()
        self._serial = 0
        self._newest: dict[tuple[str, str], tuple[int, bytes]] = {}
        self._last: dict[str, deque[tuple[int, bytes]]] = {kind: deque(maxlen=n) for kind, n in KEPT.items()}
        self._waiting = self._readers = 0
        self.closed = False

    def tell(self, kind: str, data: Mapping[str, Any] | None, key: str = "") -> None:
        """An event of the run, in the place of one of that kind with the same key; None: nothing stands there any more. Never
        waits and never raises."""
        self._told.append(((kind, key), data))

    def settle(self) -> None:
        """Move what was told to what stands."""
        told: list[Told] = []
        while self._told:
            told.append(self._told.popleft())
        newest = {place: k for k, (place, _) in enumerate(told) if place[0] not in KEPT}
        self._stand([(p, _encoded(p[0], data)) for k, (p, data) in enumerate(told) if newest.get(p, k) == k])

    def publish(self, kind: str, data: Mapping[str, Any]) -> None:
        """An event of the publisher's own."""
        self._stand([((kind, ""), _encoded(kind, data))])

    def _stand(self, events: Sequence[tuple[Place, bytes | None]]) -> None:
        if not events:
            return
        with self._changed:
            for place, event in events:
                self._serial += 1
                if event is None:
                    self._newest.pop(place, None)
                elif place[0] in self._last:
                    self._last[place[0]].append((self._serial, event))
                else:
                    self._newest[place] = (self._serial, event)
            self._changed.notify_all()

    @property
    def wanted(self) -> bool:
        """Whether a reader waits for something new; one that is slow, stopped or gone does not."""
        return self._waiting > 0

    @property
    def readers(self) -> int:
        return self._readers

    @property
    def ended(self) -> bool:
        """Whether the end stands."""
        return END in self._newest

    @contextmanager
    def reading(self) -> Iterator[Reader]:
        """A place among the readers."""
        reader = Reader(self)
        with self._changed:
            self._readers += 1
        try:
            yield reader
        finally:
            with self._changed:
                self._readers -= 1

    def follow(self, reader: Reader, seconds: float) -> bytes:
        """What came since the reader's place, or nothing after so long."""
        until = time.monotonic() + seconds
        with self._changed:
            self._waiting += 1
            try:
                while self._serial <= reader.place and not self.closed and (left := until - time.monotonic()) > 0:
                    self._changed.wait(left)
            finally:
                self._waiting -= 1
            new = [(place[0] != FIRST, *one) for place, one in self._newest.items() if one[0] > reader.place]
            new += [(True, *one) for kept in self._last.values() for one in kept if one[0] > reader.place]
            reader.place = self._serial
        return b"".join(event for _, _, event in sorted(new, key=lambda one: one[:2]))

    def close(self) -> None:
        """Let every reader go."""
        with self._changed:
            self.closed = True
            self._changed.notify_all()


class Reader:
    """How far somebody has been told."""

    def __init__(self, hub: Hub) -> None:
        self.place, self._hub = 0, hub

    def more(self, seconds: float) -> bytes:
        """What is new, waited for so long; b"" if nothing is."""
        return self._hub.follow(self, seconds)


def _encoded(kind: str, data: Mapping[str, Any] | None) -> bytes | None:
    """One server-sent event (WHATWG HTML, 9.2); JSON as it is made here has no line break. Nothing stands of what cannot be
    said in it."""
    if data is None:
        return None
    try:
        text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    except (TypeError, ValueError):
        logger.debug("an event %s cannot be shown", kind, exc_info=True)
        return None
    return f"event: {kind}\ndata: {text}\n\n".encode()
