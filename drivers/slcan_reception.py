"""An SLCAN adapter to listen with: told its bit rates and opened, in listen-only mode where it has one, and nothing more.

One that is open already, as another program left it or uses it through a server, is told nothing at all: `C` would take
the bus away from that program. Lawicel adapters know `L`; the CANable firmware a silent mode, `M1` before `O`, which
stays until `M0`, and it confirms no command.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Mapping
from typing import Any

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.frames import FrameBatch, joined
from bench.link.slcanstream import SlcanStream
from bench.wire import slcan
from drivers.byteport import BytePort
from drivers.slcan_bus import ANSWER_S, refuse_noise

FIRST_S = 0.3  # for the first frame of a bus that is in use
SETTINGS = re.compile(rb"(?:(?:[CFLOV]|[SY][0-9]|M[01])?\r)*")

FOUND_OPEN = "the adapter was open already; nothing was said to it"
LISTENING = "listen-only (L): the adapter acknowledges nothing"
SILENCED = "silent mode (M1): the adapter acknowledges nothing"
UNCONFIRMED = "silent mode (M1), as far as can be told: the adapter confirms no command"
UNKNOWN = "the adapter refuses listen-only (L, M1): it is open (O) and acknowledges frames; none is sent"
ASKED = "open (O) as asked for: the adapter acknowledges frames; none is sent"


class AdapterPort(BytePort):
    """A byte stream that takes what sets an adapter up, opens and closes it: no frame."""

    def write(self, data: bytes) -> None:
        """Write such lines.

        Raises:
            LinkError: it is anything else, or the port is lost.
        """
        if not SETTINGS.fullmatch(data):
            raise LinkError(f"port {self.where} is open for listening; nothing but its adapter's settings is written")
        super().write(data)


class SlcanReception:
    """A `drivers.reception.Reception` of an adapter."""

    def __init__(
        self, where: str, arguments: Mapping[str, Any], now_ns: Callable[[], int], *, acknowledge: bool = False
    ) -> None:
        """
        Args:
            where: device, `socket://HOST:PORT` or `rfc2217://HOST:PORT`.
            arguments: bit rates and `tty_baudrate`, of `drivers.canbus.arguments_of`.
            now_ns: host clock, UNIX ns.
            acknowledge: open it so that it acknowledges frames.

        Raises:
            ConfigError: the port cannot be opened, it is no adapter, it refuses the rates, or it would disturb the bus.
        """
        self._where, self._now_ns = where, now_ns
        self._bitrate = arguments["bitrate"]
        self._rates = slcan.rates(self._bitrate, arguments.get("data_bitrate") if arguments["fd"] else None)
        self._stream, self.stats = SlcanStream(), LinkStats()
        self._early: list[FrameBatch] = []  # that came while it was opened
        self._raw = b""  # what came before it was open
        self._ending = b""  # what it is told at the end
        self.manner, self.complaint = FOUND_OPEN, ""
        self._port = AdapterPort.open(where, baudrate=arguments.get("tty_baudrate"))
        try:
            open_already = self._hear(FIRST_S, lambda: bool(self._early))
            self._stream.malformed = 0  # the rest of a line
            if not open_already:
                self._open(acknowledge)
        except LinkError as error:
            self.close()
            raise ConfigError(str(error)) from error
        except BaseException:
            self.close()
            raise

    def _open(self, acknowledge: bool) -> None:
        """Close it, set its rates, open it, and ask what it thinks of the bus if nothing comes."""
        self._ending = slcan.CLOSE
        self._ask(b"\r\r" + slcan.CLOSE)  # CRs end whatever an earlier user left half written
        refuse_noise(self._where, self._stream, sum(map(len, self._early)))
        confirms = bool(re.search(rb"\a|^\r|\r\r", self._raw))
        if self._ask(self._rates):
            lines = ", ".join(line.decode() for line in self._rates.split())
            raise ConfigError(
                f"port {self._where}: the SLCAN adapter refuses one of {lines}; expected one that knows these bit rates"
            )
        self._stream.malformed = 0  # nothing of the past counts
        self.manner = self._mode(confirms, acknowledge)
        if self._hear(FIRST_S, lambda: bool(self._early)):
            return
        self._port.write(slcan.STATUS)
        refused = self._stream.refused
        self._hear(ANSWER_S, lambda: self._stream.status is not None or self._stream.refused > refused)
        if (self._stream.status or 0) & slcan.BUS_ERROR:
            self._complain()

    def _mode(self, confirms: bool, acknowledge: bool) -> str:
        """Open it in the quietest mode that it has; how, in words."""
        if not confirms:  # a mode that an earlier user set stays set
            self._port.write((slcan.NORMAL if acknowledge else slcan.SILENT) + slcan.OPEN)
            self._ending += slcan.NORMAL
            return ASKED if acknowledge else UNCONFIRMED
        if not acknowledge and not self._ask(slcan.LISTEN):
            return LISTENING
        silent = not acknowledge and not self._ask(slcan.SILENT)
        if silent:
            self._ending += slcan.NORMAL
        if self._ask(slcan.OPEN):
            raise ConfigError(f"port {self._where}: the SLCAN adapter refuses to be opened (O). Next: plug it in anew")
        return SILENCED if silent else ASKED if acknowledge else UNKNOWN

    def _ask(self, lines: bytes) -> bool:
        """Tell it these lines; whether it refuses one. Its answer to V, which is always allowed, stands behind theirs."""
        self._stream.refused = 0
        self._stream.replies.clear()
        self._port.write(lines + slcan.VERSION)
        self._hear(ANSWER_S, lambda: bool(self._stream.replies))
        return self._stream.refused > 0

    def _hear(self, seconds: float, enough: Callable[[], bool]) -> bool:
        """Read until that holds, or so long."""
        deadline = time.monotonic() + seconds
        while not enough() and (left := deadline - time.monotonic()) > 0:
            data = self._port.read(left)
            self._raw = (self._raw + data)[-4096:]
            if len(batch := self._stream.feed(data, self._now_ns())):
                self._early.append(batch)
        return enough()

    def _complain(self) -> None:
        """It hears errors on the bus: harmless for one that only listens, while any other destroys what it hears."""
        text = f"the SLCAN adapter reports bus errors at {self._bitrate} bit/s (F{self._stream.status:02X})"
        if self.manner in (ASKED, UNKNOWN):
            raise ConfigError(
                f"port {self._where}: {text}, and was closed, so that it does not disturb the bus; expected the bit rates of "
                "the bus, and a bus that is connected and terminated"
            )
        self.complaint = text

    def read(self, timeout_s: float) -> FrameBatch:
        """As Reception says."""
        if self._early:
            batch, self._early = joined(self._early), []
        else:
            before = self._stream.answered
            data = self._port.read(timeout_s)
            batch = self._stream.feed(data, self._now_ns())
            self.stats.octets += len(data) - (self._stream.answered - before)
        self.stats.received += len(batch)
        self.stats.malformed, self.stats.adapter_overruns = self._stream.malformed, self._stream.overruns
        return batch

    def cancel(self) -> None:
        """As Reception says."""
        self._port.cancel()

    def close(self) -> None:
        """As Reception says; one that was opened here is closed and put back."""
        with contextlib.suppress(LinkError):  # it is gone already
            if self._ending:
                self._port.write(self._ending)
        self._ending = b""
        self._port.close()
