"""A controller's link that is only listened to: one thread reads into a bounded buffer. No heartbeat, no session, no send."""

from __future__ import annotations

import contextlib
import logging
import threading
from dataclasses import replace

from bench.errors import LinkError
from bench.link import LinkStats
from bench.link.frames import FrameBatch, empty_batch, joined
from drivers.reception import Reception

READ_S = 0.1  # how long a read waits; close() does not wait for that where it can be cancelled
LIMIT = 200_000  # frames, 200 s of telemetry at 1 kHz
JOIN_S = 5.0

_log = logging.getLogger("drivers")


class Listener:
    """Reads a reception until it is closed or lost; frames have the time at which they came, whatever the caller does."""

    def __init__(self, name: str, reception: Reception, limit: int = LIMIT) -> None:
        self.name, self._reception, self._limit = name, reception, limit
        self._lock = threading.Lock()
        self._buffer: list[FrameBatch] = []
        self._held = self._overflows = 0
        self._error: LinkError | None = None
        self._ending = threading.Event()
        self._reader = threading.Thread(target=self._read, name=f"listen-{name}", daemon=True)
        self._reader.start()

    @property
    def manner(self) -> str:
        """How it listens, in words."""
        return self._reception.manner

    @property
    def complaint(self) -> str:
        """What the adapter said of the bus when it was opened; empty where it said nothing."""
        return self._reception.complaint

    @property
    def stats(self) -> LinkStats:
        """Counts since it was opened; a copy."""
        return replace(self._reception.stats, overflows=self._overflows)

    def receive(self) -> FrameBatch:
        """Everything that came since the last call; never waits.

        Raises:
            LinkError: the link is lost; what came before that comes first.
        """
        with self._lock:
            error = self._error
            batches, self._buffer, self._held = self._buffer, [], 0
        if batches:
            return joined(batches)
        if error is not None:
            raise error
        return empty_batch()

    def close(self) -> None:
        """Release the transport. Calling it twice is harmless."""
        self._ending.set()
        with contextlib.suppress(OSError):
            self._reception.cancel()
        self._reader.join(JOIN_S)
        if self._reader.is_alive():  # a read hangs in a vendor's library; closing under it may crash
            _log.warning("link %s: the reader does not end", self.name)
        else:
            self._reception.close()

    def _read(self) -> None:
        try:
            while not self._ending.is_set():
                self._keep(self._reception.read(READ_S))
        except LinkError as error:
            self._error = error
        except Exception as error:  # a thread that ends without a word would look like silence
            _log.exception("link %s: the reader failed", self.name)
            self._error = LinkError(f"link {self.name}: the reader failed: {type(error).__name__}: {error}")

    def _keep(self, batch: FrameBatch) -> None:
        if not len(batch):
            return
        with self._lock:
            room = self._limit - self._held
            self._overflows += max(0, len(batch) - room)
            if room > 0:
                self._buffer.append(batch[:room])
                self._held += min(len(batch), room)
