"""What stands of a run, for pages that connect early, late or twice: each reader keeps a place in the order of events.

The run's thread appends to a bounded box (`tell`); the publisher moves what is in it to what stands (`settle`), and readers
`follow`. Nothing is queued for a reader: of what changes the newest stands, of findings, log lines and answers the last ones.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

BOX = 5000  # events that the run may tell between two looks of the publisher; of more the oldest are lost
KEPT: Mapping[str, int] = {"finding": 500, "log": 200, "answered": 50}
"""Events of which the last ones stand; of every other kind the newest."""
FIRST = "hello"


class Hub:
    """Of one run. `tell` is for the run's thread, `settle` and `publish` for the publisher's, `follow` for those of clients."""

    def __init__(self) -> None:
        self._told: deque[tuple[str, Mapping[str, Any] | None]] = deque(maxlen=BOX)
        self._changed = threading.Condition()
        self._serial = 0
        self._newest: dict[str, tuple[int, bytes]] = {}
        self._last: dict[str, deque[tuple[int, bytes]]] = {kind: deque(maxlen=n) for kind, n in KEPT.items()}
        self._waiting = self._readers = 0
        self._behind: dict[int, int] = {}  # by reader: how far it has been told
        self.closed = False

    def tell(self, kind: str, data: Mapping[str, Any] | None) -> None:
        """An event of the run; None: nothing of that kind stands any more. Never waits and never raises."""
        self._told.append((kind, data))

    def settle(self) -> None:
        """Move what was told to what stands."""
        told: list[tuple[str, Mapping[str, Any] | None]] = []
        while self._told:
            told.append(self._told.popleft())
        newest = {kind: k for k, (kind, _) in enumerate(told) if kind not in KEPT}
        lasting = [(kind, data) for k, (kind, data) in enumerate(told) if newest.get(kind, k) == k]
        encoded = [(kind, None if data is None else event_bytes(kind, data)) for kind, data in lasting]
        if encoded:
            with self._changed:
                for kind, event in encoded:
                    self._stand(kind, event)
                self._changed.notify_all()

    def publish(self, kind: str, event: bytes) -> None:
        """An event that is encoded already."""
        with self._changed:
            self._stand(kind, event)
            self._changed.notify_all()

    def _stand(self, kind: str, event: bytes | None) -> None:
        self._serial += 1
        if event is None:
            self._newest.pop(kind, None)
        elif kind in self._last:
            self._last[kind].append((self._serial, event))
        else:
            self._newest[kind] = (self._serial, event)

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
        return "end" in self._newest

    @property
    def all_told(self) -> bool:
        """Whether every reader has been sent the end, if there is one."""
        with self._changed:
            end = self._newest.get("end", (0, b""))[0]
            return all(place >= end for place in self._behind.values())

    @contextmanager
    def reading(self) -> Iterator[Reader]:
        """A place among the readers."""
        reader = Reader(self)
        with self._changed:
            self._readers += 1
            self._behind[id(reader)] = 0
        try:
            yield reader
        finally:
            with self._changed:
                self._readers -= 1
                del self._behind[id(reader)]

    def follow(self, reader: Reader, seconds: float) -> bytes:
        """What came since the reader's place, or nothing after so long. What it is sent counts as told when it comes again."""
        until = time.monotonic() + seconds
        with self._changed:
            self._behind[id(reader)] = reader.place
            self._waiting += 1
            try:
                while self._serial <= reader.place and not self.closed and (left := until - time.monotonic()) > 0:
                    self._changed.wait(left)
            finally:
                self._waiting -= 1
            new = [(kind != FIRST, *one) for kind, one in self._newest.items() if one[0] > reader.place]
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


def event_bytes(kind: str, data: Mapping[str, Any]) -> bytes:
    """One server-sent event (WHATWG HTML, 9.2): JSON has no line break outside of its strings, and none inside."""
    return f"event: {kind}\ndata: {json.dumps(data, allow_nan=False, separators=(',', ':'))}\n\n".encode()
