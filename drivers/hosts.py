"""Frames that came in and that a host sent: another host's, or our own that the bus brings back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from bench.errors import AnotherHost
from bench.link.codec import Decoder
from bench.link.frames import ERROR, SENT, FrameBatch, payload
from bench.rigfile import RigFile
from bench.rigfile.binding import COMMANDS

ECHO = 100  # heartbeats of ours that a bus may still bring back
RATE, WINDOW_NS = 10, 1_000_000_000  # so many of another host within so long are no stray frames


def host_messages(rig: RigFile) -> set[str]:
    """Names of the messages that a host sends."""
    b = rig.binding
    paths = [path for name in COMMANDS for path in b.command(name)]
    paths += [p.signal for p in rig.parameters.values() if p.signal]
    named = {b.heartbeat, "Claim", "ParamSet", "ParamGet", *(path.partition(".")[0] for path in paths)}
    return named & set(rig.messages.messages)


class HostFrames:
    """Takes what a link brings. `session` is ours, `sent` tells how many heartbeats have gone out.

    Attributes:
        seen: names of the host messages that came in.
    """

    def __init__(self, rig: RigFile, session: int, sent: Callable[[], int]) -> None:
        self._names = {rig.messages[name].identifier: name for name in host_messages(rig)}
        b = rig.binding
        self._heartbeat = rig.messages.messages.get(b.heartbeat)
        self._decoder = Decoder(self._heartbeat) if self._heartbeat is not None else None
        self._counter, self._session, self._sent = b.heartbeat_counter, session, sent
        self._sessions = self._heartbeat is not None and any(s.name == "session" for s in self._heartbeat.signals)
        self._echoed: deque[int] = deque(maxlen=ECHO)
        self._theirs: deque[int] = deque(maxlen=RATE)  # when the last heartbeats came that are not ours
        self._other: int | None = None  # another session
        self.seen: set[str] = set()

    def marked(self, batch: FrameBatch) -> FrameBatch:
        """The batch with them marked as sent."""
        if not self._names.keys().isdisjoint(batch["id"].tolist()):
            theirs = np.isin(batch["id"], list(self._names)) & (batch["flags"] & ERROR == 0)
            batch = batch.copy()
            batch["flags"][theirs] |= SENT
            self.seen |= {self._names[int(i)] for i in batch["id"][theirs]}
            if self._heartbeat is not None:
                for one in batch[theirs & (batch["id"] == self._heartbeat.identifier)]:
                    self._beat(payload(one), int(one["t_ns"]))
        return batch

    def forget(self) -> None:
        """What came before we had the controller counts no more."""
        self._other = None
        self._theirs.clear()

    def check(self) -> None:
        """See that nobody else keeps the controller alive.

        Raises:
            AnotherHost: a heartbeat with another session came; where heartbeats have none, more of them than stray frames
                whose counter is not that of one of ours.
        """
        if self._other is not None:
            raise AnotherHost(
                f"another host (session 0x{self._other:08X}) sends heartbeats to this controller; expected one bench per "
                "rig. Next: end that one"
            )
        if len(self._theirs) == RATE and self._theirs[-1] - self._theirs[0] < WINDOW_NS:
            raise AnotherHost(
                f"another host sends heartbeats to this controller: {RATE} that are not ours came within a second; expected "
                "one bench per rig. Next: end that one"
            )

    def _beat(self, data: bytes, t_ns: int) -> None:
        if self._decoder is None or len(data) != self._decoder.message.length:
            return
        values = self._decoder.decode_one(data)
        if self._sessions:
            if int(values["session"]) != self._session:
                self._other = int(values["session"])
            return
        counter = int(values[self._counter])
        if (self._sent() - counter) & 0xFFFF < ECHO and counter not in self._echoed:
            self._echoed.append(counter)
        else:
            self._theirs.append(t_ns)
