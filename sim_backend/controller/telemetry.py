"""Telemetry of the simulated controller: rows of the core to payload bytes, a whole batch at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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


class Readings:
    """What a machine and its controller have to tell, sample by sample, each in its place.

    Args:
        place: where among the values each reading goes, by its name.
        codes: of states and of faults, by their names; under `state` and `fault`.
        period_ticks, tick_s: of the telemetry.
        columns: names of the rows' columns, where they are none of the machine's own.
        windings: temperatures, and how far each is above the first, K; the machine's own where nothing is said.
    """

    def __init__(
        self, truth: Truth, place: Mapping[str, int], codes: Mapping[str, Mapping[str, int]], period_ticks: int,
        tick_s: float, columns: Sequence[str] | None = None, windings: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        machine = truth.machine
        source: slice | list[int]
        self._windings = machine.windings if windings is None else windings
        if columns is None:
            source, goal = machine.places(truth.defects, place)
        else:
            source = [k for k, name in enumerate(columns) if name in place]
            goal = [place[columns[k]] for k in source]
        self._armed = WATCHDOG_ARMED if columns is None else 0  # in the machine's own status word alone
        self._moves = _moves(source, goal)
        self._truth, self._place, self._codes = truth, place, codes
        self._period_ticks, self._tick_s = period_ticks, tick_s

    def of(self, spans: list[Span], n: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Ticks (n,) of the samples, and what there is to tell of them (n, places), SI."""
        at, period = self._place, self._period_ticks
        values = np.zeros((n, len(at)))
        rows = np.concatenate([s.rows for s in spans])
        for source, goal in self._moves:
            values[:, goal] = rows[:, source]
        machine = self._truth.machine
        machine.spoil(values, at, self._truth.defects)
        ticks = (spans[0].first_tick // period + np.arange(1, n + 1)) * period
        states, faults = self._codes["state"], self._codes["fault"]
        told = [(states[s.state], faults[s.fault], self._armed * s.armed, s.heartbeat_tick) for s in spans]
        state, fault, armed, beats = np.repeat(told, [len(s.rows) for s in spans], axis=0).T
        values[:, at["state"]], values[:, at["fault"]] = state, fault
        values[:, at["flags"]] += armed
        values[:, at["host_age"]] = np.maximum(ticks - beats, 0) * self._tick_s
        values[:, at["supply"]] = self._truth.supply_V
        warm = AMBIENT_K + RISE_K * (1 - np.exp(-ticks * self._tick_s / WARM_S))
        for name, above in self._windings.items():
            values[:, at[name]] = warm + above
        return ticks, values


class TelemetryEncoder:
    """Makes one message per row: sequence, tick, then sixteen-bit numbers, as many as the DBC has (29 in 64 bytes)."""

    def __init__(self, messages: MessageMap, truth: Truth, first_tick: int = 0) -> None:
        """`first_tick`: what ran before it was sent too, to nobody."""
        self._message = messages["Telemetry"]
        codes = {
            kind: {name: number for number, name in self._message.signal(kind).choices.items()}
            for kind in ("state", "fault")
        }
        signals = self._message.signals[2:]
        self._payload = np.dtype({"names": ["sequence", "tick", "words"], "formats": ["<u2", "<u4", ("<u2", (len(signals),))],
                                  "offsets": [0, 2, 6], "itemsize": 64})  # fmt: skip
        place = {name: k for k, name in enumerate(s.name for s in signals)}
        self._readings = Readings(truth, place, codes, PERIOD_TICKS, TICK_S)
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
        ticks, values = self._readings.of(spans, n)
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
        return kept(batch, range(start, start + n), self._truth)


def kept(batch: FrameBatch, sequence: Iterable[int], truth: Truth) -> FrameBatch:
    """Samples (n, ...) without those that a planted loss takes, by their sequence numbers."""
    dropped = truth.defects["drop_fraction"]
    if not dropped:
        return batch
    keep = [uniform(truth.seed, truth.anew(f"drop:{number}"), truth.visit) >= dropped for number in sequence]
    left: FrameBatch = batch[np.array(keep, dtype=bool)]
    return left


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
