"""Faults of a serial line, on purpose: what becomes of lines and blocks on their way, and of what the host says.

Of what goes out `drop` loses a unit (a line or a block) or one of its bytes, `duplicate` doubles it, `reorder` lets the next
one go first, `corrupt` flips a bit of it or puts bytes before it that nobody sent. `mute` leaves the host without answers,
`stuck-heartbeat` lets no heartbeat count, `reboot` restarts the firmware."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from bench.link.fault_injection import REBOOT_S, SHARES, Fault

KINDS: Final = (*SHARES, "mute", "stuck-heartbeat", "reboot")
BEAT: Final = b"hb"


class LineFaults:
    """Times count from the first byte of the host.

    Args:
        faults: of KINDS.
        seed: of which units are hit.
    """

    def __init__(self, faults: Sequence[Fault], seed: int) -> None:
        self._faults = tuple(faults)
        self._random = np.random.default_rng([seed, 18])
        self._origin: float | None = None
        self._done: set[Fault] = set()
        self._kept: bytes | None = None  # what lets its successor go first
        self._line = b""  # of the host, as far as it has come

    def heard(self, data: bytes, now_s: float) -> bytes:
        """What the firmware hears of what the host says."""
        if self._origin is None and data:
            self._origin = now_s
        mute, stuck = self._share("mute", now_s), self._share("stuck-heartbeat", now_s)
        if not (mute or stuck or self._line):
            return data
        *lines, self._line = (self._line + data).split(b"\n")
        if not (mute or stuck):
            lines, self._line = [*lines, self._line], b""
            return b"\n".join(lines)
        return b"".join(line + b"\n" for line in lines if (stuck if BEAT in line else mute) == 0)

    def said(self, units: Sequence[bytes], now_s: float) -> bytes:
        """What comes of lines and blocks."""
        return b"".join(out for unit in units for out in self._said(unit, now_s))

    def restart(self, now_s: float) -> float:
        """How long the firmware is silent from now on, as it restarts, s; 0: it does not."""
        for fault in self._faults:
            if fault.kind == "reboot" and fault not in self._done and self._begun(fault, now_s):
                self._done.add(fault)
                return REBOOT_S if fault.duration_s is None else fault.duration_s
        return 0.0

    def _said(self, unit: bytes, now_s: float) -> Iterator[bytes]:
        kept, self._kept = self._kept, None
        if self._hit("drop", now_s):
            at = int(self._random.integers(len(unit)))
            unit = b"" if self._random.random() < 0.5 else unit[:at] + unit[at + 1 :]
        if unit and self._hit("corrupt", now_s):
            unit = self._spoilt(unit)
        if kept is None and self._hit("reorder", now_s):
            self._kept = unit
            return
        yield unit
        if self._hit("duplicate", now_s):
            yield unit
        if kept is not None:
            yield kept

    def _spoilt(self, unit: bytes) -> bytes:
        if self._random.random() < 0.5:
            return self._random.bytes(int(self._random.integers(1, 9))) + unit
        out = bytearray(unit)
        out[int(self._random.integers(len(out)))] ^= 1 << int(self._random.integers(8))
        return bytes(out)

    def _begun(self, fault: Fault, now_s: float) -> bool:
        return self._origin is not None and now_s >= self._origin + fault.start_s

    def _share(self, kind: str, now_s: float) -> float:
        """Of units that are hit; 1 of kinds without a share."""
        found = 0.0
        for fault in self._faults:
            over = fault.duration_s is not None and now_s >= (self._origin or 0.0) + fault.start_s + fault.duration_s
            if fault.kind == kind and self._begun(fault, now_s) and not over:
                found += fault.value or 1.0
        return found

    def _hit(self, kind: str, now_s: float) -> bool:
        share = self._share(kind, now_s)
        return share > 0 and bool(self._random.random() < share)
