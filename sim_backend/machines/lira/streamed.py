"""Slow telemetry: twenty values so many times a second, in blocks of their own between the lines."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from typing import Final

from bench.wire.commandline import block
from sim_backend.core.plant import Array
from sim_backend.machines.lira.plant import AXES, DQ, TICKS_S, WHOLE
from sim_backend.machines.lira.shell import Refused

NUMBER: Final = 0xFFFF
SLOTS: Final = 35_000
"""Readings of the positions a second: a rate is one of their divisors."""
FASTEST: Final = 1000
LSB: Final = (*(1e-8,) * 4, 1e-6, 2 * math.pi / 2**16, *(1e-3,) * len(DQ))
SIGNED: Final = tuple(WHOLE.index(name) for name in (*AXES, *(f"i_{name}" for name in DQ)))
SUPPLY, STATE, FAULT, LIMITED, SPEED, HEARD = (
    WHOLE.index(name) for name in ("u_dc", "mode", "fault", "limited", "rate_angle", "heard")
)
TOLD: Final = struct.Struct("<H16hHBBHhH")
"""Sequence; x1 x2 y1 y2, z, angle, dq currents; supply, state, fault, limited loops, rate of the angle, ms since the last
heartbeat."""


class Streamed:
    """What `stream HZ` asks for; `stream 0` ends it."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self._ticks = self._count = 0

    def do(self, *words: str) -> Iterable[str]:
        """Carry out a request.

        Raises:
            Refused: no rate, or one that is none of the readings' divisors.
        """
        if len(words) != 1 or not words[0].isdigit():
            raise Refused(2, "Hz, or 0")
        hz = int(words[0])
        if hz and (hz > FASTEST or SLOTS % hz):
            raise Refused(3, f"stream: a divisor of {SLOTS}, {FASTEST} at most")
        self._ticks = TICKS_S // hz if hz else 0
        return [words[0]]

    def end(self) -> None:
        """Nothing more is told."""
        self.waiting.clear()
        self._ticks = self._count = 0

    def take(self, rows: Array, tick: int, every: int) -> None:
        """Rows (n, len(WHOLE)) of the machine, of every so many ticks from a tick on."""
        for k in self._due(tick, every, len(rows)):
            self._count = (self._count + 1) & 0xFFFF
            self.waiting.append(block(NUMBER, (tick + k * every) & 0xFFFFFFFF, told(self._count, rows[k])))

    def _due(self, tick: int, every: int, count: int) -> Iterator[int]:
        if self._ticks:
            first = -(-tick // self._ticks) * self._ticks
            yield from range((first - tick) // every, count, self._ticks // every)


def told(count: int, row: Array) -> bytes:
    """The bytes of one sample."""
    values = row.tolist()  # whose rounding costs less than that of numpy's
    signed = [round(values[k] / lsb) for k, lsb in zip(SIGNED, LSB, strict=True)]
    signed[5] = (signed[5] + 2**15) % 2**16 - 2**15  # an angle comes round
    if min(signed) < -(2**15) or max(signed) > 2**15 - 1:
        signed = [_held(x, -(2**15), 2**15 - 1) for x in signed]
    supply = _held(round(values[SUPPLY] / 0.01), 0, 0xFFFF)
    age = min(round(values[HEARD] * 1e3), 0xFFFF) if values[HEARD] >= 0 else 0xFFFF
    speed = _held(round(values[SPEED] / 0.005), -(2**15), 2**15 - 1)
    return TOLD.pack(count, *signed, supply, int(values[STATE]), int(values[FAULT]), int(values[LIMITED]), speed, age)


def _held(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)
