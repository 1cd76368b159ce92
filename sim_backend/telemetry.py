"""Telemetry of the simulated controller: rows of the core to payload bytes, a whole batch at once."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.frames import FD, FRAME, FrameBatch
from bench.messages import MessageMap
from sim_backend.core import CHANNELS, PERIOD_TICKS, TICK_S
from sim_backend.truth import Truth, uniform

SUPPLY_V = 148.0
AMBIENT_K, RISE_K, WARM_S = 295.0, 12.0, 600.0
WATCHDOG_ARMED = 16
_DEFECT_COLUMNS = {name: k for k, name in enumerate(CHANNELS)}


class TelemetryEncoder:
    """Makes one 64-byte message per row: sequence, tick, then 29 sixteen-bit numbers (see the DBC)."""

    def __init__(self, messages: MessageMap, truth: Truth) -> None:
        self._message = messages["Telemetry"]
        self._codes = {
            kind: {name: number for number, name in self._message.signal(kind).choices.items()}
            for kind in ("state", "fault")
        }
        signals = self._message.signals[2:]
        self._names = [s.name for s in signals]
        self._scale = np.array([s.scale for s in signals])
        self._offset = np.array([s.offset for s in signals])
        self._low = np.array([-32768 if s.signed else 0 for s in signals])
        self._high = np.array([32767 if s.signed else 65535 for s in signals])
        self._sequence = 0
        self._truth = truth
        self._last: npt.NDArray[np.float64] | None = None

    def encode(
        self,
        rows: npt.NDArray[np.float64],
        first_tick: int,
        clock: tuple[int, int],
        state: tuple[str, str],
        heartbeat_tick: int,
        armed: bool,
    ) -> FrameBatch:
        """Frames for rows of the core whose first completes a period after `first_tick`; `clock` is a time in ns and
        the tick it belongs to. Frames that a planted loss takes are left out, their sequence numbers are used up."""
        n = len(rows)
        ticks = (first_tick // PERIOD_TICKS + 1 + np.arange(n)) * PERIOD_TICKS
        values = self._values(rows, ticks, state, heartbeat_tick, armed)
        raw = np.rint((values - self._offset) / self._scale)
        words = np.clip(raw, self._low, self._high).astype(np.int64).astype(np.uint16)
        batch = np.zeros(n, FRAME)
        batch["t_ns"] = clock[0] + (ticks - clock[1]) * 100_000
        batch["id"], batch["flags"], batch["length"] = self._message.identifier, FD, 64
        sequence = (self._sequence + np.arange(n)) & 0xFFFF
        batch["data"][:, 0:2] = sequence.astype("<u2").view(np.uint8).reshape(n, 2)
        batch["data"][:, 2:6] = (ticks & 0xFFFFFFFF).astype("<u4").view(np.uint8).reshape(n, 4)
        batch["data"][:, 6:64] = np.ascontiguousarray(words.astype("<u2")).view(np.uint8).reshape(n, 58)
        start, self._sequence = self._sequence, self._sequence + n
        dropped = self._truth.defects["drop_fraction"]
        if dropped:
            keep = [uniform(self._truth.seed, f"drop:{start + k}") >= dropped for k in range(n)]
            batch = batch[np.array(keep, dtype=bool)]
        return batch

    def _values(
        self,
        rows: npt.NDArray[np.float64],
        ticks: npt.NDArray[np.int64],
        state: tuple[str, str],
        heartbeat_tick: int,
        armed: bool,
    ) -> npt.NDArray[np.float64]:
        rows = self._wired(rows)
        column = {name: rows[:, k] for k, name in enumerate(CHANNELS)}
        column["angle"] = (column["angle"] + math.pi) % (2 * math.pi) - math.pi
        seconds = ticks * TICK_S
        warm = AMBIENT_K + RISE_K * (1 - np.exp(-seconds / WARM_S))
        n = len(rows)
        column |= {"supply": np.full(n, SUPPLY_V), "temp_i": warm, "temp_o": warm + 2, "temp_m": warm - 3}
        column["state"] = np.full(n, float(self._codes["state"][state[0]]))
        column["fault"] = np.full(n, float(self._codes["fault"][state[1]]))
        column["flags"] = column["flags"] + (WATCHDOG_ARMED if armed else 0)
        column["host_age"] = np.maximum((ticks - heartbeat_tick) * TICK_S, 0)
        return np.stack([column[name] for name in self._names], axis=1)

    def _wired(self, rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Planted wiring defects of the current telemetry."""
        d, at = self._truth.defects, _DEFECT_COLUMNS
        order = list(range(len(CHANNELS)))
        sides = "pn"
        if d["exchange_current_axes"]:
            for b in "io":
                for c in sides:
                    x, y = at[f"i_x{b}_{c}"], at[f"i_y{b}_{c}"]
                    order[x], order[y] = order[y], order[x]
        if d["exchange_current_bearings"]:
            for a in "xy":
                for c in sides:
                    i, o = at[f"i_{a}i_{c}"], at[f"i_{a}o_{c}"]
                    order[i], order[o] = order[o], order[i]
        for b in "io":
            if d[f"current_sign_{b}"] < 0:  # the sensors of both coils exchanged: the control current changes sign
                p, n = at[f"i_y{b}_p"], at[f"i_y{b}_n"]
                order[p], order[n] = order[n], order[p]
        rows = rows[:, order]
        if d["stuck_current_yo_p"]:
            rows[:, at["i_yo_p"]] = 4.0
        return rows
