"""`slcan_batch`: a python-can interface for SLCAN adapters that reads whole buffers, over a serial port, pty or TCP.

    can.Bus(interface="slcan_batch", channel="/dev/ttyACM0", bitrate=1_000_000, data_bitrate=5_000_000)

python-can's own `slcan` reads a byte at a time, which ends at about 2500 frames/s. This one gives batches (`recv_batch`)
and, to Notifier and `recv`, single messages out of them. It offers no `fileno`: asyncio's Notifier would take one
message for each event of the descriptor and leave the rest of the batch behind.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import can
import numpy as np

from bench.clock import WallClock
from bench.errors import BenchError, ConfigError, LinkError
from bench.link.frames import EXTENDED, REMOTE, FrameBatch, empty_batch
from bench.link.slcanstream import SlcanStream, encode
from bench.wire import sign, slcan
from drivers.byteport import BytePort
from drivers.canframes import messages_of

ANSWER_S = 0.3  # for each of the adapter's answers while it is set up; one that does not know V or F gives none
POLL_S = 1.0  # between requests for the status
STRANGE = 3  # pieces that fit nothing, before anything else: the remainder of one line, and the noise of plugging in
SILENT_S = 0.1  # without frames the status is asked for so often: silence may mean that the bus is off


class SlcanBatchBus(can.BusABC):
    """See the module. `port` is the byte stream; `stream` counts what is malformed, refused or remote."""

    def __init__(
        self,
        channel: str,
        bitrate: int = 500_000,
        data_bitrate: int | None = None,
        fd: bool | None = None,
        timestamp: bool = False,
        tty_baudrate: int | None = None,
        can_filters: Any = None,
        receive_own_messages: bool = False,
        now_ns: Callable[[], int] | None = None,
        **kwargs: Any,
    ) -> None:
        """
        Args:
            channel: device, `socket://HOST:PORT` or `rfc2217://HOST:PORT`.
            bitrate: bit/s of the arbitration phase.
            data_bitrate: bit/s of the data phase; with it CAN FD frames switch their rate.
            fd: CAN FD; as `data_bitrate` says when left out.
            timestamp: have the adapter stamp frames, in ms (`hw_ns`).
            tty_baudrate: of the serial port; USB adapters do not care.
            receive_own_messages: refused: an adapter does not send back what it sent.
            now_ns: host clock, UNIX ns.

        Raises:
            can.CanInterfaceNotImplementedError: own messages are asked for.
            can.CanInitializationError: the port cannot be opened, the adapter refuses, or it reports bus errors.
        """
        if receive_own_messages:
            self._is_shutdown = True  # nothing was opened
            raise can.CanInterfaceNotImplementedError("slcan_batch: an SLCAN adapter does not send back what it sent")
        self._begin(now_ns, timestamp)
        self.brs = data_bitrate is not None and fd is not False
        self.channel_info = f"SLCAN on {channel}"
        try:
            rates = (bitrate, data_bitrate if fd is not False else None)
            self._setup = slcan.setup(*rates, timestamp=timestamp).removeprefix(slcan.CLOSE)
            super().__init__(channel, can_filters=can_filters, **kwargs)
            self.port = BytePort.open(channel, baudrate=tty_baudrate)
        except ConfigError as error:
            self._is_shutdown = True  # nothing was opened
            raise can.CanInitializationError(str(error)) from error
        except BaseException:
            self._is_shutdown = True
            raise
        self._can_protocol = can.CanProtocol.CAN_FD if self.brs or fd else can.CanProtocol.CAN_20
        self._open(channel, bitrate)

    def _begin(self, now_ns: Callable[[], int] | None, timestamp: bool) -> None:
        """What is counted and kept, before anything is opened."""
        self._now_ns = now_ns or WallClock().now_ns
        self._writing = threading.Lock()
        self._ask: Callable[[bytes], None] = self._write
        self._waiting: deque[can.Message] = deque()
        self.octets = 0  # that came since it was set up, without what the adapter itself answers
        self.simulated = False  # whether the adapter says that it is that of a served simulation
        self._came = 0  # frames while it was set up
        self._filter: Callable[[FrameBatch], Any] | None = None
        self.stream = SlcanStream(timestamp=timestamp, remotes=True)

    def _open(self, channel: str, bitrate: int) -> None:
        """Set the adapter up; what cannot be is shut down again."""
        try:
            self._knows_status = self._start(channel, bitrate)
        except BaseException as error:
            self.shutdown()
            if isinstance(error, BenchError):
                raise can.CanInitializationError(str(error)) from error
            raise
        self._heard = self._polled = time.monotonic()

    def _start(self, channel: str, bitrate: int) -> bool:
        """Set the adapter up and see what it thinks of it; whether it tells its status. Frames that come meanwhile are
        of no use.

        Closed adapters may refuse C and F (Lawicel manual), so only refusals of the set-up count: those between two
        answers to V, which is always allowed.
        """
        self._write(b"\r\r" + slcan.CLOSE + slcan.VERSION)  # CRs end whatever an earlier user left half written
        self._await(lambda s: bool(s.replies))
        refuse_noise(channel, self.stream, self._came)
        self.stream.refused = 0
        self.stream.replies.clear()
        self._write(self._setup + slcan.VERSION)
        self._await(lambda s: bool(s.replies))
        self.simulated = sign.SLCAN_VERSION in self.stream.replies
        refuse_noise(channel, self.stream, self._came)  # a byte of it may look like a refusal
        if self.stream.refused:
            lines = ", ".join(line.decode() for line in self._setup.split())
            raise ConfigError(
                f"port {channel}: the SLCAN adapter refuses one of {lines}; expected one that knows these bit rates"
                + (" and CAN FD" if self.brs else "")
            )
        self._write(slcan.STATUS)
        self._await(lambda s: s.status is not None or s.refused > 0)
        status = self.stream.status
        self.stream.refused = self.stream.malformed = self.stream.remote = 0  # nothing of the past counts
        self.stream.replies.clear()
        if (status or 0) & slcan.BUS_ERROR:
            raise ConfigError(
                f"port {channel}: the SLCAN adapter reports bus errors at {bitrate} bit/s (F{status:02X}); expected "
                "the bit rates of the bus, and a bus that is connected and terminated"
            )
        return status is not None

    def _await(self, came: Callable[[SlcanStream], bool]) -> None:
        """Read until the answer came, or the time for it is over."""
        deadline = time.monotonic() + ANSWER_S
        while not came(self.stream) and (left := deadline - time.monotonic()) > 0:
            self._came += len(self.stream.feed(self.port.read(left), self._now_ns()))

    def recv_batch(self, timeout_s: float | None) -> FrameBatch:
        """Data frames that came, after waiting for the next bytes no longer than `timeout_s` and 0.1 s. May be empty
        earlier, when what came was no frame.

        Raises:
            LinkError: the port is lost.
        """
        batch = self._frames(timeout_s)
        remote = batch["flags"] & REMOTE != 0
        return batch[~remote] if remote.any() else batch

    def _frames(self, timeout_s: float | None) -> FrameBatch:
        """As `recv_batch`, remote frames too."""
        now = time.monotonic()
        due = SILENT_S if now - self._heard > SILENT_S else POLL_S
        if self._knows_status and now - self._polled >= due:
            self._polled = now
            self._ask(slcan.STATUS)
        data = self.port.read(SILENT_S if timeout_s is None else min(timeout_s, SILENT_S))
        if not data:
            return empty_batch()
        answered = self.stream.answered
        batch = self.stream.feed(data, self._now_ns())
        self.octets += len(data) - (self.stream.answered - answered)
        if len(batch):
            self._heard = time.monotonic()
        return batch if self._filter is None else batch[self._filter(batch)]

    def send_batch(self, batch: FrameBatch) -> None:
        """Send frames, in order.

        Raises:
            LinkError: the port is lost or takes nothing, or a frame is none that CAN has.
        """
        try:
            data = encode(batch, brs=self.brs)
        except ValueError as error:
            raise LinkError(f"{self.channel_info}: {error}") from error
        self._write(data)

    def _write(self, data: bytes) -> None:
        with self._writing:
            self.port.write(data)

    def ask_through(self, write: Callable[[bytes], None]) -> None:
        """Have the requests for the status written by `write`: another process is the one writer of the port now, and
        bytes of ours could end up in the middle of a line that it has written in part."""
        self._ask = write

    def status(self) -> int | None:
        """The last status flags (bits in bench.wire.slcan); None from an adapter that tells none."""
        return self.stream.status

    @property  # type: ignore[misc]  # python-can lets it be set, which this hardware does not
    def state(self) -> can.BusState:
        """ERROR: the adapter reports bus errors and no frame came lately; PASSIVE: its error counters are high."""
        flags = self.stream.status or 0
        if flags & slcan.BUS_ERROR and time.monotonic() - self._heard > SILENT_S:
            return can.BusState.ERROR
        return can.BusState.PASSIVE if flags & slcan.PASSIVE else can.BusState.ACTIVE

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._waiting:
            try:
                batch = self._frames(timeout)
            except LinkError as error:
                raise can.CanOperationError(str(error)) from error
            if len(batch):
                self._waiting.extend(messages_of(batch))
        return (self._waiting.popleft(), True) if self._waiting else (None, False)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one message; `timeout` is not used, a full port is an error after a second.

        Raises:
            can.CanOperationError: the port is lost, or the message is none that CAN has.
        """
        try:
            if msg.is_error_frame:
                raise ValueError("an error frame cannot be sent")
            if msg.is_remote_frame:
                letter = f"R{msg.arbitration_id:08X}" if msg.is_extended_id else f"r{msg.arbitration_id:03X}"
                self._write(f"{letter}{msg.dlc:X}\r".encode())
            else:
                identifier = msg.arbitration_id | (EXTENDED if msg.is_extended_id else 0)
                self._write(slcan.line(identifier, bytes(msg.data), fd=msg.is_fd, brs=msg.bitrate_switch))
        except (BenchError, ValueError) as error:
            raise can.CanOperationError(str(error)) from error

    def _apply_filters(self, filters: Any) -> None:
        self._filter = _passing(filters) if filters else None

    def shutdown(self) -> None:
        """Close the channel and the port. Twice is harmless."""
        if self._is_shutdown:
            return
        super().shutdown()
        with self._writing:
            with contextlib.suppress(LinkError):  # it is gone already
                self.port.write(slcan.CLOSE)
            self.port.close()


def refuse_noise(channel: str, stream: SlcanStream, frames: int) -> None:
    """See that what came while an adapter was set up is SLCAN: now and then noise has the form of a frame, or of an answer.

    Raises:
        ConfigError: more pieces are none than there were frames.
    """
    if (strange := stream.malformed) > STRANGE and strange > frames:
        raise ConfigError(
            f"port {channel}: {strange} pieces came that are no SLCAN, and {frames or 'no'} frames; expected an SLCAN "
            "adapter. Next: is it another device, or a controller that sends packets (serial: in place of slcan:)?"
        )


def _passing(filters: Sequence[dict[str, Any]]) -> Callable[[FrameBatch], Any]:
    """Which frames of a batch pass at least one of python-can's filters."""

    def passing(batch: FrameBatch) -> Any:
        number, extended = batch["id"] & ~np.uint32(EXTENDED), batch["id"] >= EXTENDED
        keep = np.zeros(len(batch), bool)
        for f in filters:
            mine = ((number ^ np.uint32(f["can_id"])) & np.uint32(f["can_mask"])) == 0
            keep |= mine & (extended == f["extended"]) if "extended" in f else mine
        return keep

    return passing
