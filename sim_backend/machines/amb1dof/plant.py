"""The one-axis AMB's core behind a typed facade: `Plant.run` is the only way time passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Literal, overload

import numpy as np

from sim_backend.core.plant import PERIOD_TICKS, TICK_S, Array, CorePlant, DriveLaw, fill, open_core
from sim_backend.machines.amb1dof.params import ControlParams, PlantParams
from sim_backend.machines.amb1dof.weights import table

READINGS: Final = ("position", "i_p", "i_n", "velocity", "load", "harmonic", "inject")
CHANNELS: Final = (*READINGS, "flags")
"""Of a telemetry period: means, and the flags of any of its ticks."""
TRACE: Final = (*READINGS, "true_velocity")
"""Of one tick."""
EXACT: Final = 2
OF_WEIGHTS: Final = frozenset(("rule", "degree", "window_s", "single_window_s", "single_reset_s"))

_ffi, _lib = open_core(Path(__file__).with_name("amb1dof.h"))


class Plant(CorePlant):
    """The machine with its controller's law; it does not turn.

    Args:
        params: the plant.
        seed: of all noise.
        control: initial values of the law's parameters.
    """

    settable = frozenset(ControlParams.__dataclass_fields__)
    speed = shaft_speed = drive_torque = 0.0
    pulse_age_s = turn_s = None

    def __init__(
        self, params: PlantParams | None = None, seed: int = 0, *, control: ControlParams | None = None
    ) -> None:
        self.params = params or PlantParams()
        self._p: Any = _ffi.new("amb1_params *")
        self._c: Any = _ffi.new("amb1_control *")
        self._s: Any = _ffi.new("amb1_state *")
        self._t: Any = _ffi.new("amb1_table [2]")
        fill(self._p, vars(self.params))
        fill(self._c, vars(control or ControlParams()))
        _lib.amb1_start(self._p, self._s, seed & (2**64 - 1))
        self._weigh()

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the law by its name, SI."""
        super().set(name, value)
        if name in OF_WEIGHTS:
            self._weigh()

    def _weigh(self) -> None:
        """The firmware's tables of weights, where its rule needs them."""
        c = self._c
        if c.rule != EXACT:
            return
        spacing, single, reset = (round(s / TICK_S) for s in (c.window_s, c.single_window_s, c.single_reset_s))
        self._kept: list[Array] = []  # the core has their addresses
        for at, first, last in ((0, spacing, 2 * spacing - 1), (1, single, max(reset - 1, single))):
            weights = table(int(c.degree), first, last, TICK_S)
            self._kept.append(weights)
            self._t[at].weights = _ffi.cast("double *", weights.ctypes.data)
            self._t[at].first, self._t[at].last = first, last

    def watch(self, y: Array) -> Array:
        """What the watched estimator makes of positions (n,) m from its start on, (n,) m/s; the machine stays as it is."""
        given, out = np.ascontiguousarray(y, np.float64), np.empty(len(y))
        at, into = (_ffi.cast("double *", x.ctypes.data) for x in (given, out))
        _lib.amb1_watch(self._p, self._c, self._t, at, len(given), into)
        return out

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None:
        """Nothing turns it."""

    def load(self, newtons: float, over_s: float = 0.0) -> None:
        """Hang a force on it in place of what hangs, given over evenly in so many s, from the next tick on."""
        s = self._s
        share = min(max(s.load_clock / s.load_time, 0.0), 1.0) if s.load_time > 0 else 1.0
        s.load_from += share * (s.load_to - s.load_from)
        s.load_to, s.load_clock, s.load_time = newtons, 0.0, over_s

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents in A, the coil that pulls to the positive side first."""
        return tuple(self._s.coil)

    def put(self, y: float, v: float = 0.0) -> None:
        """Put the body somewhere, for tests: m, m/s."""
        self._s.y, self._s.v = y, v

    @property
    def state(self) -> tuple[float, float]:
        """True position and velocity, for tests."""
        return float(self._s.y), float(self._s.v)

    @overload
    def run(self, ticks: int, trace: Literal[0] = 0) -> Array: ...
    @overload
    def run(self, ticks: int, trace: Literal[1, 2, 5, 10, 20, 50, 100]) -> tuple[Array, Array]: ...
    @overload
    def run(self, ticks: int, trace: int) -> Array | tuple[Array, Array]: ...
    def run(self, ticks: int, trace: int = 0) -> Array | tuple[Array, Array]:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, len(CHANNELS)) float64, one row per completed telemetry period of ten ticks; with `trace`, also the readings of
            every `trace`-th tick, (k, len(TRACE)).
        """
        start = self.tick
        limit = (ticks + PERIOD_TICKS - 1) // PERIOD_TICKS + 1
        rows = np.empty((limit, len(CHANNELS)))
        kept = np.empty((ticks // trace + 1 if trace else 0, len(TRACE)))
        at, into = (_ffi.cast("double *", x.ctypes.data) for x in (rows, kept))
        _lib.amb1_run(self._p, self._c, self._t, self._s, ticks, at, limit, into, trace)
        rows = rows[: self.tick // PERIOD_TICKS - start // PERIOD_TICKS]
        return (rows, kept[: -(-self.tick // trace) - -(-start // trace)]) if trace else rows


def ccs(force: float, beta: float, gap: float, y: float, bias: float) -> float:
    """Control current A of a force N by T (2.25), branch-free, for tests."""
    return float(_lib.amb1_ccs(force, beta, gap, y, bias))


def gains(control: ControlParams) -> tuple[Array, Array]:
    """Gains of the reduced (3,) and of the full (5,) observer, by their poles, for tests."""
    c, h, g = _ffi.new("amb1_control *"), _ffi.new("double[3]"), _ffi.new("double[5]")
    fill(c, vars(control))
    _lib.amb1_gains(c, h, g)
    return np.array(list(h)), np.array(list(g))
