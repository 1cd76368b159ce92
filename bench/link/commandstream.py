"""Messages over a command line: what the host sends becomes lines, what a controller answers, tells and streams becomes
messages again. Pure: bytes in, bytes out. So everything above it goes by the rig's DBC, whatever its controller speaks.

A request that is sent again while it waits for its reply is the same line with the same tag, which a controller answers without
doing it again. Replies with another tag than one that is waited for are late, and left out.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from bench.link.codec import Decoder, encode
from bench.link.frames import FD, FrameBatch, batch_of, packed
from bench.link.spoken import Said, Speaker
from bench.rigfile import RigFile
from bench.rigfile.commandline import COUNTED, CommandLine
from bench.wire.captureblock import Block, pieces
from bench.wire.commandline import TAGS, Event, Reply, Splitter, beat, read_line, request, without_prompt

SEQUENCE_BYTES = 2
_VALUE = re.compile(r"=\s*([-+0-9.eE]+|nan|inf|-inf)")
_log = logging.getLogger("bench.commandline")


@dataclass
class Counts:
    """What went wrong on the line, or was told beside."""

    dropped: int = (
        0  # lines that are neither reply nor event, nor a prompt, text of its start or an echo of the opening
    )
    late: int = 0  # replies that nobody waited for
    damaged: int = 0  # blocks whose CRC is not theirs, or that cannot be a message
    events: int = 0
    restarts: int = 0
    told: int = 0  # replies, events and blocks that are what they should be


class CommandStream:
    """One command line, seen from the host.

    Args:
        rig: with a table `commandline`.

    Raises:
        ConfigError: it has none.
    """

    def __init__(self, rig: RigFile) -> None:
        self._rig, self._speaker = rig, Speaker(rig)
        assert rig.commandline is not None
        self._lines: CommandLine = rig.commandline
        self._telemetry = rig.messages[rig.binding.telemetry[0]]
        self._decoder = Decoder(self._telemetry)
        self._splitter = Splitter()
        self._waiting: dict[int, Said] = {}
        self._asked: dict[
            tuple[int, bytes], tuple[int, bytes]
        ] = {}  # a frame that waits for its reply: its tag and line
        self._own: list[tuple[int, bytes, int]] = []  # frames that the bench answers itself
        self._tag = -1
        self._lock = threading.Lock()  # one thread sends, another receives
        self._last = b""  # telemetry
        self._due = b""
        self._echoes: set[str] = set()  # of the opening, which a controller that has just started says after us
        self.counts = Counts()
        self.simulated = False
        """Whether the controller says that it is a simulation."""

    def opening(self) -> bytes:
        """What is said first: whatever waits in the controller's line is ended, then the rig file's lines, without waiting."""
        lines = [request(self._next(), *line.split()) for line in self._lines.opening]
        self._echoes = {line.decode("ascii").strip() for line in lines}
        return b"\n\n" + b"".join(lines)

    def begin_anew(self) -> None:
        """The controller has restarted, by what somebody else heard: the opening is due."""
        with self._lock:
            self._restarted(True)

    def due(self) -> bytes:
        """What is to be said unasked, once: the opening, after a restart."""
        due, self._due = self._due, b""
        return due

    def encode(self, batch: FrameBatch) -> bytes:
        """Lines of the host's frames, in order; those without one are left out."""
        columns = zip(batch["id"].tolist(), batch["length"].tolist(), batch["data"], strict=True)
        with self._lock:
            return b"".join(self._line(identifier, data[:length].tobytes()) for identifier, length, data in columns)

    def feed(self, data: bytes, now_ns: int) -> FrameBatch:
        """The controller's frames that these bytes complete, stamped with `now_ns`."""
        with self._lock:
            return self._fed(data, now_ns)

    def _fed(self, data: bytes, now_ns: int) -> FrameBatch:
        if not data and not self._own:  # what waits for the rest of a block waits on
            return batch_of([])
        before = self._splitter.wrong
        out: list[bytes] = []
        for piece in self._splitter.feed(data):
            frames = self._block(piece) if isinstance(piece, Block) else self._text(piece.text)
            out += [packed(i, payload, t_ns=now_ns, flags=flags) for i, payload, flags in frames]
        self.counts.damaged += self._splitter.wrong - before
        own, self._own = self._own, []
        return batch_of([*out, *(packed(i, p, t_ns=now_ns, flags=f) for i, p, f in own)])

    # From the host

    def _next(self) -> int:
        self._tag = (self._tag + 1) % TAGS
        return self._tag

    def _line(self, identifier: int, payload: bytes) -> bytes:
        frame = identifier, payload
        if (asked := self._asked.get(frame)) is not None:
            return asked[1]
        said = self._speaker.said(identifier, payload)
        if said is None:
            return b""
        if said.message == self._rig.binding.heartbeat:
            return beat(said.line or "")
        if said.line is None:
            self._own += self._held(said)
            return b""
        tag = self._next()
        line = request(tag, *said.line.split())
        self._waiting[tag], self._asked[frame] = said, (tag, line)
        return line

    def _held(self, said: Said) -> list[tuple[int, bytes, int]]:
        """The answer to what is not said: a parameter that the bench holds, or a command that the line does not know."""
        if said.message == "Command" or not said.key:
            return self._refused(said, "UNKNOWN")
        return self._parameter(said, self._speaker.held[said.key])

    # From the controller

    def _text(self, text: str) -> list[tuple[int, bytes, int]]:
        found = read_line(text, self._lines.prompt)
        self.counts.told += found is not None
        if isinstance(found, Event):
            self.counts.events += 1
            _log.info("%d: %s %s", found.tick, found.name, found.text)
            self._restarted(found.name in self._lines.restart)
            return []
        if found is None:
            bare = without_prompt(text, self._lines.prompt)
            restart = any(bare.startswith(x) for x in self._lines.restart)
            self.counts.dropped += bool(bare) and not restart and bare not in self._echoes
            self._restarted(restart)
            return []
        if found.tag is None or found.kind == "more":
            return []
        said = self._waiting.pop(found.tag, None)
        if said is None:
            self.counts.late += 1
            return []
        self._asked = {frame: (tag, line) for frame, (tag, line) in self._asked.items() if tag != found.tag}
        return self._replied(said, found)

    def _restarted(self, is_so: bool) -> None:
        """What was asked before is forgotten, and the opening is due again."""
        if is_so:
            self.counts.restarts += 1
            self._waiting.clear()
            self._asked.clear()
            self._due = self.opening()

    def _replied(self, said: Said, reply: Reply) -> list[tuple[int, bytes, int]]:
        if reply.kind == "err":
            return self._refused(said, self._status(reply.text))
        if said.message in ("ParamSet", "ParamGet"):
            found = _VALUE.search(reply.text)
            value = float(found[1]) if found else self._speaker.held[said.key]
            if found and not self._lines.of(said.key).words:
                self._speaker.held[said.key] = value
            return self._parameter(said, value)
        if said.key == "IDENTIFY":
            return self._identity(reply.text)
        if said.message == "Command":
            return self._command(said, "OK", reply.text)
        return self._captured(said, reply.text) if said.message != "CaptureRead" else []

    def _status(self, text: str) -> str:
        code = text.split(" ", 1)[0]
        if self._lines.capture is not None and code.isdigit() and int(code) in self._lines.capture.none:
            return "NO_CAPTURE"
        return self._lines.errors.get(code, self._lines.refused)

    def _refused(self, said: Said, status: str) -> list[tuple[int, bytes, int]]:
        if said.message in ("ParamSet", "ParamGet"):
            return self._parameter(said, self._speaker.held.get(said.key, 0.0), status)
        if said.message == "Command":
            return self._command(said, status, "")
        return self._message(
            "CaptureStatus", {"token": said.values["token"], "status": self._code("CaptureStatus", status)}
        )

    def _parameter(self, said: Said, value: float, status: str = "OK") -> list[tuple[int, bytes, int]]:
        told = {"index": said.values["index"], "token": said.values.get("token", 0.0), "value": value}
        return self._message("ParamReply", {**told, "status": self._code("ParamReply", status)})

    def _command(self, said: Said, status: str, text: str) -> list[tuple[int, bytes, int]]:
        known = {name: code for code, name in self._rig.messages["CommandReply"].signal("state").choices.items()}
        last = self._decoder.decode_one(self._last)["state"] if self._last else 0
        told = {
            "code": said.values["code"],
            "token": said.values["token"],
            "status": self._code("CommandReply", status),
        }
        return self._message("CommandReply", {**told, "state": known.get(text.split(" ", 1)[0], last)})

    def _identity(self, text: str) -> list[tuple[int, bytes, int]]:
        words = _words(text)
        self.simulated |= bool(self._lines.simulated) and self._lines.simulated in text
        told = {s: _number(words.get(word, "")) for s, word in self._lines.identity.items()}
        return self._message("Identity", told | ({"serial": 0.0} if self.simulated else {}))

    def _captured(self, said: Said, text: str) -> list[tuple[int, bytes, int]]:
        """The state of a capture: what its reply tells, and what was asked for."""
        lines, spec, words = self._lines.capture, self._rig.capture, text.split()
        assert lines is not None
        assert spec is not None
        named = _words(text)
        told = {key: _number(named[word]) for key in COUNTED if (word := lines.told.get(key, "")) in named}
        state = "ARMED" if said.message == "CaptureArm" else "IDLE"
        if len(words) > 1:
            state = next((ours for ours, theirs in lines.states.items() if theirs == words[1]), state)
        about = {"divider": said.values.get("divider", 0.0)} | told
        number = _number(words[0]) if words else 0.0
        return self._message("CaptureStatus", about | {
            "token": said.values["token"], "status": self._code("CaptureStatus", "OK"), "memory": spec.memory_bytes,
            "state": self._rig.messages.code("CaptureStatus", "state", state), "number": number,
        })  # fmt: skip

    def _block(self, block: Block) -> list[tuple[int, bytes, int]]:
        if block.number == self._lines.stream:
            payload = block.data[:SEQUENCE_BYTES] + block.offset.to_bytes(4, "little") + block.data[SEQUENCE_BYTES:]
            if len(payload) != self._telemetry.length:
                self.counts.damaged += 1
                return []
            self._last = payload
            return [(self._telemetry.identifier, payload, FD)]
        if "CaptureData" not in self._rig.messages.messages or not block.data:
            return []
        identifier = self._rig.messages["CaptureData"].identifier
        return [(identifier, piece, FD) for piece in pieces(block.number, block.offset, block.data)]

    def _code(self, message: str, status: str) -> float:
        """The number of a status; that of any other than OK where the message does not know this one."""
        choices = self._rig.messages[message].signal("status").choices
        named = {name: code for code, name in choices.items()}
        return float(named.get(status, named.get(self._lines.refused, max(choices, default=1))))

    def _message(self, name: str, values: Mapping[str, float]) -> list[tuple[int, bytes, int]]:
        m = self._rig.messages[name]
        known = {s.name for s in m.signals}
        payload = encode(m, {k: v for k, v in values.items() if k in known})
        return [(m.identifier, payload, FD if m.fd else 0)]


def _words(text: str) -> dict[str, str]:
    """Words `name=value` of a reply."""
    return {name: value for name, mark, value in (word.partition("=") for word in text.split()) if mark}


def _number(text: str) -> float:
    """The number that a word ends with; 0 without one."""
    found = re.search(r"(0x[0-9a-fA-F]+|\d+)$", text)
    return float(int(found[1], 16 if found[1].startswith("0x") else 10)) if found else 0.0
