"""The capture messages of the simulated controller: requests in, status and blocks out, at the pace of its link."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bench.errors import ConfigError
from bench.link.frames import FD, FRAME, FrameBatch, empty_batch
from bench.rigfile import RigFile, linkurl
from bench.rigfile.busload import upload_frame_seconds
from bench.rigfile.messages import MessageMap
from bench.wire.captureblock import block, pieces
from bench.wire.isotp import FrameLength, Sender, TransferError
from bench.wire.packet import LIMIT, MESSAGE, PAYLOAD_LIMIT
from sim_backend.controller.capture_memory import TOLD_BY, CaptureMemory, Order
from sim_backend.controller.ownership import Ownership

BAUDRATE = 3_000_000  # of a serial port that does not say
SERIAL_SHARE = 0.95  # of what telemetry leaves
PACKET_BYTES = 20  # about a message in a packet: telemetry, one message a packet
Tell = Callable[[str, Mapping[str, float]], None]


class CapturePort:
    """Between the capture memory and the link.

    Args:
        rig: with its table `capture`.
        messages: the device's own map.
        names: the channels of a tick's readings, by the rig file's names.
        tick_s: from tick to tick.
    """

    def __init__(self, rig: RigFile, messages: MessageMap, names: Sequence[str], tick_s: float) -> None:
        assert rig.capture is not None
        self.memory = CaptureMemory(rig.capture, names, told_by(rig, names))
        self._tick_ns = round(tick_s * 1e9)
        self._capacity = rig.capture.memory_bytes
        self._map = messages
        self._flags = 0 if rig.link.classic else FD
        self._frame_length: FrameLength = 8 if rig.link.classic else 64
        self._spacing = {"CaptureBlock": _can_ns(rig) or self._tick_ns, "CaptureData": _serial_ns(rig)}
        self._sender: Sender | None = None
        self._message = "CaptureBlock"
        self._waiting: deque[bytes] = deque()  # payloads on their way out
        self._free_ns = 0  # device time from which the next may go

    def receive(
        self, name: str, v: Mapping[str, float], tick: int, owner: Ownership, resting: bool, tell: Tell
    ) -> None:
        """Take a message of the host at a tick; `tell` sends an answer."""
        if name == "CaptureFlow":
            self._go_on(v, tick)
        elif name == "CaptureRead":
            refused = self._read(v, tick)
            if refused:
                self._status(v["token"], refused, tell)
        elif not owner.takes(int(v["session"]), tick, resting):
            self._status(v["token"], "WRONG_SESSION", tell)
        elif name == "CaptureArm":
            status = owner.repeated(name, v) or self._arm(v)
            owner.answered(name, v, status)
            self._status(v["token"], status, tell)
        else:
            code = self._map["CaptureAsk"].signal("code").choices.get(int(v["code"]))
            if code == "CANCEL":
                self.memory.cancel()
                self._end()
            self._status(v["token"], "OK" if code else "UNKNOWN", tell)

    def sent(self, tick: int, clock: tuple[int, int]) -> FrameBatch:
        """What has gone out by a tick; `clock` is a time in ns and the tick it belongs to."""
        now, spacing = tick * self._tick_ns, self._spacing[self._message]
        if not self._waiting or self._free_ns >= now:
            return empty_batch()
        count = min(len(self._waiting), int((now - 1 - self._free_ns) // spacing) + 1)
        payloads = [self._waiting.popleft() for _ in range(count)]
        batch = np.zeros(count, FRAME)
        batch["t_ns"] = (
            self._free_ns + (np.arange(count) * spacing).astype(np.int64) + clock[0] - clock[1] * self._tick_ns
        )
        batch["id"], batch["flags"] = self._map[self._message].identifier, self._flags
        batch["length"] = [len(p) for p in payloads]
        whole = b"".join(p.ljust(64, b"\0") for p in payloads)
        batch["data"] = np.frombuffer(whole, np.uint8).reshape(-1, 64)
        self._free_ns += round(count * spacing)
        return batch

    def _arm(self, v: Mapping[str, float]) -> str:
        trigger = self._map["CaptureArm"].signal("trigger").choices.get(int(v["trigger"]), "")
        mask = int(v["channels0"]) | int(v["channels1"]) << 32
        status = self.memory.arm(
            Order(mask, int(v["divider"]), int(v["length"]), int(v["before"]), trigger, int(v["source"]), v["level"])
        )
        if status == "OK":
            self._end()
        return status

    def _read(self, v: Mapping[str, float], tick: int) -> str:
        """Begin to send a part of the buffer, or say why not."""
        memory, number, offset, length = self.memory, int(v["number"]), int(v["offset"]), int(v["length"])
        if memory.state != "DONE" or number != memory.number:
            return "NO_CAPTURE"
        form = self._map["CaptureRead"].signal("form").choices.get(int(v["form"]))
        if form is None or not length or offset + length > len(memory.buffer):
            return "OUT_OF_RANGE"
        self._end()
        data = memory.buffer[offset : offset + length]
        if form == "PIECES":
            self._queue("CaptureData", pieces(number, offset, data), tick)
        else:
            self._sender = Sender(block(number, offset, data), self._frame_length)
            self._queue("CaptureBlock", (self._sender.start(),), tick)
        return ""

    def _go_on(self, v: Mapping[str, float], tick: int) -> None:
        if self._sender is None:
            return
        payload = bytes((int(v["flow"]), int(v["block_size"]), int(v["st_min"])))
        try:
            self._queue("CaptureBlock", self._sender.feed(payload), tick)
        except TransferError:
            self._end()

    def _queue(self, message: str, payloads: Sequence[bytes], tick: int) -> None:
        self._message = message
        self._free_ns = max(self._free_ns, tick * self._tick_ns)
        self._waiting.extend(payloads)

    def _end(self) -> None:
        self._sender = None
        self._waiting.clear()

    def _status(self, token: float, status: str, tell: Tell) -> None:
        m, code = self.memory, self._map.code
        tell("CaptureStatus", {
            "token": token, "status": code("CaptureStatus", "status", status),
            "state": code("CaptureStatus", "state", m.state), "number": m.number, "divider": m.order.divider,
            "memory": self._capacity, "size": m.size, "samples": m.samples, "trigger": m.order.before,
            "tick": m.first_tick & 0xFFFFFFFF, "crc": m.crc,
        })  # fmt: skip


def told_by(rig: RigFile, names: Sequence[str]) -> dict[str, str]:
    """Which readings tell a pulse and a speed: those of the rig file's mark, else the controller's own."""
    bound = {trigger: str(getattr(rig.mark, key)) if rig.mark is not None else "" for trigger, key in TOLD_BY.items()}
    return {trigger: name if name in names else TOLD_BY[trigger] for trigger, name in bound.items()}


def _can_ns(rig: RigFile) -> float:
    """From frame to frame on the CAN bus; 0 where there is none."""
    link = rig.link
    return 1e9 * upload_frame_seconds(rig.messages, link.bitrate, link.data_bitrate) if link.bitrate else 0.0


def _serial_ns(rig: RigFile) -> float:
    """From piece to piece on a serial line of 10 bits a byte, beside the telemetry."""
    baudrate: float = BAUDRATE
    try:
        url = linkurl.parse(rig.link.url)
        baudrate = int(url.query.get("baudrate", "") or BAUDRATE) if url.scheme == "serial" else BAUDRATE
    except (ConfigError, ValueError):
        pass
    telemetry = sum((m.length + PACKET_BYTES) / m.period_s for m in rig.messages.messages.values() if m.period_s)
    a_piece = (MESSAGE.size + PAYLOAD_LIMIT) * (1 + PACKET_BYTES / LIMIT)
    return 1e9 * a_piece / (SERIAL_SHARE * max(baudrate / 10 - telemetry, baudrate / 100))
