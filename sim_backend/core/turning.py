"""What the facades of machines share whose shaft has a once-per-turn mark, planes for weights and readings of single ticks."""

from __future__ import annotations

from typing import Any, Literal, overload

import numpy as np

from sim_backend.core.plant import Array, CorePlant


class TurningPlant(CorePlant):
    """A plant around its structs whose state has `tacho`, `weight_c`, `weight_s`, `loose` and `s`.

    Attributes:
        widths: numbers in a row of the telemetry, and in the readings of a tick.
    """

    widths: tuple[int, int]
    _ffi: Any
    _advance: Any  # the machine's own `run` of the library

    @property
    def turn_s(self) -> float | None:
        """The longer one of the last two times between pulses: one may be doubled. None before there are three pulses."""
        t = self._s.tacho
        return float(max(t.last - t.before, t.before - t.earlier)) if t.pulses >= 3 else None

    @property
    def phase(self) -> float:
        """Phase of the path at the last reading, rad, for tests."""
        return float(self._s.law.phase)

    def weights(self, plane: int, unbalance: float, angle: float) -> None:
        """Mount a weight in addition to what is there: the plane's number, mass times radius, kg m, its angle from the shaft's
        mark from y towards z, rad."""
        self._s.weight_c[plane] += unbalance * np.cos(angle)
        self._s.weight_s[plane] += unbalance * np.sin(angle)

    def without_weights(self, plane: int) -> None:
        """Take off every weight that has been mounted in a plane; what is mounted afterwards sits tight until it slips."""
        self._s.weight_c[plane] = self._s.weight_s[plane] = 0.0
        self._s.loose = 0

    def set_state(self, s: Array) -> None:
        """Put the shaft somewhere, for tests: (20,) positions and rates."""
        self._s.s[0:20] = [float(x) for x in s]

    @overload
    def run(self, ticks: int, trace: Literal[0] = 0) -> Array: ...
    @overload
    def run(self, ticks: int, trace: Literal[1, 2, 5, 10, 20, 50, 100]) -> tuple[Array, Array]: ...
    @overload
    def run(self, ticks: int, trace: int) -> Array | tuple[Array, Array]: ...
    def run(self, ticks: int, trace: int = 0) -> Array | tuple[Array, Array]:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, columns), one row per completed telemetry period; with `trace`, also the readings of every `trace`-th tick
            (tick a multiple of it), (k, readings).
        """
        start, period = self.tick, self.period_ticks
        limit = (ticks + period - 1) // period + 1
        rows = np.empty((limit, self.widths[0]))
        kept = np.empty((ticks // trace + 1 if trace else 0, self.widths[1]))
        at, into = (self._ffi.cast("double *", x.ctypes.data) for x in (rows, kept))
        self._advance(self._p, self._c, self._s, ticks, at, limit, into, trace)
        shown = self.shown(rows[: self.tick // period - start // period])
        return (shown, kept[: -(-self.tick // trace) - -(-start // trace)]) if trace else shown

    def shown(self, rows: Array) -> Array:
        """What is told of the rows."""
        return rows
