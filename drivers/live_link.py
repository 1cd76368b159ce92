"""A link to a real controller: one reader thread into a bounded buffer, a heartbeat of its own, and reconnection."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from typing import Literal

import numpy as np

from bench.errors import BenchError, ConfigError, LinkError
from bench.link import LinkStats
from bench.link.frames import FrameBatch, empty_batch
from drivers.beat import Beat
from drivers.heartbeat import HeartbeatProcess
from drivers.heartbeat_thread import HeartbeatThread
from drivers.wires import Wire

READ_S = 0.1  # how long a read waits; close() does not wait for that where the wire can be cancelled
RETRY_S = 0.1  # between attempts to open a lost transport again
LIMIT = 200_000  # frames, 200 s of telemetry at 1 kHz
JOIN_S = 5.0

_log = logging.getLogger("drivers")
Heartbeat = HeartbeatProcess | HeartbeatThread


class LiveLink:
    """Implements bench.link.Link on a wire. The thread that reads does nothing else: wire -> buffer."""

    def __init__(
        self,
        name: str,
        open_wire: Callable[[], Wire],
        beat: Beat,
        *,
        heartbeat: Literal["process", "thread"] = "process",
        reconnect_s: float = 0.0,
        limit: int = LIMIT,
    ) -> None:
        """
        Args:
            name: of the link in the rig file.
            open_wire: opens the transport; called again to reconnect.
            beat: the heartbeat message.
            heartbeat: in a process of its own, or in a thread of this one.
            reconnect_s: how long to try again after the transport was lost; 0: not at all.
            limit: frames that the buffer holds; further ones are dropped and counted.

        Raises:
            ConfigError: the transport cannot be opened, or the heartbeat cannot start.
        """
        self._name, self._open_wire, self._reconnect_s, self._limit = name, open_wire, reconnect_s, limit
        self._lock = threading.Lock()
        self._buffer: list[FrameBatch] = []
        self._held = 0
        self._request = b""  # the wire's own, until the one writer of the port has it
        self._overflowed = self._down = False
        self._broken: LinkError | None = None  # what cannot be written any more, on its way to the reader
        self._error: LinkError | None = None  # why the reader ended
        self._ending = threading.Event()
        self._earlier = LinkStats()  # of wires that were lost
        self._wire = open_wire()
        try:
            self._heartbeat = _start(name, self._wire, self._write_now, beat, heartbeat)
            self._share(self._wire)
        except BaseException:
            self._wire.close()
            raise
        self._reader = threading.Thread(target=self._read, name=f"link-{name}", daemon=True)
        self._reader.start()

    @property
    def name(self) -> str:
        """As bench.link.Link says."""
        return self._name

    @property
    def stats(self) -> LinkStats:
        """As bench.link.Link says; a copy."""
        with self._lock:
            total = _sum(self._earlier, self._wire.stats)
        heartbeats, frames, longest = self._heartbeat.counts()
        total.heartbeats, total.longest_heartbeat_gap_ns = heartbeats, longest
        total.refused += self._heartbeat.refused
        total.sent += heartbeats + (
            frames if self._heartbeat.owns_port else 0
        )  # the wire counts what it wrote or spoke
        return total

    @property
    def simulated(self) -> bool:
        """Whether the transport says by itself that a simulation is at its other end."""
        return self._wire.simulated

    @property
    def reopening(self) -> bool:
        """As bench.link.Link says."""
        return self._down

    def send(self, batch: FrameBatch) -> None:
        """As bench.link.Link says."""
        if self._error is not None:
            raise self._error
        if self._down:
            raise LinkError(f"link {self._name} is lost and being opened again; nothing can be sent")
        if isinstance(self._heartbeat, HeartbeatProcess) and self._heartbeat.owns_port:
            if (lines := self._wire.spoken(batch)) is None:
                self._heartbeat.send(batch)
            elif lines:
                self._heartbeat.send_bytes(lines)
        else:
            self._write_now(batch)

    def receive(self) -> FrameBatch:
        """As bench.link.Link says. What came before the link was lost comes first."""
        self._look_after_heartbeat()
        with self._lock:
            error = self._error  # before the buffer is taken: the reader fills it first
            if self._overflowed:
                self._overflowed = False
                raise LinkError(
                    f"link {self._name}: {self._earlier.overflows} frames were dropped because nobody took them: over "
                    f"{self._limit} waited; the bench does not keep up"
                )
            batches, self._buffer, self._held = self._buffer, [], 0
        if not batches:
            if error is not None:
                raise error
            return empty_batch()
        return batches[0] if len(batches) == 1 else np.concatenate(batches)

    @property
    def unpreferred(self) -> str:
        """Why the system does not grant its heartbeats real-time priority; "" where it does."""
        return self._heartbeat.unpreferred

    def renew_lease(self) -> None:
        """As bench.link.Link says."""
        self._heartbeat.renew_lease()

    def hush(self) -> None:
        """End the heartbeats at once; the next renewal of the lease brings them back."""
        self._heartbeat.lapse()

    def close(self) -> None:
        """As bench.link.Link says."""
        self._ending.set()
        self._heartbeat.close()
        self._wire.cancel()
        self._reader.join(JOIN_S)
        if self._reader.is_alive():  # a read hangs in a vendor's library; closing under it may crash
            _log.warning("link %s: the reader does not end; it closes the interface when it does", self._name)
        else:
            self._wire.close()

    # In the bench's thread

    def _look_after_heartbeat(self) -> None:
        """Without heartbeats the controller lands; then the link is as good as lost, also where frames still come."""
        if self._down or self._error is not None or self._ending.is_set():
            return
        with self._lock:
            request, self._request = self._request, b""
        with contextlib.suppress(LinkError):  # the fault below
            if request:
                self._heartbeat.send_bytes(request)
        fault = self._heartbeat.fault if isinstance(self._heartbeat, HeartbeatProcess) else None
        if fault is not None and not self._down:
            self._break(LinkError(f"link {self._name}: no heartbeats: {fault}"))

    def _write_now(self, batch: FrameBatch) -> None:
        """For the heartbeat's thread as well."""
        try:
            self._wire.write(batch)
        except LinkError as error:
            if not self._down:
                self._break(error)
            raise

    def _break(self, error: LinkError) -> None:
        self._broken = error
        self._wire.cancel()

    # In the reader's thread

    def _read(self) -> None:
        try:
            while not self._ending.is_set():
                if (error := self._read_once()) is not None and (error := self._again(error)) is not None:
                    self._error = error
                    return
        except Exception as error:  # a thread that ends without a word would look like silence
            _log.exception("link %s: the reader failed", self._name)
            self._error = LinkError(f"link {self._name}: the reader failed: {type(error).__name__}: {error}")
        finally:
            if self._ending.is_set():
                self._wire.close()

    def _read_once(self) -> LinkError | None:
        try:
            self._keep(self._wire.read(READ_S))
        except LinkError as error:
            return error
        return self._broken

    def _keep(self, batch: FrameBatch) -> None:
        if not len(batch):
            return
        with self._lock:
            room = self._limit - self._held
            if len(batch) > room:
                self._earlier.overflows += len(batch) - room
                self._overflowed = True
                batch = batch[:room]
            if len(batch):
                self._buffer.append(batch)
                self._held += len(batch)

    def _again(self, error: LinkError) -> LinkError | None:
        """Open the transport once more; the error when it is not to be, or does not come back in time."""
        if not self._reconnect_s or self._ending.is_set():
            return error
        _log.warning("%s; trying to open it again for %g s", error, self._reconnect_s)
        self._down = True
        try:
            self._let_go()
            return self._reopened(error)
        except LinkError as fault:  # the heartbeat process is gone as well
            return fault

    def _let_go(self) -> None:
        """Close the port in both processes: an adapter that is plugged in again gets its old name only then, and none
        of the heartbeats may come between the lines that set it up."""
        if self._heartbeat.owns_port:
            self._heartbeat.replace_port(None)
        self._wire.close()

    def _reopened(self, error: LinkError) -> LinkError | None:
        reason: Exception = error
        deadline = time.monotonic() + self._reconnect_s
        while not self._ending.wait(RETRY_S) and time.monotonic() < deadline:
            try:
                wire = self._open_wire()
            except BenchError as found:
                reason = found
                continue
            self._resume(wire)
            return None
        return LinkError(f"{error}; it did not come back within {self._reconnect_s:g} s (last: {reason})")

    def _resume(self, wire: Wire) -> None:
        with self._lock:
            self._earlier = _sum(self._earlier, self._wire.stats)
            self._earlier.reconnects += 1
            self._wire = wire
        self._heartbeat.replace_port(wire.writer().fileno)
        self._share(wire)
        self._broken, self._down = None, False
        _log.warning("link %s is open again", self._name)

    def _share(self, wire: Wire) -> None:
        if isinstance(self._heartbeat, HeartbeatProcess) and self._heartbeat.owns_port:
            wire.written_by(self._later)

    def _later(self, request: bytes) -> None:
        """The bench's thread hands it to the writer: that may wait for the port, which the reader must not."""
        with self._lock:
            self._request = request


def _start(
    name: str, wire: Wire, write: Callable[[FrameBatch], None], beat: Beat, where: Literal["process", "thread"]
) -> Heartbeat:
    spec = wire.writer()
    if where == "process" and spec.format != "none":
        try:
            return HeartbeatProcess(beat, spec)
        except ConfigError as error:
            raise ConfigError(f"link {name}: {error}") from error
    if where == "process":
        _log.warning(
            "link %s: no other process can reach this interface, so the heartbeat is a thread of the bench; it may be "
            "late while the bench computes (heartbeat = \"thread\" in the rig file says that this is meant)", name
        )  # fmt: skip
    return HeartbeatThread(beat, write)


def _sum(a: LinkStats, b: LinkStats) -> LinkStats:
    return LinkStats(**{f.name: getattr(a, f.name) + getattr(b, f.name) for f in fields(LinkStats)})
