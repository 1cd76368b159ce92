"""What the facades of all machines share: the library that is opened, parameters as structs, the modes of the law, time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from cffi import FFI

from bench.errors import ConfigError
from sim_backend.core.build import library

Array = npt.NDArray[np.float64]

TICK_S: Final = 1e-4
PERIOD_TICKS: Final = 10
OFF, READY, LIFT, LEVITATE, LAND = range(5)
TRIPS: Final = {1: "LEVITATION_LOST", 2: "OVERCURRENT", 4: "OVERSPEED"}
COMMON: Final = Path(__file__).with_name("core.h")


def open_core(header: Path) -> tuple[FFI, Any]:
    """The core with what it declares in common and in a machine's `header`, between the marks.

    Raises:
        ConfigError: it is not there and cannot be built, or the system does not load it.
    """
    ffi = FFI()
    for path in (COMMON, header):
        text = path.read_text(encoding="utf-8")
        ffi.cdef(text.split("/* declarations begin */")[1].split("/* declarations end */")[0])
    built = library()
    try:
        return ffi, ffi.dlopen(str(built))
    except OSError as error:  # of another platform, or on a file system that nothing is executed from
        raise ConfigError(
            f"the simulator's core cannot be loaded: {error}; expected a library for this machine. Next: remove {built}, "
            "or name a cache folder in XDG_CACHE_HOME that code is executed from"
        ) from error


def fill(struct: Any, values: Mapping[str, Any]) -> None:
    """Put numbers and tuples of numbers into the fields of a struct."""
    for name, value in values.items():
        if isinstance(value, tuple):
            getattr(struct, name)[0 : len(value)] = list(value)
        else:
            setattr(struct, name, value)


@dataclass(frozen=True, slots=True)
class DriveLaw:
    """An external speed-controlled drive on the shaft: torque = gain * (speed - shaft's speed), at most `limit`.

    `gain` N m s/rad, `limit` N m, `ramp` rad/s^2: how fast the speed goes to its target.
    """

    gain: float
    limit: float
    ramp: float


class CorePlant:
    """What every machine's plant is, around its structs: parameters `_p`, the law's parameters `_c`, state `_s`."""

    settable: ClassVar[frozenset[str]]  # the law's parameters
    tick_s: float = TICK_S  # from control tick to control tick
    period_ticks: int = PERIOD_TICKS  # of a telemetry period
    _p: Any
    _c: Any
    _s: Any

    @property
    def tick(self) -> int:
        """Control ticks since the start."""
        return int(self._s.tick)

    @property
    def mode(self) -> int:
        """OFF, READY, LIFT, LEVITATE or LAND; the law follows it from the next tick on."""
        return int(self._s.law.mode)

    @mode.setter
    def mode(self, mode: int) -> None:
        law = self._s.law
        # A lift that is broken off is landed from where it stands, and the other way round: the smooth step is its own
        # mirror image.
        broken_off = (law.mode, mode) in ((LIFT, LAND), (LAND, LIFT))
        if law.mode == OFF or (mode == LIFT and not broken_off):
            law.fresh = 1
        law.lift_clock = self._c.lift_time_s - law.lift_clock if broken_off else 0
        law.mode = mode

    @property
    def moved(self) -> bool:
        """Whether the lift or landing has run its course."""
        return bool(self._s.law.lift_clock >= self._c.lift_time_s)

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the law by its name, SI.

        Raises:
            KeyError: the law has no such parameter.
        """
        if name not in self.settable:
            raise KeyError(name)
        setattr(self._c, name, value)

    def get(self, name: str) -> float:
        """A parameter of the law, SI.

        Raises:
            KeyError: the law has no such parameter.
        """
        if name not in self.settable:
            raise KeyError(name)
        return float(getattr(self._c, name))

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None:
        """Let an external drive turn the shaft to a speed from the next tick on; None: it gives no torque. A drive that
        is switched on takes over at the speed that the shaft has."""
        s = self._s
        if law is None:
            s.drive_gain = 0.0
            return
        if s.drive_gain == 0:
            s.drive_speed = self.shaft_speed
        s.drive_gain, s.drive_limit, s.drive_ramp, s.drive_target = law.gain, law.limit, law.ramp, target_rad_s

    @property
    def shaft_speed(self) -> float:
        """True speed of the shaft, rad/s: in every machine's state the twelfth number."""
        return float(self._s.s[11])

    @property
    def drive_torque(self) -> float:
        """Torque of the external drive at the present, N m."""
        s = self._s
        return float(min(max(s.drive_gain * (s.drive_speed - self.shaft_speed), -s.drive_limit), s.drive_limit))

    @property
    def trips(self) -> int:
        """Latched trip bits (see TRIPS)."""
        return int(self._s.trips)

    def clear_trips(self) -> None:
        """Forget latched trips."""
        self._s.trips = self._s.lost_ticks = 0
