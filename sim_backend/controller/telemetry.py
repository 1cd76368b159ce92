"""Telemetry of the simulated controller: rows of the core to payload bytes, a whole batch at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.link.frames import FD, FRAME, FrameBatch, empty_batch
from bench.rigfile.messages import MessageMap
from sim_backend.core import PERIOD_TICKS, TICK_S
from sim_backend.draws import uniform

if TYPE_CHECKING:
    from sim_backend.machine import Truth

AMBIENT_K, RISE_K, WARM_S = 295.0, 12.0, 600.0
WATCHDOG_ARMED = 16


class Span(NamedTuple):
    """Rows of the core whose first completes a period after `first_tick`, and the controller's state over them. The
    next span begins where they end."""

    rows: npt.NDArray[np.float64]
    first_tick: int
    state: str
    fault: str
    heartbeat_tick: int
    armed: bool


class TelemetryEncoder:
    """Makes one message per row: sequence, tick, then sixteen-bit numbers, as many as the DBC has (29 in 64 bytes)."""

    def __init__(self, messages: MessageMap, truth: Truth, first_tick: int = 0) -> None:
        """`first_tick`: what ran before it was sent too, to nobody."""
        self._message = messages["Telemetry"]
        self._codes = {
            kind: {name: number for number, name in self._message.signal(kind).choices.items()}
            for kind in ("state", "fault")
        }
        signals = self._message.signals[2:]
        self._names = [s.name for s in signals]
        self._payload = np.dtype({"names": ["sequence", "tick", "words"], "formats": ["<u2", "<u4", ("<u2", (len(signals),))],
                                  "offsets": [0, 2, 6], "itemsize": 64})  # fmt: skip
        self._place = {name: k for k, name in enumerate(self._names)}
        self._moves = _moves(*truth.machine.places(truth.defects, self._place))
        self._scale = np.array([s.scale for s in signals])
        self._offset = np.array([s.offset for s in signals])
        self._low = np.array([-32768.0 if s.signed else 0.0 for s in signals])
        self._high = np.array([32767.0 if s.signed else 65535.0 for s in signals])
        self._sequence = first_tick // PERIOD_TICKS
        self._truth = truth

    def encode(self, spans: list[Span], clock: tuple[int, int]) -> FrameBatch:
        """Frames for what ran, in order; `clock` is a time in ns and the tick it belongs to. Frames that a planted loss
        takes are left out, their sequence numbers are used up."""
        n = sum(len(s.rows) for s in spans)
        if not n:
            return empty_batch()
        ticks, values = self._values(spans, n)
        values -= self._offset
        values /= self._scale
        raw = np.rint(values, out=values)
        np.minimum(np.maximum(raw, self._low, out=raw), self._high, out=raw)
        batch = np.zeros(n, FRAME)
        batch["t_ns"] = clock[0] + (ticks - clock[1]) * 100_000
        batch["id"], batch["flags"], batch["length"] = self._message.identifier, FD, self._message.length
        start, self._sequence = self._sequence, self._sequence + n
        payloads = batch["data"].view(self._payload)[:, 0]
        payloads["sequence"] = np.arange(start, start + n) & 0xFFFF
        payloads["tick"] = ticks & 0xFFFFFFFF
        payloads["words"] = raw.astype(np.int64)  # two's complement where negative
        dropped = self._truth.defects["drop_fraction"]
        if dropped:
            seed, visit = self._truth.seed, self._truth.visit
            keep = [uniform(seed, f"drop:{start + k}", visit) >= dropped for k in range(n)]
            batch = batch[np.array(keep, dtype=bool)]
        return batch

    def _values(self, spans: list[Span], n: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Ticks (n,) of the samples, and what their signals say (n, signals)."""
        at = self._place
        values = np.zeros((n, len(at)))
        rows = np.concatenate([s.rows for s in spans])
        for source, goal in self._moves:
            values[:, goal] = rows[:, source]
        machine = self._truth.machine
        machine.spoil(values, at, self._truth.defects)
        ticks = (spans[0].first_tick // PERIOD_TICKS + np.arange(1, n + 1)) * PERIOD_TICKS
        states, faults = self._codes["state"], self._codes["fault"]
        told = [(states[s.state], faults[s.fault], WATCHDOG_ARMED * s.armed, s.heartbeat_tick) for s in spans]
        state, fault, armed, beats = np.repeat(told, [len(s.rows) for s in spans], axis=0).T
        values[:, at["state"]], values[:, at["fault"]] = state, fault
        values[:, at["flags"]] += armed
        values[:, at["host_age"]] = np.maximum(ticks - beats, 0) * TICK_S
        values[:, at["supply"]] = self._truth.supply_V
        warm = AMBIENT_K + RISE_K * (1 - np.exp(-ticks * TICK_S / WARM_S))
        for name, above in machine.windings.items():
            values[:, at[name]] = warm + above
        return ticks, values


def _moves(told: slice | list[int], columns: list[int]) -> list[tuple[slice, slice]]:
    """Columns of the rows and where they go among the signals, as few slices: neighbours that stay neighbours move
    together, which is five times as quick as column by column."""
    moves: list[tuple[slice, slice]] = []
    for a, b in zip(range(len(columns)) if isinstance(told, slice) else told, columns, strict=True):
        if moves and (moves[-1][0].stop, moves[-1][1].stop) == (a, b):
            moves[-1] = slice(moves[-1][0].start, a + 1), slice(moves[-1][1].start, b + 1)
        else:
            moves.append((slice(a, a + 1), slice(b, b + 1)))
    return moves
