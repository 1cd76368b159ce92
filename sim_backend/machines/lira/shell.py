"""The firmware's line discipline: characters to requests, requests to replies. What a request does is the business of a device.

At power-up it echoes and prompts, as a person wants it; a program switches both off. A line of a request with its checksum is
answered with one. The reply to the last request with a tag is kept: the same line again is answered and not done again."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final, Protocol

from bench.wire.commandline import read_request, with_checksum

LONGEST: Final = 96
PROMPT: Final = "lira> "
BACKSPACES: Final = (0x08, 0x7F)
ERRORS: Final = {
    1: "unknown verb", 2: "arguments", 3: "range", 4: "state", 5: "busy", 6: "checksum", 7: "too long", 8: "not owner",
    9: "hardware fault", 10: "no capture",
}  # fmt: skip


class Refused(Exception):
    """A request that is not done: a code of `ERRORS` and what is to be said beside."""

    def __init__(self, code: int, text: str = "") -> None:
        super().__init__(f"{code} {ERRORS[code]}{f' {text}' if text else ''}")


def number(text: str) -> float:
    """A finite number that was typed.

    Raises:
        Refused: it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Refused(2, f"{text[:20]}: a number")
    return value


def single(value: float) -> float:
    """A number as a float of 32 bits holds it, and infinity where it does not."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.inf


class Device(Protocol):
    """What does requests: lines of a reply, the last of which goes with the ok; bytes are sent as they are, before it."""

    def do(self, words: tuple[str, ...]) -> Iterable[str | bytes]: ...


class Shell:
    """One command line.

    Args:
        device: does what is asked.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self.echo = self.prompt = True
        self.checksums = False
        """A checksum on every line, also on those that nobody asked for."""
        self.events = True
        self._line = bytearray()
        self._too_long = False
        self._last: tuple[str, bytes] = ("", b"")
        self._waiting: list[str] = []
        self.later: deque[list[bytes]] | None = None
        """Where replies with blocks go, piece by piece, for a line that they take time on; None: they are answered at once."""

    def feed(self, data: bytes) -> bytes:
        """What is answered to these characters."""
        return b"".join(self._answers(data))

    def tell(self, tick: int, name: str, text: str = "") -> None:
        """An event; it goes out with `told`, never inside a reply or a block."""
        if self.events:
            self._waiting.append(f"! {tick} {name}{f' {text}' if text else ''}")

    def told(self) -> bytes:
        """The events that wait."""
        out = b"".join(self._ended(line, self.checksums) for line in self._waiting)
        self._waiting.clear()
        return out

    def _answers(self, data: bytes) -> Iterator[bytes]:
        for byte in data:
            if self.echo and byte < 0x80:
                yield b"\r\n" if byte == 0x0A else bytes([byte])
            if byte == 0x0A:
                yield self._answered()
                continue
            if byte in BACKSPACES:
                del self._line[-1:]
            elif 0x20 <= byte < 0x7F:
                self._too_long |= len(self._line) >= LONGEST
                self._line += bytes([byte] if not self._too_long else [])

    def _answered(self) -> bytes:
        """The reply to the line that has just ended, and the next prompt."""
        text, too_long = self._line.decode("ascii"), self._too_long
        self._line.clear()
        self._too_long = False
        reply = b"" if not text.strip() and not too_long else self._reply(text, too_long)
        return reply + (PROMPT.encode() if self.prompt else b"")

    def _reply(self, text: str, too_long: bool) -> bytes:
        if too_long:
            return self._ended(f"- err 7 {ERRORS[7]}", self.checksums)
        asked = read_request(text)
        if asked is None:
            return self._ended(f"- err 6 {ERRORS[6]}", self.checksums)
        if asked.tag is not None and text == self._last[0]:
            return self._last[1]
        out = self._done("-" if asked.tag is None else str(asked.tag), asked.words, asked.checked or self.checksums)
        if asked.tag is not None:
            self._last = text, out
        return out

    def _done(self, tag: str, words: tuple[str, ...], checked: bool) -> bytes:
        try:
            said = [""] if not words else list(self._device.do(words)) or [""]
        except Refused as refused:
            return self._ended(f"{tag} err {refused}", checked)
        out = [part if isinstance(part, bytes) else self._ended(f"{tag} + {part}", checked) for part in said[:-1]]
        last = said[-1]
        assert isinstance(last, str)
        out.append(self._ended(f"{tag} ok {last}".rstrip(), checked))
        if self.later is None or not any(isinstance(part, bytes) for part in said):
            return b"".join(out)
        self.later.append(out)
        return b""

    @staticmethod
    def _ended(line: str, checked: bool) -> bytes:
        return f"{with_checksum(line) if checked else line}\r\n".encode("ascii")
