"""An SLCAN adapter as its host sees it: closed until told its bit rates and opened, refusing what it does not know."""

from __future__ import annotations

from collections.abc import Callable

from bench.link.frames import FD, FrameBatch, frame
from bench.wire import sign, slcan
from sim_backend.serving.peers import Sent, joined

VERSION, SERIAL = sign.SLCAN_VERSION, b"NSIM1"
OK, REFUSED = slcan.CR, slcan.BEL
RATES = {code.encode(): rate for rate, code in {**slcan.BITRATES, **slcan.DATA_BITRATES}.items()}
DEFAULT_DATA_BITRATE = 2_000_000  # of the CANable firmware, where Y was not sent


class SlcanAdapter:
    """One adapter on the virtual CAN bus (Lawicel ASCII, CAN FD in the CANable dialect, acknowledgements z and Z).

    With bit rates that are not the bus's it opens all the same, as a real one would; it then hears nothing, what it
    sends reaches nobody, and F tells of a bus error.

    Args:
        bitrate: of the bus, bit/s; None takes any.
        data_bitrate: of the data phase; None takes any.
        bus_off: asks whether the bus is off (an injected fault).
    """

    on_bus = True

    def __init__(
        self, bitrate: float | None, data_bitrate: float | None, bus_off: Callable[[], bool] = lambda: False
    ) -> None:
        self.answers = bytearray()
        self.open = False
        self._mute = False  # opened by L
        self.refused = 0
        self._bus = (bitrate, data_bitrate)
        self._rates: list[float] = [0, DEFAULT_DATA_BITRATE]
        self._stamped = False
        self._errors = False
        self._bus_off = bus_off
        self._rest = b""
        self._skipping = False

    @property
    def hears(self) -> bool:
        """Whether frames pass: it is open, its bit rates are the bus's, and the bus is not off."""
        return self.open and self._fits() and not self._bus_off()

    def _fits(self) -> bool:
        return all(bus in (None, own) for bus, own in zip(self._bus, self._rates, strict=True))

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        """Obey the lines that end in `data`; any split of the bytes gives the same."""
        *lines, rest = (self._rest + data).split(slcan.CR)
        frames: list[FrameBatch] = []
        for k, line in enumerate(lines):
            answer = REFUSED if k == 0 and self._skipping else self._obey(line, t_ns, frames)
            self.refused += answer == REFUSED
            self.answers += answer
        self._skipping = (self._skipping and not lines) or len(rest) > slcan.LONGEST_LINE
        self._rest = b"" if self._skipping else rest
        return joined(frames)

    def _obey(self, line: bytes, t_ns: int, frames: list[FrameBatch]) -> bytes:
        if line[:1] and line[0] in slcan.FRAME_LETTERS:
            return self._send(line, t_ns, frames)
        if line == b"":
            return OK
        if line == b"C":
            self.open = False
            return OK
        if line == b"V":
            return VERSION + OK
        if line == b"N":
            return SERIAL + OK
        if line == b"F" and self.open:
            return b"F%02X\r" % self._status()
        if not self.open:
            return self._set_up(line)
        return REFUSED

    def _set_up(self, line: bytes) -> bytes:
        """What only a closed adapter takes."""
        if line in RATES:
            self._rates[line[:1] == b"Y"] = RATES[line]
        elif line in (b"Z0", b"Z1"):
            self._stamped = line == b"Z1"
        elif line in (b"O", b"L") and self._rates[0]:
            self.open, self._mute = True, line == b"L"
        else:
            return REFUSED
        return OK

    def _status(self) -> int:
        wrong = self._errors or not self._fits() or self._bus_off()
        self._errors = False
        return slcan.BUS_ERROR if wrong else 0

    def _send(self, line: bytes, t_ns: int, frames: list[FrameBatch]) -> bytes:
        parsed = slcan.parse(line) if self.open and not self._mute else None
        if parsed is None:
            return REFUSED
        if self.hears:
            frames.append(frame(parsed.identifier, parsed.payload, t_ns=t_ns, flags=FD if parsed.fd else 0))
        return b"Z\r" if parsed.identifier & slcan.EXTENDED else b"z\r"

    def hear(self, sent: Sent) -> None:
        """Pass frames of the bus on to the host."""
        if self.hears:
            self._errors = self._errors or bool(sent.errors)
            self.answers += sent.stamped if self._stamped else sent.lines
