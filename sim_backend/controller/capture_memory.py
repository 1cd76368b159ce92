"""Capture memory of the simulated controller: a ring before the trigger, samples after it, then bytes. No messages here."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile.capture import CaptureSpec, Layout

Array = npt.NDArray[np.float64]
TOLD_BY = {"PULSE": "pulses", "SPEED": "speed"}
WATCHING = ("RISES", "FALLS", *TOLD_BY)


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be recorded: a bit for each channel, ticks from sample to sample, samples in all and before the trigger;
    what is waited for, with the index of its channel and a level in SI."""

    mask: int
    divider: int
    length: int
    before: int
    trigger: str
    source: int = 0
    level: float = 0.0


class CaptureMemory:
    """Records one capture after the other; the last one stays until another is armed.

    Args:
        spec: what the rig file says of it.
        names: the channels of the readings that it is given, in their order.
        told_by: which of them tell what the triggers of the mark wait for, by trigger.
    """

    def __init__(self, spec: CaptureSpec, names: Sequence[str], told_by: Mapping[str, str] = TOLD_BY) -> None:
        self._spec, self._told_by = spec, told_by
        self._columns = {name: k for k, name in enumerate(names)}
        self._by_index = {c.index: name for name, c in spec.channels.items()}
        self.state = "IDLE"
        self.number = 0
        self.crc = 0
        self.buffer = b""
        self.order = Order(0, 0, 0, 0, "NOW")
        self.first_tick = 0
        self.size = 0
        self._clear()

    def _clear(self) -> None:
        self._kept: list[Array] = []
        self._last = np.nan
        self.samples = 0
        self.crc, self.buffer = 0, b""

    @property
    def every(self) -> int:
        """Ticks from reading to reading that it wants; 0 while it records nothing."""
        return self.order.divider if self.state in ("ARMED", "TRIGGERED") else 0

    def arm(self, order: Order) -> str:
        """Begin; the name of the status. What was recorded before is gone."""
        known = sum(1 << index for index in self._by_index)
        watched = (
            self._by_index.get(order.source)
            if order.trigger in ("RISES", "FALLS")
            else self._told_by.get(order.trigger)
        )
        if self.every:
            return "WRONG_STATE"
        if order.trigger != "NOW" and watched not in self._columns:  # of a machine without a mark: no pulse, no speed
            watched = None
        if not order.mask or order.mask & ~known or (watched is None and order.trigger in WATCHING):
            return "UNKNOWN_CHANNEL"
        if not order.divider or not 0 <= order.before < order.length or not np.isfinite(order.level):
            return "OUT_OF_RANGE"
        if order.trigger not in ("NOW", "RISES", "FALLS", "PULSE", "SPEED"):
            return "OUT_OF_RANGE"
        names = [name for index, name in self._by_index.items() if order.mask >> index & 1]
        if any(name not in self._columns for name in names):  # the rig file has it, this machine does not
            return "UNKNOWN_CHANNEL"
        layout = Layout.of(self._spec, names)
        if order.length * layout.sample.itemsize > self._spec.memory_bytes:
            return "TOO_LARGE"
        self._layout, self._watched = layout, self._columns.get(watched or "", 0)
        self.size = order.length * layout.sample.itemsize
        self.order, self.state, self.number = order, "ARMED", self.number + 1 & 0xFFFF
        self._clear()
        return "OK"

    def cancel(self) -> None:
        """Record nothing; what is recorded is gone."""
        self.state, self.size = "IDLE", 0
        self._clear()

    def take(self, tick: int, rows: Array) -> None:
        """Readings (n, channels) from a tick on, every `every` ticks."""
        if not len(rows) or not self.every:
            return
        chosen = [self._columns[name] for name in self._layout.channels]
        self._kept.append(rows[:, chosen])
        held, self.samples = self.samples, self.samples + len(rows)
        if self.state == "ARMED":
            at = self._found(rows[:, self._watched], held)
            self._last = rows[-1, self._watched]
            if at is None:
                self._keep_last(self.order.before)
                return
            self.state = "TRIGGERED"
            self.first_tick = tick + (at - held - self.order.before) * self.order.divider
            self._keep_last(self.samples - (at - self.order.before))
        if self.samples >= self.order.length:
            recorded = np.concatenate(self._kept)[: self.order.length]
            self.buffer = self._layout.encoded(list(recorded.T))
            self.crc, self.state, self.samples = zlib.crc32(self.buffer), "DONE", self.order.length
            self._kept = []

    def _keep_last(self, count: int) -> None:
        """Forget all but so many samples."""
        if self.samples > count:
            self._kept = [np.concatenate(self._kept)[self.samples - count :]]
            self.samples = count

    def _found(self, x: Array, held: int) -> int | None:
        """Where among what is held the trigger falls: not before the ring is full. `x` are the new readings of what is
        watched, `held` how many samples came before them."""
        order, before = self.order, np.concatenate([[self._last], x[:-1]])
        if order.trigger == "NOW":
            hit = np.ones(len(x), bool)
        elif order.trigger == "RISES":
            hit = (before < order.level) & (x >= order.level)
        elif order.trigger == "FALLS":
            hit = (before > order.level) & (x <= order.level)
        elif order.trigger == "PULSE":
            hit = np.isfinite(before) & (x != before)
        else:
            hit = (before != x) & ((before - order.level) * (x - order.level) <= 0)
        hit[: max(0, order.before - held)] = False
        return held + int(np.argmax(hit)) if hit.any() else None
