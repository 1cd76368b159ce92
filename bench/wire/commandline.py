"""A controller's command line over a serial line: requests, replies and events as lines of text, captures as binary blocks
between them. Pure: bytes in, pieces out, without time.

    request  [TAG SP] VERB *(SP ARGUMENT) ["*" HH] LF      HH: exclusive or of all bytes before "*", two hex digits
    reply    (TAG | "-") SP ("ok" | "err") [SP TEXT] ["*" HH] CR LF
    more     TAG SP "+" SP TEXT                            before the ok of what has many lines
    event    "!" SP TICK SP NAME [SP TEXT]                 unasked
    block    A5 5A | number u16 | offset u32 | length u16 | data, at most 1024 | CRC-32 u32 over number..data, all little-endian

Text is printable ASCII. A byte from 80 hex on cannot be text: it begins a block, or the line that it stands in is dropped.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass, field
from functools import reduce
from typing import Final, Literal

from bench.wire.captureblock import Block

SYNC: Final = b"\xa5\x5a"
HEADER: Final = struct.Struct("<HIH")
LARGEST: Final = 1024
"""Bytes of data in a block."""
LONGEST: Final = 512
"""Characters of a line; what is longer is dropped."""
TAGS: Final = 10_000
_CONTROL: Final = bytes((*range(0x20), 0x7F))
_CHECKED: Final = re.compile(r"(.*)\*([0-9A-Fa-f]{2})")
_REPLY: Final = re.compile(r"(\d{1,4}|-) (ok|err|\+)(?: (.*))?")
_EVENT: Final = re.compile(r"! (\d{1,19}) ([A-Za-z][\w.-]*)(?: (.*))?")

Kind = Literal["ok", "err", "more"]


@dataclass(frozen=True)
class Line:
    """A line as it came, without its end."""

    text: str


@dataclass(frozen=True)
class Reply:
    """An answer: its tag (None where it has none), what it says, and whether a checksum vouches for it."""

    tag: int | None
    kind: Kind
    text: str
    checked: bool


@dataclass(frozen=True)
class Event:
    """What the controller told unasked: its tick, a name, the rest."""

    tick: int
    name: str
    text: str


@dataclass(frozen=True)
class Request:
    """What a controller was asked: a tag (None where it has none), words, and whether a checksum vouches for it."""

    tag: int | None
    words: tuple[str, ...]
    checked: bool


def checksum(text: str) -> int:
    """Exclusive or of all characters."""
    return reduce(lambda a, b: a ^ b, text.encode("ascii", "replace"), 0)


def with_checksum(text: str) -> str:
    """A line with its checksum."""
    return f"{text}*{checksum(text):02X}"


def request(tag: int, *words: str) -> bytes:
    """The bytes of a request with tag and checksum.

    Raises:
        ValueError: a tag beyond 0 to 9999, no word, or a word that is not printable ASCII without spaces and `*`.
    """
    if not 0 <= tag < TAGS:
        raise ValueError(f"tag {tag}; expected 0 to {TAGS - 1}")
    if not words or any(not re.fullmatch(r"[!-)+-~]+", word) for word in words):
        raise ValueError(f"words {words}; expected one or more of printable ASCII without spaces and *")
    return f"{with_checksum(' '.join((str(tag), *words)))}\n".encode("ascii")


def beat(line: str) -> bytes:
    """The bytes of a line that is said without a tag and whose reply nobody waits for: a heartbeat."""
    return f"{with_checksum(line)}\n".encode("ascii")


def read_line(text: str, prompt: str = "") -> Reply | Event | None:
    """What a line of a controller says, without a prompt before it.

    Returns:
        None for what is neither reply nor event (an echo, text of its start), and where the checksum is wrong.
    """
    plain, checked = _plain(without_prompt(text, prompt))
    if plain is None:
        return None
    if found := _EVENT.fullmatch(plain):
        return Event(int(found[1]), found[2], found[3] or "")
    if found := _REPLY.fullmatch(plain):
        kind: Kind = "ok" if found[2] == "ok" else "err" if found[2] == "err" else "more"
        return Reply(None if found[1] == "-" else int(found[1]), kind, found[3] or "", checked)
    return None


def without_prompt(text: str, prompt: str) -> str:
    """A line without prompts before it."""
    text = text.strip()
    while prompt and text.startswith(prompt.strip()):
        text = text.removeprefix(prompt.strip()).lstrip()
    return text


def read_request(text: str) -> Request | None:
    """What a controller was asked by a line: None where its checksum is wrong. An empty line has no words."""
    plain, checked = _plain(text.strip())
    if plain is None:
        return None
    words = plain.split()
    tagged = bool(words) and len(words[0]) <= 4 and words[0].isdigit()
    return Request(int(words[0]) if tagged else None, tuple(words[tagged:]), checked)


def _plain(text: str) -> tuple[str | None, bool]:
    """A line without its checksum (None: it is wrong), and whether it had one."""
    found = _CHECKED.fullmatch(text)
    if found is None:
        return text, False
    return (found[1] if checksum(found[1]) == int(found[2], 16) else None), True


def block(number: int, offset: int, data: bytes) -> bytes:
    """The bytes of a block.

    Raises:
        ValueError: more than 1024 bytes of data.
    """
    if len(data) > LARGEST:
        raise ValueError(f"{len(data)} bytes; a block holds at most {LARGEST}")
    body = HEADER.pack(number, offset, len(data)) + data
    return SYNC + body + zlib.crc32(body).to_bytes(4, "little")


@dataclass
class Splitter:
    """Takes a stream apart into lines and blocks, whatever stands between them.

    Attributes:
        dropped: bytes of lines with what cannot be text, or too long.
        wrong: blocks whose CRC is not theirs.
    """

    dropped: int = 0
    wrong: int = 0
    _held: bytearray = field(default_factory=bytearray)
    _line: bytearray = field(default_factory=bytearray)
    _spoilt: bool = False

    def feed(self, data: bytes) -> list[Line | Block]:
        """The lines and blocks that are whole by now."""
        self._held += data
        return self._pieces(final=False)

    def give_up(self) -> list[Line | Block]:
        """Nothing came for long: what waits for the rest of a block is none."""
        return self._pieces(final=True)

    def _pieces(self, final: bool) -> list[Line | Block]:
        out: list[Line | Block] = []
        held, at = self._held, 0
        while at < len(held):
            if held[at] == SYNC[0]:
                size, found = self._block(at)
                if size == 0 and not final:
                    break
                if found is not None:
                    self._drop()
                    out.append(found)
                    at += size
                    continue
                self._spoilt = True
                at += 1
                continue
            marks = [k for k in (held.find(SYNC[0], at), held.find(b"\n", at)) if k >= 0]
            stop = min(marks, default=len(held))
            self._text(held[at:stop])
            at = stop
            if stop < len(held) and held[stop] == 0x0A:
                at += 1
                out += self._ended()
        del held[:at]
        return out

    def _block(self, at: int) -> tuple[int, Block | None]:
        """Bytes of the block that begins here, and the block; (0, None): it is not whole yet; (1, None): there is none."""
        held = self._held
        if not SYNC.startswith(held[at : at + 2]):
            return 1, None
        start, size = at + len(SYNC), HEADER.size
        if len(held) < start + size:
            return 0, None
        number, offset, length = HEADER.unpack_from(held, start)
        if length > LARGEST:
            return 1, None
        end = start + size + length
        if len(held) < end + 4:
            return 0, None
        if zlib.crc32(held[start:end]) != int.from_bytes(held[end : end + 4], "little"):
            self.wrong += 1
            return 1, None
        return end + 4 - at, Block(number, offset, bytes(held[start + size : end]))

    def _text(self, part: bytearray) -> None:
        """A part of a line; control characters are left out."""
        self._spoilt |= not part.isascii()
        self._line += part.translate(None, _CONTROL)
        if len(self._line) > LONGEST:
            self._spoilt = True
            self.dropped += len(self._line) - LONGEST
            del self._line[LONGEST:]

    def _drop(self) -> None:
        """A block stands between lines: what came before it of a line that cannot be one is over."""
        if self._spoilt:
            self.dropped += len(self._line)
            self._line.clear()
            self._spoilt = False

    def _ended(self) -> list[Line | Block]:
        """The line that ends here, if it is one."""
        text, spoilt = bytes(self._line), self._spoilt
        self._line.clear()
        self._spoilt = False
        if spoilt:
            self.dropped += len(text)
            return []
        return [Line(text.decode("ascii"))]
