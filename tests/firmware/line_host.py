"""A small host of the C controller with a command line, which shares nothing with the bench's."""

from __future__ import annotations

import os
import socket
import struct
import time
import tty
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import reduce

Block = tuple[int, int, bytes]
"""Number, offset, data."""


def summed(text: str) -> str:
    """A line with its checksum."""
    return f"{text}*{reduce(lambda a, b: a ^ b, text.encode(), 0):02X}"


@dataclass
class Host:
    """Says lines to the program and takes apart what comes: `lines` of text, `blocks`."""

    where: str
    lines: list[str] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    heard: bytes = b""

    def __post_init__(self) -> None:
        self._socket: socket.socket | None = None
        if self.where.startswith("socket://"):
            name, port = self.where.removeprefix("socket://").split(":")
            self._socket = socket.create_connection((name, int(port)))
            self._file = self._socket.fileno()
        else:
            self._file = os.open(self.where, os.O_RDWR | os.O_NOCTTY)
            tty.setraw(self._file)
        os.set_blocking(self._file, False)

    def close(self) -> None:
        """Hang up."""
        if self._socket is None:
            os.close(self._file)
        else:
            self._socket.close()

    def say(self, *lines: str) -> None:
        """Lines at once."""
        os.write(self._file, "".join(f"{line}\n" for line in lines).encode())

    def quiet(self) -> None:
        """As every host begins; what came until then is forgotten."""
        self.say("", "", "echo off", "prompt off", "1234 echo off")
        self.until(lambda: "1234 ok off" in self.lines)
        self.lines.clear()

    def until(self, done: Callable[[], bool], seconds: float = 10.0) -> None:
        """Listen until something is so."""
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, (self.lines[-5:], len(self.blocks))
            with suppress(BlockingIOError):
                self.heard += os.read(self._file, 65536)
            self._apart()
            time.sleep(0.001)

    def listen(self, seconds: float) -> None:
        """Listen for a time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, seconds + 10.0)

    def asked(self, line: str) -> str:
        """The reply to a line, by its tag, or with `-` the first that comes."""
        before, (first, *_) = len(self.lines), line.split()
        begin = (f"{first} ok", f"{first} err", "- err 6", "- err 7") if first.isdigit() else ("- ok", "- err")
        self.say(line)
        self.until(lambda: any(x.startswith(begin) for x in self.lines[before:]))
        return next(x for x in self.lines[before:] if x.startswith(begin))

    def _apart(self) -> None:
        while self.heard:
            if self.heard[0] == 0xA5:
                if len(self.heard) < 10:
                    return
                mark, number, offset, length = struct.unpack_from("<HHIH", self.heard)
                assert mark == 0x5AA5
                if len(self.heard) < 14 + length:
                    return
                body, (crc,) = self.heard[2 : 10 + length], struct.unpack_from("<I", self.heard, 10 + length)
                assert crc == zlib.crc32(body)
                self.blocks.append((number, offset, body[8:]))
                self.heard = self.heard[14 + length :]
                continue
            line, end, rest = self.heard.partition(b"\n")
            if not end:
                return
            assert b"\xa5" not in line
            self.lines.append(line.decode("ascii").rstrip("\r"))
            self.heard = rest
