"""Who is on the bus: frames counted by identifier, with their lengths and rates, beside what the DBC knows."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np

from bench.link.frames import ERROR, EXTENDED, FrameBatch
from bench.rigfile import RigFile
from bench.rigfile.messages import Message
from bench.wire import sign

RECENT_S = 2.0  # over which a rate is told
SETTLED_S = 0.5  # what had waited somewhere has come by then; a mean rate begins there


@dataclass
class Tally:
    """Frames of one identifier: how many, their lengths (bytes to count), when the first and the last came."""

    identifier: int
    first_ns: int
    last_ns: int
    count: int = 0
    lengths: Counter[int] = field(default_factory=Counter)
    _recent: deque[tuple[int, int]] = field(default_factory=deque)  # time and count of the batches of RECENT_S
    _settled: tuple[int, int] | None = None  # time, and how many had come by then

    def add(self, t_ns: int, lengths: Counter[int]) -> None:
        """Frames that came together."""
        n = lengths.total()
        self.count += n
        self.lengths += lengths
        self.last_ns = t_ns
        if self._settled is None and t_ns >= self.first_ns + SETTLED_S * 1e9:
            self._settled = t_ns, self.count
        self._recent.append((t_ns, n))
        while self._recent[0][0] < t_ns - RECENT_S * 1e9:
            self._recent.popleft()

    def rate_hz(self, now_ns: int) -> float:
        """Frames a second of late; 0.0 where none came."""
        since = max(now_ns - round(RECENT_S * 1e9), self.first_ns)
        count = sum(n for t_ns, n in self._recent if t_ns > since)
        return count / ((now_ns - since) * 1e-9) if now_ns > since else 0.0

    @property
    def mean_hz(self) -> float:
        """Frames a second up to the last; 0.0 where too few came."""
        begin_ns, before = self._settled or (self.first_ns, 1)
        spanned = (self.last_ns - begin_ns) * 1e-9
        return (self.count - before) / spanned if spanned > 0 else 0.0


def named(identifier: int) -> str:
    """An identifier as people write it: 0x123, with eight digits where it has 29 bits."""
    return f"0x{identifier & ~EXTENDED:08X}" if identifier & EXTENDED else f"0x{identifier:03X}"


class Census:
    """Counts frames; `errors` are destroyed ones that the interface reports."""

    def __init__(self, rig: RigFile) -> None:
        b = rig.binding
        self.by_id: dict[int, Tally] = {}
        self.errors = 0
        self.known: dict[int, Message] = {m.identifier: m for m in rig.messages.messages.values()}
        self.telemetry: tuple[Message, ...] = tuple(rig.messages[name] for name in b.telemetry)
        heartbeat = rig.messages.messages.get(b.heartbeat)  # a rig file that is not finished may have none
        self._host = heartbeat.sender if heartbeat is not None else ""
        self._heartbeat = heartbeat.identifier if heartbeat is not None else -1

    def take(self, batch: FrameBatch) -> None:
        """Count them."""
        destroyed = batch["flags"] & ERROR != 0
        if destroyed.any():
            self.errors += int(destroyed.sum())
            batch = batch[~destroyed]
        for identifier in np.unique(batch["id"]).tolist():
            mine = batch[batch["id"] == identifier]
            first, last = int(mine["t_ns"][0]), int(mine["t_ns"][-1])
            tally = self.by_id.get(identifier)
            if tally is None:
                tally = self.by_id[identifier] = Tally(identifier, first, last)
            tally.add(last, Counter(mine["length"].tolist()))

    def of(self, message: Message) -> Tally | None:
        """Frames with its identifier, whatever their length."""
        return self.by_id.get(message.identifier)

    @property
    def unknown(self) -> list[Tally]:
        """Those that the DBC does not know, by identifier; the sign of a simulation is nobody's."""
        return [t for i, t in sorted(self.by_id.items()) if i not in self.known and i != sign.IDENTIFIER]

    @property
    def simulated(self) -> bool:
        """Whether the sign of a served simulation came."""
        return sign.IDENTIFIER in self.by_id

    @property
    def strange(self) -> int:
        """How many frames those are."""
        return sum(t.count for t in self.unknown)

    @property
    def misshapen(self) -> list[tuple[Message, dict[int, int]]]:
        """Messages of which frames came that do not have the DBC's length: lengths that came, and how many. Not those whose
        frames are segments of something longer."""
        out = []
        for identifier, tally in sorted(self.by_id.items()):
            message = self.known.get(identifier)
            if message is None or _segmented(message):
                continue
            if wrong := {n: c for n, c in sorted(tally.lengths.items()) if n != message.length}:
                out.append((message, wrong))
        return out

    @property
    def absent(self) -> list[Message]:
        """Messages that should come by themselves, all of telemetry and what else has a period, and never did."""
        due = [m for m in self.known.values() if m in self.telemetry or (m.period_s and not self._of_host(m))]
        return [m for m in due if m.identifier not in self.by_id]

    @property
    def silent(self) -> list[Message]:
        """Messages that the controller sends when it is asked, and that did not come."""
        due = [m for m in self.known.values() if m not in self.telemetry and not m.period_s and not self._of_host(m)]
        return [m for m in due if m.identifier not in self.by_id]

    @property
    def of_hosts(self) -> list[tuple[Message, Tally]]:
        """What a host says: somebody else's."""
        return [(m, self.by_id[i]) for i, m in sorted(self.known.items()) if i in self.by_id and self._of_host(m)]

    def _of_host(self, message: Message) -> bool:
        return message.identifier == self._heartbeat or bool(self._host and message.sender == self._host)


def _segmented(m: Message) -> bool:
    return m.name == "CaptureBlock" or (m.length > 8 and not m.fd)
