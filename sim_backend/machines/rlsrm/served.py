"""The rotary-linear motor's core as its simulated controller and who works on it need it."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import PHASES
from sim_backend.machines.rlsrm.plant import AXES, FAULTS, LOOP_TICKS, TICKS_S, Plant, _ffi, _lib

ROW: Final = (
    *AXES, "x_ref", "angle_ref", "force_asked", "torque_asked", "force_given", "torque_given", "v", "speed",
    *(f"i_{n.lower()}" for n in PHASES), "temp_1", "temp_2", "pair", "flags", "state", "fault",
)  # fmt: skip
"""What the controller tells of a reading; currents are means over the period before it, without their sensors' errors."""
READINGS: Final = (
    *AXES, *(f"i_{n.lower()}" for n in PHASES), *(f"u_{n.lower()}" for n in PHASES), "force_asked", "torque_asked",
)  # fmt: skip
"""What it can record of a tick: readings of the loops, currents at the instant, voltages over the tick before."""


class Served(Plant):
    """Heard from a host, hung with weights, clamped; telemetry and captures."""

    @property
    def heard(self) -> int:
        """Tick of the last heartbeat; -1 while none is waited for."""
        return int(self._s.heard)

    @heard.setter
    def heard(self, tick: int) -> None:
        self._s.heard = tick

    def fail(self, fault: str) -> None:
        """Trip by one of FAULTS that the core does not see by itself."""
        _lib.rlsrm_fail(self._s, FAULTS.index(fault))

    def pulse(self, phase: int, seconds: float) -> None:
        """In READY, the whole supply on the phase that is tested, until the current's limit; held till its time is over."""
        if self.state == "READY" and 0 <= phase < len(PHASES):
            self._s.pulse_phase, self._s.pulse_left = phase, round(seconds * TICKS_S)

    def send(self, axis: int, target: float) -> None:
        """Where an axis goes to while it is held or moves."""
        if self.state in ("HOLDING", "MOVING"):
            self._s.target[axis] = target

    def know(self, name: str, value: float) -> None:
        """Set a number of the controller's own map; of several, `zero_1`, `gain_6` and the like."""
        known, (first, _, last) = self._c.map, name.partition("_")
        if last:
            getattr(known, first)[int(last) - 1] = value
        else:
            setattr(known, name, value)

    @property
    def rates(self) -> tuple[float, float]:
        """As the controller reads them, through the loops' filters."""
        return float(self._s.rate_slow[0]), float(self._s.rate_slow[1])

    def clamp(self, x: bool, angle: bool) -> None:
        """Clamp axes where they are; the others are free."""
        self._p.locked[0:2] = [float(x), float(angle)]

    def carry(self, stiffness: tuple[float, float], damping: tuple[float, float]) -> None:
        """Hold it by load cells where it is, N/m and N m/rad, N s/m and N m s/rad; 0: by none."""
        self._p.cell_stiffness[0:2], self._p.cell_damping[0:2] = list(stiffness), list(damping)
        self._s.cell_at[0:2] = self._s.cell_now[0:2] = list(self._s.q)
        self._s.cell_stage = 0

    @property
    def carries(self) -> bool:
        """Whether load cells hold it."""
        return bool(self._p.cell_stiffness[0] > 0)

    def wind(self, side: int) -> float:
        """Take the load cells past their place on a side and back; how long that takes, s."""
        self._s.cell_side, self._s.cell_stage = side, 1
        along, around = (self._p.cell_past[k] / self._p.cell_rate[k] for k in range(2))
        return float(max(along, around) + along + around)

    @property
    def carried(self) -> tuple[float, float]:
        """With what it presses on the load cells that hold it, N and N m, along +x and +angle."""
        s, p = self._s, self._p
        each = [p.cell_stiffness[k] * (s.q[k] - s.cell_now[k]) + p.cell_damping[k] * s.v[k] for k in range(2)]
        return float(each[0]), float(each[1])

    def weigh(self, mass: float, inertia: float) -> None:
        """Of the mover, kg and kg m2, with what is mounted on it."""
        self._p.mass, self._p.inertia = mass, inertia

    def hang(
        self, force: tuple[float, float], added: tuple[float, float], rub: tuple[float, float], over_s: float
    ) -> None:
        """Weights that are let go in so many s, N and N m; what moves with them, kg and kg m2; what their pulleys rub with."""
        change = [abs(a - b) for a, b in zip(force, self._s.hanging, strict=True)]
        self._p.hung[0:2], self._p.hung_rate[0:2] = list(force), [c / over_s for c in change]
        self._p.added[0:2] = list(added)
        self._p.brake[0:2] = [a + b for a, b in zip(self.params.brake, rub, strict=True)]

    @property
    def hanging(self) -> tuple[float, float]:
        """What hangs on it at present, N and N m."""
        return float(self._s.hanging[0]), float(self._s.hanging[1])

    @property
    def moving(self) -> tuple[float, float]:
        """Mass and inertia of all that moves, kg and kg m2."""
        return self._p.mass + self._p.added[0], self._p.inertia + self._p.added[1]

    @property
    def rubbing(self) -> tuple[float, float]:
        """Friction of each axis by itself, beside the bearing's, N and N m."""
        return float(self._p.brake[0]), float(self._p.brake[1])

    def serve(self, ticks: int, every: int = 0, shift: int = 0) -> tuple[Array, Array]:
        """Advance as `run`, by ticks.

        Returns:
            (n, len(ROW)), a row of each reading of the loops; (k, len(READINGS)) of every so many ticks counted from -`shift`.
        """
        start, end = self.tick, self.tick + ticks
        rows = np.empty((-(-end // LOOP_TICKS) - -(-start // LOOP_TICKS), len(ROW)))
        count = -(-(end + shift) // every) - -(-(start + shift) // every) if every else 0
        kept = np.empty((count, len(READINGS)))
        at, into = (_ffi.cast("double *", x.ctypes.data) for x in (rows, kept))
        _lib.rlsrm_serve(self._p, self._c, self._s, ticks, at, into, every, shift)
        return rows, kept
