"""The command line's `cap`: to arm a capture, ask how it stands, read a part of it, give it up."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sim_backend.machines.lira.capture import EVERY, FAST, MEMORY, TRIGGERS, Capture
from sim_backend.machines.lira.settings import MEASUREMENTS
from sim_backend.machines.lira.shell import Refused, number


class Captures:
    """One capture at a time."""

    def __init__(self) -> None:
        self._capture: Capture | None = None
        self._count = 0

    @property
    def running(self) -> Capture | None:
        """The capture that samples are still missing of."""
        return None if self._capture is None or self._capture.full else self._capture

    def forget(self) -> None:
        """As after power-on."""
        self._capture, self._count = None, 0

    def stepped(self) -> None:
        """A current's set point was stepped."""
        if self._capture is not None:
            self._capture.stepped = True

    def do(self, *words: str) -> Iterable[str | bytes]:
        """Carry out a request, without its `cap`.

        Raises:
            Refused: it cannot be done.
        """
        parts: dict[str, Callable[..., Iterable[str | bytes]]] = {
            "arm": self._arm,
            "stat": self._cap_stat,
            "read": self._read,
            "cancel": self._cancel,
        }
        if not words or words[0] not in parts:
            raise Refused(2, "|".join(parts))
        return parts[words[0]](*words[1:])

    def _arm(self, *words: str) -> Iterable[str]:
        if len(words) < 5 or words[4] not in TRIGGERS or len(words) != (7 if words[4] == "level" else 5):
            raise Refused(2, "mask rate length before now|step|level channel value")
        try:
            mask = int(words[0], 16)
        except ValueError:
            raise Refused(2, "mask: hexadecimal") from None
        rate, length, before = (int(number(w)) for w in words[1:4])
        channels = tuple(k for k in range(len(MEASUREMENTS)) if mask >> k & 1)
        if rate not in EVERY or not channels or mask >> len(MEASUREMENTS) or length < 1 or not 0 <= before < length:
            raise Refused(3, f"mask of {len(MEASUREMENTS)} channels, 35000|140000|280000, before < length")
        if (rate > 35_000 and len(channels) > FAST) or 2 * len(channels) * length > MEMORY:
            raise Refused(3, f"{FAST} channels above 35000 Hz, {MEMORY} bytes")
        self._count = self._count % 0xFFFE + 1  # never that of telemetry, nor 0
        capture = Capture(self._count, channels, EVERY[rate], length, before, words[4])
        if words[4] == "level":
            names = [MEASUREMENTS[k].name for k in channels]
            if words[5] not in names:
                raise Refused(3, f"level: {words[5]} is not captured")
            capture.channel = names.index(words[5])
            capture.level = round(number(words[6]) / MEASUREMENTS[channels[capture.channel]].lsb)
        self._capture = capture
        return [f"{capture.number} bytes={capture.size}"]

    def _cap_stat(self) -> Iterable[str]:
        c = self._captured()
        told = f"bytes={c.size} samples={c.samples} trigger={c.before_trigger} tick={c.first_tick} every={c.every}"
        crc = f" crc={c.crc}" if c.full else ""
        return [f"{c.number} {c.state} {told} channels={len(c.channels)}{crc}"]

    def _read(self, *words: str) -> Iterable[str | bytes]:
        c = self._captured()
        if len(words) != 2 or not all(w.isdigit() for w in words):
            raise Refused(2, "offset length")
        if not c.full:
            raise Refused(4, c.state)
        blocks = list(c.blocks(int(words[0]), int(words[1])))
        return [*blocks, f"cap sent={len(blocks)}"]

    def _cancel(self) -> Iterable[str]:
        self._captured()
        self._capture = None
        return []

    def _captured(self) -> Capture:
        if self._capture is None:
            raise Refused(10)
        return self._capture
