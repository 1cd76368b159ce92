"""Link URLs: which transport, where, and with which settings. One grammar for rig files, `--link` and `bench serve`.

    inprocess:                              simulation in this process
    slcan:PORT                              CAN over the Lawicel ASCII protocol; PORT is a serial port or URL
    can:INTERFACE:CHANNEL?key=value         any other interface of python-can
    serial:PORT?baudrate=N                  the same messages in COBS packets
    cli:PORT?baudrate=N                     the controller's command line, as the rig file's [commandline] says
    modbus-tcp:HOST:PORT                    Modbus TCP
    modbus-rtu:PORT?baudrate=N&parity=E     Modbus RTU on a serial port
    modbus-rtu-tcp:HOST:PORT                RTU frames over TCP
    line:HOST:PORT                          the operator's line protocol

PORT is a device (`/dev/ttyACM0`, `COM3`), `socket://HOST:PORT` or `rfc2217://HOST:PORT`. Installed packages may add schemes
(`drivers.wires`, `drivers.registerline`).
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from urllib.parse import parse_qsl

from bench import extensions
from bench.errors import ConfigError

EXAMPLES = {
    "inprocess": "inprocess:",
    "slcan": "slcan:/dev/ttyACM0",
    "can": "can:socketcan:can0",
    "serial": "serial:/dev/ttyUSB0?baudrate=3000000",
    "cli": "cli:serial:/dev/ttyUSB0?baudrate=921600",
    "modbus-tcp": "modbus-tcp:192.168.0.20:502",
    "modbus-rtu": "modbus-rtu:/dev/ttyUSB1?baudrate=19200",
    "modbus-rtu-tcp": "modbus-rtu-tcp:192.168.0.20:502",
    "line": "line:127.0.0.1:28504",
}
CONTROLLER_SCHEMES = ("inprocess", "slcan", "can", "serial", "cli")
TCP_SCHEMES = ("modbus-tcp", "modbus-rtu-tcp", "line")
PIECES_SCHEMES = ("serial", "cli")
"""Links on which a capture comes in pieces; on the others it comes in blocks of ISO 15765-2."""
MODBUS_SCHEMES = ("modbus-tcp", "modbus-rtu", "modbus-rtu-tcp")


def owner(scheme: str) -> str:
    """What of ours holds a scheme; "" where it is none of ours."""
    return "bench.rigfile.linkurl" if scheme in EXAMPLES else ""


def controller_schemes() -> tuple[str, ...]:
    """Those of a controller's link, with what packages add."""
    return (*CONTROLLER_SCHEMES, *extensions.names(extensions.LINKS, EXAMPLES))


def device_schemes() -> tuple[str, ...]:
    """Those of lines with register devices, with what packages add."""
    return (*MODBUS_SCHEMES, *extensions.names(extensions.DEVICES, EXAMPLES))


def example(scheme: str) -> str:
    """A URL of a scheme, for messages."""
    return EXAMPLES.get(scheme, f"{scheme}:ADDRESS")


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A link URL taken apart: `rest` is what lies between the scheme and the query."""

    scheme: str
    rest: str
    query: dict[str, str] = field(default_factory=dict)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of a TCP link.

        Raises:
            ConfigError: `rest` is not HOST:PORT.
        """
        host, _, port = self.rest.rpartition(":")
        host = host[1:-1] if host.startswith("[") and host.endswith("]") else host  # IPv6: [::1]:502
        if not host or not re.fullmatch("[0-9]{1,5}", port) or int(port) > 65535:
            such = EXAMPLES[self.scheme if self.scheme in TCP_SCHEMES else "line"]
            raise ConfigError(f"link {self.scheme}:{self.rest}: expected HOST:PORT, such as {such}")
        return host, int(port)


def parse(url: str) -> LinkUrl:
    """Take a URL apart.

    Raises:
        ConfigError: an unknown scheme, or nothing after it.
    """
    scheme, colon, rest = url.partition(":")
    scheme = scheme.lower()
    if not colon or (scheme not in EXAMPLES and scheme not in (*controller_schemes(), *device_schemes())):
        close = difflib.get_close_matches(scheme, EXAMPLES, 1)
        known = f"did you mean {EXAMPLES[close[0]]!r}?" if close else f"expected one of {', '.join(EXAMPLES)}"
        raise ConfigError(f"link URL {url!r}: found scheme {scheme!r}; {known}")
    where, _, query = rest.partition("?")
    if not where and scheme != "inprocess":
        raise ConfigError(f"link URL {url!r}: found no address; expected such as {example(scheme)!r}")
    return LinkUrl(scheme, where, dict(parse_qsl(query, keep_blank_values=True)))
