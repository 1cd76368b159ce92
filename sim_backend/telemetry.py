"""Telemetry of the simulated controller: rows of the core to payload bytes, a whole batch at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.frames import FD, FRAME, FrameBatch, empty_batch
from bench.messages import MessageMap
from sim_backend.core import CHANNELS, PERIOD_TICKS, TICK_S
from sim_backend.truth import Truth, uniform

SUPPLY_V = 148.0
AMBIENT_K, RISE_K, WARM_S = 295.0, 12.0, 600.0
WATCHDOG_ARMED = 16
_DEFECT_COLUMNS = {name: k for k, name in enumerate(CHANNELS)}


@dataclass(frozen=True, slots=True)
class Span:
    """Rows of the core whose first completes a period after `first_tick`, and the controller's state over them."""

    rows: npt.NDArray[np.float64]
    first_tick: int
    state: str
    fault: str
    heartbeat_tick: int
    armed: bool


class TelemetryEncoder:
    """Makes one 64-byte message per row: sequence, tick, then 29 sixteen-bit numbers (see the DBC)."""

    def __init__(self, messages: MessageMap, truth: Truth, first_tick: int = 0) -> None:
        """`first_tick`: what ran before it was sent too, to nobody."""
        self._message = messages["Telemetry"]
        self._codes = {
            kind: {name: number for number, name in self._message.signal(kind).choices.items()}
            for kind in ("state", "fault")
        }
        signals = self._message.signals[2:]
        self._names = [s.name for s in signals]
        self._place = {name: k for k, name in enumerate(self._names)}
        self._columns = [self._place[name] for name in CHANNELS]
        self._scale = np.array([s.scale for s in signals])
        self._offset = np.array([s.offset for s in signals])
        self._low = np.array([-32768 if s.signed else 0 for s in signals])
        self._high = np.array([32767 if s.signed else 65535 for s in signals])
        self._sequence = first_tick // PERIOD_TICKS
        self._truth = truth

    def encode(self, spans: list[Span], clock: tuple[int, int]) -> FrameBatch:
        """Frames for what ran, in order; `clock` is a time in ns and the tick it belongs to. Frames that a planted loss
        takes are left out, their sequence numbers are used up."""
        spans = [s for s in spans if len(s.rows)]
        if not spans:
            return empty_batch()
        counts = [len(s.rows) for s in spans]
        ticks = np.concatenate(
            [(s.first_tick // PERIOD_TICKS + 1 + np.arange(len(s.rows))) * PERIOD_TICKS for s in spans]
        )
        n = len(ticks)
        values = self._values(np.concatenate([s.rows for s in spans]), ticks)
        for name, column in (
            ("state", [self._codes["state"][s.state] for s in spans]),
            ("fault", [self._codes["fault"][s.fault] for s in spans]),
        ):
            values[:, self._place[name]] = np.repeat(np.array(column, float), counts)
        values[:, self._place["flags"]] += np.repeat([WATCHDOG_ARMED if s.armed else 0 for s in spans], counts)
        beats = np.repeat([s.heartbeat_tick for s in spans], counts)
        values[:, self._place["host_age"]] = np.maximum(ticks - beats, 0) * TICK_S
        raw = np.rint((values - self._offset) / self._scale)
        words = np.clip(raw, self._low, self._high).astype(np.int64).astype("<u2")
        batch = np.zeros(n, FRAME)
        batch["t_ns"] = clock[0] + (ticks - clock[1]) * 100_000
        batch["id"], batch["flags"], batch["length"] = self._message.identifier, FD, 64
        sequence = (self._sequence + np.arange(n)) & 0xFFFF
        batch["data"][:, 0:2] = sequence.astype("<u2").view(np.uint8).reshape(n, 2)
        batch["data"][:, 2:6] = (ticks & 0xFFFFFFFF).astype("<u4").view(np.uint8).reshape(n, 4)
        batch["data"][:, 6:64] = words.view(np.uint8).reshape(n, 58)
        start, self._sequence = self._sequence, self._sequence + n
        dropped = self._truth.defects["drop_fraction"]
        if dropped:
            keep = [uniform(self._truth.seed, f"drop:{start + k}") >= dropped for k in range(n)]
            batch = batch[np.array(keep, dtype=bool)]
        return batch

    def _values(self, rows: npt.NDArray[np.float64], ticks: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        rows = self._wired(rows)
        values = np.zeros((len(rows), len(self._names)))
        values[:, self._columns] = rows
        angle = self._place["angle"]
        values[:, angle] = (values[:, angle] + math.pi) % (2 * math.pi) - math.pi
        warm = AMBIENT_K + RISE_K * (1 - np.exp(-ticks * TICK_S / WARM_S))
        values[:, self._place["supply"]] = SUPPLY_V
        for name, above in (("temp_i", 0.0), ("temp_o", 2.0), ("temp_m", -3.0)):
            values[:, self._place[name]] = warm + above
        return values

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
