"""A Modbus TCP server for the devices of `tsbs12`, written from the standard and the rig file alone, that misbehaves when told
so: slow, refusing, hanging up, telling what is no number, hot, off, or in fault."""

from __future__ import annotations

import socket
import socketserver
import struct
import threading
import time
from collections.abc import Callable

HOLDING, INPUT, WRITE_ONE, WRITE_MANY = 3, 4, 6, 16
DRIVE, SUPPLY, THERMAL = 1, 2, 3
Active = Callable[[str], float | None]
"""The value of a misbehaviour while it is at work."""


def registers(active: Active) -> dict[tuple[int, int], dict[int, int]]:
    """Words by unit, function and address: 148 V and on, 22 °C, 20 °C about the rig, a drive that stands and coasts."""
    hot = 2000 if active("mbhot") is not None else 220  # 0.1 °C
    ambient = float("nan") if active("mbnan") is not None else 20.0
    off = active("mbsupplyoff") is not None
    return {
        (DRIVE, HOLDING): dict.fromkeys(range(3), 0),
        (DRIVE, INPUT): {0: 0, 1: int(active("mbfault") or 0), 2: 0, 3: 0, 4: 0},
        (SUPPLY, INPUT): {100: 0 if off else 14_800, 101: 0 if off else 350, 110: 0 if off else 1},
        (THERMAL, INPUT): {
            0: hot,
            1: 220,
            2: 220,
            **dict(enumerate(struct.unpack(">2H", struct.pack(">f", ambient)), 8)),
        },
    }


class FieldbusServer:
    """Serves on a free port until it is closed."""

    def __init__(self, active: Active) -> None:
        self._active, self._dropped = active, 0
        self._server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), self._handler(), bind_and_activate=True)
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, name="fieldbus", daemon=True).start()

    def close(self) -> None:
        """Take no further connections."""
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[socketserver.BaseRequestHandler]:
        outer = self

        class Handler(socketserver.BaseRequestHandler):
            def handle(self) -> None:
                outer._serve(self.request)

        return Handler

    def _serve(self, connection: socket.socket) -> None:
        try:
            while head := _exactly(connection, 7):
                transaction, _, length, unit = struct.unpack(">HHHB", head)
                pdu = _exactly(connection, length - 1)
                if (slow := self._active("mbslow")) is not None:
                    time.sleep(slow)
                if (times := self._active("mbdrop")) is not None and self._dropped < times:
                    self._dropped += 1
                    return
                answer = self._answer(unit, pdu)
                connection.sendall(struct.pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer)
        except OSError:
            return

    def _answer(self, unit: int, pdu: bytes) -> bytes:
        function, address, count = struct.unpack(">BHH", pdu[:5])
        if (code := self._active("mbexception")) is not None:
            return bytes([function | 0x80, int(code)])
        if function in (WRITE_ONE, WRITE_MANY):
            return pdu[:5]
        words = registers(self._active).get((unit, function), {})
        wanted = range(address, address + count)
        if not set(wanted) & words.keys():
            return bytes([function | 0x80, 2])
        return struct.pack(f">BB{count}H", function, 2 * count, *(words.get(k, 0) for k in wanted))


def _exactly(connection: socket.socket, count: int) -> bytes:
    """So many bytes; nothing when the other end closed."""
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            return b""
        data += part
    return data
