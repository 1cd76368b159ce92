"""The one-axis machine's core behind a typed facade: `Plant.run` is the only way time passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_backend.core.plant import PERIOD_TICKS, Array, CorePlant, DriveLaw, fill, open_core
from sim_backend.machines.oneaxis.params import ControlParams, PlantParams

CHANNELS: Final = ("pos_y", "i_y_p", "i_y_n", "flags")
_ffi, _lib = open_core(Path(__file__).with_name("oneaxis.h"))


class Plant(CorePlant):
    """The machine with its controller's law; it does not turn.

    Args:
        params: the plant.
        seed: of all noise.
        substeps: integration steps per control tick.
    """

    settable = frozenset(ControlParams.__dataclass_fields__)
    speed = shaft_speed = drive_torque = 0.0
    pulse_age_s = turn_s = None

    def __init__(self, params: PlantParams, seed: int = 0, *, substeps: int = 2) -> None:
        self._p: Any = _ffi.new("oneaxis_params *")
        self._c: Any = _ffi.new("oneaxis_control *")
        state: Any = _ffi.new("oneaxis_state *")
        state.substeps = substeps
        self._s: Any = state
        fill(self._p, vars(params))
        fill(self._c, vars(ControlParams()))
        _lib.oneaxis_start(self._p, self._s, seed & (2**64 - 1))

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None:
        """Nothing turns it."""

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents in A, upper coil first."""
        return tuple(self._s.coil)

    def run(self, ticks: int) -> Array:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, len(CHANNELS)) float64, one row per completed telemetry period of ten ticks.
        """
        limit = (ticks + PERIOD_TICKS - 1) // PERIOD_TICKS + 1
        rows = np.empty((limit, len(CHANNELS)))
        done = _lib.oneaxis_run(self._p, self._c, self._s, ticks, _ffi.from_buffer("double[]", rows.data), limit)
        return rows[: self.tick // PERIOD_TICKS - (self.tick - done) // PERIOD_TICKS]
