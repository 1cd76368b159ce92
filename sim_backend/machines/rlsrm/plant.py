"""The rotary-linear motor's core behind a typed facade: `run` is the only way time passes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_backend.core.plant import Array, fill, open_core
from sim_backend.machines.rlsrm.params import PHASES, ControlParams, Map, PlantParams

TICKS_S: Final = 20_000
LOOP_TICKS: Final = 20
AXES: Final = ("x", "angle")
TRACE: Final = (
    *AXES, *(f"true_{n}" for n in AXES), *(f"rate_{n}" for n in AXES), *(f"ref_{n}" for n in AXES),
    "asked_force", "asked_torque", "given_force", "given_torque", "force", "torque",
    *(f"i_{n}" for n in PHASES), *(f"u_{n}" for n in PHASES), *(f"wanted_{n}" for n in PHASES), "pair", "flags", "changes",
    "state", "fault", "heard",
)  # fmt: skip
"""Of one tick: readings, true places and rates, set points; what the loops ask, what the distribution gives by the controller's
map, what acts; currents, voltages of the tick before, references; pair as 6 a + b, flags, changes of the pair so far;
state, fault, how long ago the last heartbeat was, s, -1 while none is waited for."""
STATES: Final = ("OFF", "READY", "HOMING", "HOLDING", "MOVING", "STOPPING", "FAULT")
COMMANDS: Final = ("ready", "home", "hold", "play", "stop", "safe", "off", "clear", "let_go")
FAULTS: Final = ("NONE", "OVERCURRENT", "OVERSPEED", "STROKE", "OVERTEMPERATURE", "HEARTBEAT_LOST", "SENSOR")
LIMITED, NO_PAIR = 1, 2

_ffi, _lib = open_core(Path(__file__).with_name("rlsrm.h"))


class Plant:
    """The machine with its amplifiers and position loops.

    Args:
        params: the plant.
        control: the controller's parameters.
    """

    def __init__(self, params: PlantParams | None = None, control: ControlParams | None = None) -> None:
        self._p: Any = _ffi.new("rlsrm_params *")
        self._c: Any = _ffi.new("rlsrm_control *")
        self._s: Any = _ffi.new("rlsrm_state *")
        self.params = params or PlantParams()
        _fill(self._p, self.params)
        _fill(self._c, control or ControlParams())
        _lib.rlsrm_start(self._p, self._s)

    @property
    def tick(self) -> int:
        """Ticks of 50 us since the start."""
        return int(self._s.tick)

    def set(self, name: str, value: float, axis: str | None = None) -> None:
        """Set a parameter of the controller by its name, SI, of one axis where it has a number for each.

        Raises:
            AttributeError: there is no such parameter.
        """
        if axis is None:
            setattr(self._c, name, value)
        else:
            getattr(self._c, name)[AXES.index(axis)] = value

    def zero(self, amplifier: int, amperes: float) -> None:
        """What the loop of an amplifier takes off what its sensor reads."""
        self._c.current_zero[amplifier] = amperes

    def switch(self, *, on: bool | None = None, x: bool | None = None, angle: bool | None = None) -> None:
        """Switch the amplifiers and the position loops while it is OFF; a loop begins without integral and slope."""
        if on is not None:
            self._s.on = int(on)
        for k, closed in enumerate((x, angle)):
            if closed is not None:
                self._s.loop[k] = int(closed)
                self._s.integral[k] = self._s.slope[k] = 0.0
                self._s.fresh = 1

    def command(self, name: str) -> int:
        """Give the controller a command: 0 done, 1 not in this state, 2 the zeros are not known."""
        return int(_lib.rlsrm_command(self._c, self._s, COMMANDS.index(name)))

    def power_on(self) -> None:
        """The controller starts anew: OFF, and counters at zero wherever the mover stands."""
        _lib.rlsrm_power_on(self._p, self._s)

    def beat(self) -> None:
        """A heartbeat of the host."""
        self._s.heard = self._s.tick

    @property
    def state(self) -> str:
        """Of the controller."""
        return STATES[self._s.mode]

    @property
    def fault(self) -> str:
        """What tripped."""
        return FAULTS[self._s.fault]

    @property
    def homed(self) -> tuple[bool, bool]:
        """Whether the zeros along and around are known."""
        return bool(self._s.homed[0]), bool(self._s.homed[1])

    def drive(self, amperes: Array) -> None:
        """References of the six currents while no loop is closed."""
        self._s.manual[0:6] = [float(x) for x in amperes]

    def put(self, x: float | None = None, angle: float | None = None, x_rate: float | None = None,
            angle_rate: float | None = None) -> None:  # fmt: skip
        """Put the mover somewhere, for tests."""
        for into, values in ((self._s.q, (x, angle)), (self._s.v, (x_rate, angle_rate))):
            for k, value in enumerate(values):
                if value is not None:
                    into[k] = value

    def refer(self, x: float | None = None, angle: float | None = None) -> None:
        """Send set points somewhere: with the speed and rise that are set, or at once."""
        for k, value in enumerate((x, angle)):
            if value is not None:
                self._c.wave[k], self._c.offset[k], self._s.target[k] = 0.0, value, value

    def push(self, newtons: float = 0.0, newton_metres: float = 0.0) -> None:
        """What acts from outside from now on, along +x and +angle."""
        self._p.push[0:2] = [newtons, newton_metres]

    @property
    def place(self) -> Array:
        """True x, angle and their rates, (4,)."""
        return np.array([*self._s.q, *self._s.v])

    @property
    def currents(self) -> Array:
        """True currents of the six windings, A."""
        return np.array(list(self._s.i))

    @property
    def voltages(self) -> Array:
        """What the windings had over the last tick, V; with substeps over the last of them."""
        return np.array(list(self._s.u))

    @property
    def acting(self) -> Array:
        """True force and torque of all phases, N and N m."""
        return np.array(list(self._s.force))

    @property
    def means(self) -> Array:
        """Currents in the mean over the last millisecond as the six amplifiers read them, A."""
        p, mean = self.params, np.array(list(self._s.mean))
        led = mean[[int(k) for k in p.wired]]
        offset = np.where(np.array(list(self._s.wanted)) > 0, p.current_offset, 0.0)
        return np.asarray(np.array(p.current_gain) * led + offset)

    @property
    def warmth(self) -> Array:
        """Temperatures of the windings, degrees C."""
        return np.array(list(self._s.warm))

    @property
    def integrals(self) -> tuple[float, float]:
        """Of the position loops, N and N m."""
        return float(self._s.integral[0]), float(self._s.integral[1])

    @property
    def counts(self) -> tuple[int, int]:
        """Of the encoders, along and around."""
        return int(self._s.count[0]), int(self._s.count[1])

    def run(self, seconds: float, every: int = LOOP_TICKS) -> Array:
        """Advance; of every so many ticks a row, 0: none.

        Returns:
            (n, len(TRACE))
        """
        ticks = round(seconds * TICKS_S)
        rows = np.empty((ticks // every + 2 if every else 0, len(TRACE)))
        count = _lib.rlsrm_run(self._p, self._c, self._s, ticks, _ffi.cast("double *", rows.ctypes.data), every)
        return rows[:count]


def _fill(struct: Any, params: PlantParams | ControlParams) -> None:
    values = dict(vars(params))
    fill(struct.map, vars(values.pop("map")))
    fill(struct, values)


def ideal(params: PlantParams | None = None) -> PlantParams:
    """The plant with encoders that read what is."""
    return replace(params or PlantParams(), pitch=(0.0, 0.0))


def slopes(known: Map, x: float, angle: float) -> tuple[Array, Array, Array]:
    """G of six phases (6,), H, and its slopes along (H/m) and around (H/rad), for tests."""
    m = _ffi.new("rlsrm_map *")
    fill(m, vars(known))
    out = np.empty((3, 6))
    rows = [_ffi.cast("double *", row.ctypes.data) for row in out]
    _lib.rlsrm_slopes(m, _ffi.new("double[2]", [x, angle]), *rows)
    return out[0], out[1], out[2]


def distribute(control: ControlParams, x: float, angle: float, force: float, torque: float,
               pair: tuple[int, int] = (-1, -1)) -> tuple[Array, Array, tuple[int, int], int]:  # fmt: skip
    """One distribution by the controller's map: references of six currents, (force, torque) by it, the pair, flags."""
    c = _ffi.new("rlsrm_control *")
    _fill(c, control)
    _, along, around = slopes(control.map, x, angle)
    current, given, both = np.empty(6), np.empty(2), _ffi.new("int32_t[2]", list(pair))
    flags = _lib.rlsrm_distribute(
        c, _ffi.new("double[2]", [x, angle]), _ffi.cast("double *", along.ctypes.data),
        _ffi.cast("double *", around.ctypes.data), _ffi.new("double[2]", [force, torque]), both,
        _ffi.cast("double *", current.ctypes.data), _ffi.cast("double *", given.ctypes.data),
    )  # fmt: skip
    return current, given, (int(both[0]), int(both[1])), int(flags)


def rubbed(params: PlantParams, rates: Array, force: Array, seconds: float) -> Array:
    """Rates (x, angle) after a kick with friction, for tests."""
    p: Any = _ffi.new("rlsrm_params *")
    s: Any = _ffi.new("rlsrm_state *")
    _fill(p, params)
    s.v[0:2] = [float(x) for x in rates]
    _lib.rlsrm_rub_once(p, s, seconds, _ffi.new("double[2]", [float(x) for x in force]))
    return np.array(list(s.v))
