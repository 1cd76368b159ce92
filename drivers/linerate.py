"""The rate of a serial line whose controller begins at another one than the bench speaks: agreed when the link opens, and found
again after a controller that restarted has gone back to its first.

At a rate that is not its own a controller hears nothing, and what it says is noise: a line that was good, and on which bytes
have come since of which nothing can be made. A line that is merely silent is left alone: whoever is at its other end may hear
well, and would lose the heartbeats by another rate.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence

from bench.errors import ConfigError, LinkError
from bench.rigfile.commandline import CommandLine
from bench.wire.commandline import Line, Reply, Splitter, read_line, request
from drivers.byteport import BytePort

ANSWER_S = 0.4  # for a line at a rate that may be the wrong one
TRIES = 3  # of both rates, when the link opens
SILENT_S = 0.25  # without anything that can be understood: before a run ends by it (`drivers.waiting.patience_s`)
FIRST_TAG, RATE_TAG = 9998, 9999
_log = logging.getLogger("drivers")


def agree(port: BytePort, name: str, lines: CommandLine, wanted: int) -> None:
    """Bring both ends to a rate: that of the last session, or the one of power-up.

    Raises:
        ConfigError: nobody answers at either, or the rate is refused.
    """
    for _ in range(TRIES):
        port.serial.baudrate = wanted
        if answered(port, lines, lines.commands.get("IDENTIFY", "").split()):
            return
        port.serial.baudrate = lines.baudrate_first
        if answered(port, lines, lines.baudrate_line.format(baudrate=wanted).split()):
            port.serial.baudrate = wanted
            return
    raise ConfigError(
        f"link {name}: no answer at {wanted} Bd nor at {lines.baudrate_first} Bd, or the rate is refused. Next: is the "
        "controller on, at rest (it changes its rate only then), and the port the right one?"
    )


def answered(port: BytePort, lines: CommandLine, words: Sequence[str]) -> bool:
    """Whether a line is answered with ok in time; what is no line of its answer is left out."""
    splitter, until = Splitter(), time.monotonic() + ANSWER_S
    try:
        port.write(b"\n\n" + request(RATE_TAG, *words))
        while (left := until - time.monotonic()) > 0:
            if (reply := _reply(splitter, port.read(left), lines.prompt, RATE_TAG)) is not None:
                return reply.kind == "ok"
    except LinkError:
        return False
    return False


def _reply(splitter: Splitter, data: bytes, prompt: str, tag: int) -> Reply | None:
    for piece in splitter.feed(data):
        said = read_line(piece.text, prompt) if isinstance(piece, Line) else None
        if isinstance(said, Reply) and said.tag == tag:
            return said
    return None


class Rate:
    """Of a line that was agreed on. `look` is called after each read, by the thread that reads; it waits for nothing.

    Args:
        put: sets the port's rate, Bd.
        lines: the rig's; with `baudrate_first` and `baudrate_line`.
        wanted: the rate that was agreed on, Bd.
    """

    def __init__(self, put: Callable[[int], None], lines: CommandLine, wanted: int, now_s: float) -> None:
        self._put, self._lines, self._wanted = put, lines, wanted
        self._good_s, self._noise = now_s, False
        self._asked, self._until_s = 0, 0.0  # the tag of what was asked, until when its answer is waited for
        self._splitter = Splitter()
        self.found = 0
        """How many times it was found again."""

    def look(self, data: bytes, understood: bool, now_s: float) -> bytes:
        """What is to be said now, after bytes came (or none, b"") and something of them was understood or not."""
        if self._asked:
            return self._waited(data, now_s)
        if understood:
            self._good_s, self._noise = now_s, False
        self._noise |= bool(data) and not understood
        if not self._noise or now_s - self._good_s < SILENT_S:
            return b""
        first = self._lines.baudrate_first
        assert first is not None
        self._put(first)
        return self._ask(FIRST_TAG, self._lines.commands.get("IDENTIFY", ""), now_s)

    def _ask(self, tag: int, line: str, now_s: float) -> bytes:
        self._asked, self._until_s, self._splitter = tag, now_s + ANSWER_S, Splitter()
        return b"\n\n" + request(tag, *line.split())

    def _waited(self, data: bytes, now_s: float) -> bytes:
        reply = _reply(self._splitter, data, self._lines.prompt, self._asked)
        if reply is None and now_s < self._until_s:
            return b""
        if reply is not None and self._asked == FIRST_TAG:
            return self._ask(RATE_TAG, self._lines.baudrate_line.format(baudrate=self._wanted), now_s)
        self._put(self._wanted)
        self._asked, self._good_s, self._noise = 0, now_s, False
        if reply is not None and reply.kind == "ok":
            self.found += 1
            _log.warning("the controller was at %s Bd again: it restarted, or gave up a rate at which it heard nothing; "
                         "both ends are at %d Bd now", self._lines.baudrate_first, self._wanted)  # fmt: skip
        return b""
