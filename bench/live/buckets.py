"""Samples as a page draws them: least and greatest value in each 10 ms, and the newest orbit; all of it small."""

from __future__ import annotations

import base64
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.live.view import View
from bench.samples import SampleBlock

BUCKET_NS = 10_000_000
ORBIT = 400  # points at most
Array = npt.NDArray[np.float64]
RPM = 30 / math.pi  # revolutions per minute of 1 rad/s


class Buckets:
    """Of one run: `main` is the stream whose samples they are, `origin_ns` the sample clock's at its start. Keeps what slow
    devices read last, and how many samples were not shown."""

    def __init__(self, view: View, main: str, origin_ns: int) -> None:
        self._view, self.main, self._origin_ns = view, main, origin_ns
        self._slow: dict[str, float] = {}
        self._next: int | None = None  # sample that follows what was shown

    def message(self, taken: Mapping[str, Sequence[SampleBlock]], age_ms: float) -> dict[str, Any] | None:
        """What is sent of the blocks that were taken; None without one of the main stream."""
        for stream, blocks in taken.items():
            if stream != self.main:
                self._slow |= {name: float(x[-1]) for name, x in blocks[-1].columns.items() if len(x)}
        blocks = [b for b in taken.get(self.main, ()) if len(b)]
        if not blocks:
            return None
        first, last = blocks[0].first_index, blocks[-1]
        lost = 0 if self._next is None else max(0, first - self._next)
        self._next = last.first_index + len(last)
        t_ns = np.concatenate([b.t_ns for b in blocks])
        columns = {name: np.concatenate([b.columns[name] for b in blocks]) for name in last.columns}
        number = (t_ns - self._origin_ns) // BUCKET_NS
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        newest = {name: float(x[-1]) for name, x in columns.items()}
        return {
            "t": _b64((number[starts] * BUCKET_NS) * 1e-9, np.float64),
            "lost": int(lost),
            "channels": self._channels(columns, starts),
            "orbits": self._orbits(columns),
            "state": self._name(self._view.states, newest.get("state")),
            "fault": self._name(self._view.faults, newest.get("fault")),
            "speed_rpm": _finite(newest.get(self._view.speed, math.nan) * RPM),
            "age_ms": round(age_ms, 1),
            "sent_ms": time.time_ns() // 1_000_000,
        }

    def _channels(self, columns: Mapping[str, Array], starts: npt.NDArray[np.intp]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for channel in self._view.channels:
            if channel.name in columns:
                x = columns[channel.name]
                low, high, last = np.fmin.reduceat(x, starts), np.fmax.reduceat(x, starts), float(x[-1])
            elif channel.name in self._slow:
                last = self._slow[channel.name]
                low = high = np.full(len(starts), last)
            else:
                continue
            out[channel.name] = {"min": _b64(low), "max": _b64(high), "last": _finite(last)}
        return out

    def _orbits(self, columns: Mapping[str, Array]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for orbit in self._view.orbits:
            if all(name in columns for name in orbit.channels):
                x, y = orbit.matrix @ np.array([columns[name][-ORBIT:] for name in orbit.channels])
                out[orbit.name] = {"x": _b64(x), "y": _b64(y)}
        return out

    @staticmethod
    def _name(names: Mapping[int, str], code: float | None) -> str:
        if code is None or not math.isfinite(code):
            return ""
        return names.get(int(code), f"{code:g}")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _b64(values: npt.NDArray[Any], dtype: type[np.floating[Any]] = np.float32) -> str:
    """Little endian, as every browser has it."""
    return base64.b64encode(values.astype(np.dtype(dtype).newbyteorder("<")).tobytes()).decode()
