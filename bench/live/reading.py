"""What a client sends, for so long and no longer."""

from __future__ import annotations

import io
import socket
import time
from typing import Any


class Bounded(io.RawIOBase):
    """What a client sends, until a moment: one that dribbles is given up as a silent one is."""

    def __init__(self, connection: socket.socket, seconds: float) -> None:
        self._connection, self._until = connection, time.monotonic() + seconds

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self._until - time.monotonic()
        if left <= 0:
            raise TimeoutError("the request took too long")
        self._connection.settimeout(left)
        return self._connection.recv_into(buffer)
