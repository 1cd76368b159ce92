"""The firmware's serial line: what goes out takes its time, blocks of a capture fill what lines and telemetry leave, and
nothing is put inside a block."""

from __future__ import annotations

from collections import deque
from typing import Final

from sim_backend.machines.lira.device import Device
from sim_backend.machines.lira.linefaults import LineFaults

BITS: Final = 10
"""Of a byte on the line: start, eight, stop."""
QUEUE: Final = 8192
"""Bytes of telemetry that may wait; what comes then is lost."""


class Uart:
    """A device behind a line that takes time.

    Args:
        device: with its command line.
        baud: of the line, whatever the device says; 0: that of the device.
        faults: of the line.
    """

    def __init__(self, device: Device, baud: int = 0, faults: LineFaults | None = None) -> None:
        self.device, self._baud, self._faults = device, baud, faults
        self._now_s = self._silent_until = 0.0
        device.shell.later = deque()
        self._first: deque[bytes] = deque()
        self._blocks: deque[bytes] = deque()
        self._room = 0.0

    def advance(self, seconds: float, data: bytes) -> bytes:
        """Take bytes, let time pass; what has gone out by its end."""
        if self._faults is not None:
            data = self._disturbed(self._faults, data)
        self._now_s += seconds
        shell = self.device.shell
        if data:
            self._say(shell.feed(data))
        told = self.device.advance(seconds)
        assert shell.later is not None
        while shell.later:  # a request for a part ends what an earlier one asked for
            self._blocks = deque(shell.later.popleft())
        self._say(told)
        if sum(map(len, self._first)) < QUEUE:
            self._first.extend(self.device.streamed.waiting)
        self.device.streamed.waiting.clear()
        return self._gone(seconds)

    def _say(self, data: bytes) -> None:
        if data:
            self._first.append(data)

    def _gone(self, seconds: float) -> bytes:
        if self._now_s <= self._silent_until:
            return b""
        self._room = min(self._room, 0.0) + (self._baud or self.device.baud) / BITS * seconds
        out = []
        for queue in (self._first, self._blocks):
            while queue and self._room > 0:
                out.append(queue.popleft())
                self._room -= len(out[-1])
        return b"".join(out) if self._faults is None else self._faults.said(out, self._now_s)

    def _disturbed(self, faults: LineFaults, data: bytes) -> bytes:
        """What the firmware hears; while it restarts, nothing."""
        data = faults.heard(data, self._now_s)
        if silent := faults.restart(self._now_s):
            self._first.clear()
            self._blocks.clear()
            self._say(self.device.restart("power"))
            self._silent_until = self._now_s + silent
        return data if self._now_s >= self._silent_until else b""
