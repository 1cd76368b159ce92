"""The one adapter to pymodbus's clients: Modbus TCP, RTU on a serial port, RTU frames over TCP.

pymodbus's own retries and reconnects are switched off: what is lost is opened anew here, in a bounded time, and after
every failure, so that a late answer is never taken for the next request's.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, cast

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException
from pymodbus.framer import FramerType

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.rigfile import LinkSpec, RigFile, linkurl
from bench.rigfile.linkurl import LinkUrl
from bench.rigfile.registers import RegisterRefused, Table, Words
from drivers.registerline import RegisterLine, device_kind

TIMEOUT_S = 0.5  # for an answer, and for a connection; option `timeout_s` of the link
AGAIN_S = 0.1  # between two attempts to open what was lost
FUNCTIONS: Mapping[Table, int] = {"holding": 3, "input": 4}
SERIAL = {"baudrate": int, "parity": str, "stopbits": int, "bytesize": int}
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # what it logs as errors arrives here as exceptions

Client = ModbusTcpClient | ModbusSerialClient


class ModbusLine:
    """One connection, shared by the devices on it; one request at a time. May be used from several threads."""

    def __init__(self, name: str, spec: LinkSpec) -> None:
        """Raises ConfigError: the URL is no Modbus link, or has a setting that is none."""
        self.name, self.stats = name, LinkStats()
        self._url, self._reconnect_s = spec.url, spec.reconnect_s
        self._client = _client(name, linkurl.parse(spec.url), _timeout_s(name, spec.options))
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._lost = False  # since the last answer

    def open(self) -> None:
        """Connect.

        Raises:
            ConfigError: nobody answers there, or the port cannot be used.
        """
        if not self._client.connect():
            port = isinstance(self._client, ModbusSerialClient)
            found = "the port cannot be opened" if port else "nobody answers there"
            step = "check the port's name and that nothing else uses it" if port else "start what answers there"
            raise ConfigError(
                f"link {self.name}: {self._url}: {found}. Next: {step}, or correct [links.{self.name}] url"
            )

    def close(self) -> None:
        """Close the connection; a request that waits for it ends. Calling it twice is harmless."""
        self._closed.set()
        with self._lock:
            self._hang_up()

    def port(self, unit: int) -> ModbusPort:
        """One device on this line."""
        return ModbusPort(self, unit)

    def request(self, where: str, call: Callable[[Client], Any], *, reopens: bool = False) -> Any:
        """Make a request; where `reconnect_s` is set, a lost connection is opened anew and the request made again.
        Where it is 0, only a request that `reopens` opens it: a write, so that make-safe can still stop a drive.

        Raises:
            RegisterRefused: the device answers with an exception.
            LinkError: no answer, or one that cannot be right, within the time.
        """
        deadline = time.monotonic() + self._reconnect_s
        while True:
            try:
                with self._lock:  # for one attempt: what is urgent need not wait until another request gives up
                    return self._once(where, call, reopens)
            except RegisterRefused:
                raise
            except LinkError:
                if time.monotonic() >= deadline or self._closed.wait(AGAIN_S):
                    raise

    def _once(self, where: str, call: Callable[[Client], Any], reopens: bool) -> Any:
        if self._closed.is_set():
            raise LinkError(f"link {self.name}: closed")
        if self._lost and not self._reconnect_s and not reopens:
            raise LinkError(f"link {self.name}: {self._url}: lost, and reconnect_s is 0 ({where})")
        self.stats.sent += 1
        try:
            answer = call(self._client)
        except ConnectionException as error:
            self._hang_up()
            raise LinkError(f"link {self.name}: {self._url}: the connection is lost ({where})") from error
        except ModbusException as error:
            self._hang_up()
            raise LinkError(f"link {self.name}: {self._url}: no usable answer ({where})") from error
        except Exception as error:  # bytes that are no Modbus end in whatever its decoder stumbles over
            self._hang_up()
            self.stats.malformed += 1
            raise LinkError(f"link {self.name}: {self._url}: the answer is not Modbus ({where}): {error!r}") from error
        self.stats.received += 1
        if self._lost:  # an outage counts once, when it is over
            self._lost = False
            self.stats.reconnects += 1
        if answer.isError():
            raise RegisterRefused(int(answer.exception_code), f"link {self.name}: {where}")
        return answer

    def _hang_up(self) -> None:
        self._lost = True
        self._client.close()  # type: ignore[no-untyped-call]

    def odd(self, where: str, found: str) -> LinkError:
        """An answer that decodes, but is not what was asked."""
        self.stats.malformed += 1
        with self._lock:
            self._hang_up()
        return LinkError(f"link {self.name}: {self._url}: {where}: found {found}")


@contextmanager
def open_lines(rig: RigFile) -> Iterator[Mapping[str, RegisterLine]]:
    """The links of the rig's register devices by name, Modbus or of a kind that a package adds, connected for the block.

    Raises:
        ConfigError: a link that is none, or nobody answers there.
    """
    links = dict.fromkeys(d.link for d in rig.devices.values() if d.registers)
    with ExitStack() as stack:
        lines = {name: _line(name, rig.links[name]) for name in links}
        for line in lines.values():
            stack.callback(line.close)
            line.open()
        yield lines


def _line(name: str, spec: LinkSpec) -> RegisterLine:
    kind = device_kind(linkurl.parse(spec.url).scheme)
    return ModbusLine(name, spec) if kind is None else kind.line(name, spec)


@dataclass(frozen=True)
class ModbusPort:
    """A `bench.rigfile.registers.RegisterPort` over a line."""

    line: ModbusLine
    unit: int

    def read(self, table: Table, address: int, count: int) -> Words:
        """`count` registers from `address` on.

        Raises:
            RegisterRefused: the device answers with an exception.
            LinkError: no answer, or not that many registers.
        """
        where = f"unit {self.unit}, {table} registers {address} to {address + count - 1}"

        def call(client: Client) -> Any:
            ask = client.read_holding_registers if table == "holding" else client.read_input_registers
            return ask(address, count=count, device_id=self.unit)

        answer = self.line.request(where, call)
        if answer.function_code != FUNCTIONS[table]:
            raise self.line.odd(where, f"the answer to function {answer.function_code}")
        words = tuple(int(w) for w in answer.registers)
        if len(words) != count:
            raise self.line.odd(where, f"{len(words)} registers; expected {count}")
        return words

    def write(self, address: int, words: Words) -> None:
        """Write holding registers with function 16.

        Raises:
            RegisterRefused: the device answers with an exception.
            LinkError: no answer, or an echo of something else.
        """
        where = f"unit {self.unit}, holding registers {address} to {address + len(words) - 1}"
        echo = self.line.request(
            where, lambda c: c.write_registers(address, list(words), device_id=self.unit), reopens=True
        )
        if (echo.address, echo.count) != (address, len(words)):
            raise self.line.odd(where, f"an echo of {echo.count} registers at {echo.address}")


def _client(name: str, url: LinkUrl, timeout_s: float) -> Client:
    if url.scheme not in linkurl.MODBUS_SCHEMES:
        known = ", ".join(map(linkurl.example, linkurl.device_schemes()))
        raise ConfigError(f"link {name}: found {url.scheme}:{url.rest}; expected such as {known}")
    settings = _settings(name, url)
    if url.scheme == "modbus-rtu":
        if "://" in url.rest:
            raise ConfigError(f"link {name}: found {url.rest}; expected a serial port, or modbus-rtu-tcp:HOST:PORT")
        return ModbusSerialClient(url.rest, framer=FramerType.RTU, timeout=timeout_s, retries=0, **settings)
    framer = FramerType.SOCKET if url.scheme == "modbus-tcp" else FramerType.RTU
    host, port = url.address
    return ModbusTcpClient(host, port=port, framer=framer, timeout=timeout_s, retries=0)


def _settings(name: str, url: LinkUrl) -> dict[str, Any]:
    known: Mapping[str, Callable[[str], Any]] = SERIAL if url.scheme == "modbus-rtu" else {}
    out: dict[str, Any] = {}
    for key, text in url.query.items():
        try:
            out[key] = known[key](text)
        except (KeyError, ValueError):
            expected = ", ".join(known) or "no settings"
            raise ConfigError(f"link {name}: found {key}={text}; expected {expected}") from None
    if out.get("parity", "N") not in ("N", "E", "O") or out.get("baudrate", 1) < 1:
        raise ConfigError(f"link {name}: found {url.query}; expected parity N, E or O and a positive baudrate")
    return out


def _timeout_s(name: str, options: Mapping[str, Any]) -> float:
    found = options.get("timeout_s", TIMEOUT_S)
    if set(options) - {"timeout_s"} or isinstance(found, bool | str) or not 0 < found <= 10:
        raise ConfigError(f"links.{name}.options: found {dict(options)}; expected at most timeout_s, 0 to 10 s")
    return cast(float, found)
