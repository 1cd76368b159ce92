"""The linear-rotary actuator's core behind a typed facade: `run` is the only way time passes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_backend.core.plant import Array, fill, open_core
from sim_backend.machines.lira.params import ControlParams, PlantParams

TICKS_S: Final = 280_000
POSITION_TICKS: Final = 8
AXES: Final = ("x1", "x2", "y1", "y2", "z", "angle")
SYSTEMS: Final = ("R1", "B1", "R2", "B2", "L")
STATES: Final = ("OFF", "IDLE", "CURRENT", "LIFT", "LEVITATED", "LANDING", "FAULT")
COMMANDS: Final = ("idle", "on", "lift", "land", "stop", "clear", "safe")
FAULTS: Final = ("NONE", "LEVITATION_LOST", "OVERCURRENT", "SUPPLY", "HEARTBEAT_LOST")
DQ: Final = tuple(f"{way}_{name}" for name in SYSTEMS for way in "dq")
PHASES: Final = range(1, 16)
MEASURED: Final = (
    *(f"i_f{k}" for k in PHASES), *(f"u_s{k}" for k in PHASES), *(f"i_s{k}" for k in PHASES), "u_dc", *AXES,
)  # fmt: skip
"""The firmware's 52 measurements: inductor currents, capacitor voltages, coil currents of the half-bridges, supply, places."""
TRACE: Final = (
    *AXES, *(f"true_{n}" for n in AXES), *(f"i_{n}" for n in DQ), *(f"u_{n}" for n in DQ), *(f"f_{n}" for n in DQ),
    *(f"wanted_{n}" for n in DQ), *(f"force_{n}" for n in AXES), *(f"rate_{n}" for n in AXES), "contact", "limited", "injected",
    "mode", "fault", "wave",
)  # fmt: skip
"""Of one tick: readings, true places of the sensors' targets; as the firmware has them dq coil currents, capacitor voltages,
inductor currents and references, the forces it wants, the rates it sees; what rings bear, limited loops, what is injected;
state and fault; the injected sine as a share of its amplitude."""
WHOLE: Final = (*TRACE, *MEASURED[:46], "heard", "held")
"""With the half-bridges' measurements and the supply, too, and how long ago the host's last heartbeat was, s; -1 while none is
waited for; 1 while the bearings' currents are held."""

_ffi, _lib = open_core(Path(__file__).with_name("lira.h"))


class Plant:
    """The machine with its firmware's loops.

    Args:
        params: the plant.
        seed: of all noise.
        control: the firmware's parameters.
        reduced: currents follow by a lag of second order and all goes at 35 kHz: for what current loops, wiring and electrical
            captures do not matter to.
        factors: planted: by parameter, what the firmware works with, of what it is told and tells.
        unfed: planted: currents are told without what is fed forward against cogging.
    """

    def __init__(self, params: PlantParams | None = None, seed: int = 0, *, control: ControlParams | None = None,
                 reduced: bool = False, factors: Mapping[str, float] | None = None,
                 unfed: bool = False) -> None:  # fmt: skip
        self.params = params or PlantParams()
        self._p: Any = _ffi.new("lira_params *")
        self._c: Any = _ffi.new("lira_control *")
        self._s: Any = _ffi.new("lira_state *")
        fill(self._p, vars(self.params))
        fill(self._c, vars(control or ControlParams()))
        self._factors = dict(factors or {})
        self._unfed = unfed
        for name, factor in self._factors.items():
            setattr(self._c, name, factor * getattr(self._c, name))
        _lib.lira_start(self._p, self._s, seed & (2**64 - 1))
        self._advance = _lib.lira_run_reduced if reduced else _lib.lira_run

    @property
    def tick(self) -> int:
        """Ticks of 1/280 000 s since the start."""
        return int(self._s.tick)

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the firmware by its name, SI.

        Raises:
            AttributeError: there is no such parameter.
        """
        setattr(self._c, name, value * self._factors.get(name, 1.0))

    def get(self, name: str) -> float:
        """A parameter of the firmware, SI.

        Raises:
            AttributeError: there is no such parameter.
        """
        return float(getattr(self._c, name)) / self._factors.get(name, 1.0)

    def switch(self, *, currents: bool | None = None, bearings: bool | None = None, axial: bool | None = None,
               angle: bool | None = None) -> None:  # fmt: skip
        """Switch the current loops, the radial loops, that of z and that of the angle."""
        for name, on in (("currents", currents), ("bearings", bearings), ("axial", axial), ("angle", angle)):
            if on is not None:
                setattr(self._s, f"{name}_on", int(on))

    def command(self, name: str) -> int:
        """Give the firmware a command: 0 done, 1 not in this state, 2 the mover stands too far off the middle to be lifted."""
        return int(_lib.lira_command(self._p, self._c, self._s, COMMANDS.index(name)))

    def power_on(self) -> None:
        """The firmware starts anew: OFF, without a fault, nothing added to a reference."""
        if self.command("clear"):
            self.command("stop")
        self._s.mode = STATES.index("OFF")
        self._c.inject_axis = -1.0
        for k in range(len(DQ)):
            self._s.manual[k] = 0.0

    def beat(self) -> None:
        """A heartbeat of the host."""
        self._s.heard = self._s.tick

    @property
    def state(self) -> str:
        """Of the firmware."""
        return STATES[self._s.mode]

    @property
    def fault(self) -> str:
        """What tripped."""
        return FAULTS[self._s.fault]

    def go(self, axis: str, target: float, speed: float = 0.0, rise: float = 0.0) -> None:
        """Send a set point to a target with a speed and an acceleration at most; without the latter by a step."""
        k = AXES.index(axis)
        self._s.target[k], self._s.speed[k], self._s.rise[k] = target, speed, rise

    def refer(self, axis: str, value: float, rate: float = 0.0) -> None:
        """Set point of a loop, m or rad, and its rate, at once; for tests of loops without the firmware's states."""
        k = AXES.index(axis)
        self._s.ref[k], self._s.ref_rate[k] = value, rate

    def set_point(self, axis: str) -> tuple[float, float]:
        """Where a set point is on its way, and its rate."""
        k = AXES.index(axis)
        return float(self._s.ref[k]), float(self._s.ref_rate[k])

    def step(self, name: str, amperes: float) -> None:
        """What is added to a dq reference, such as `d_R1`."""
        self._s.manual[DQ.index(name)] = amperes

    def hold(self, across: str, amperes: float, seconds: float) -> int:
        """Hold the bearings' currents for so long, those along `x` or `y` pushed by A: 0 done, 1 not in this state."""
        return int(_lib.lira_hold(self._c, self._s, "xy".index(across), amperes, seconds))

    @property
    def held(self) -> bool:
        """Whether the bearings' currents are held."""
        return bool(self._s.held)

    @property
    def hold_left_bound(self) -> bool:
        """Whether a reading that left the bound ended the last hold."""
        return bool(self._s.hold_ended)

    def put(self, **places: float) -> None:
        """Put the mover somewhere, for tests: x, y, alpha, beta, z, angle in m and rad, with rates `x_rate` and so on."""
        names = ("x", "y", "alpha", "beta", "z", "angle")
        for name, value in places.items():
            into = self._s.v if name.endswith("_rate") else self._s.q
            into[names.index(name.removesuffix("_rate"))] = value

    def push(self, newtons: Array) -> None:
        """Outer forces from now on: N at the planes (x1, x2, y1, y2), N along z, N m."""
        self._p.push[0:6] = [float(x) for x in newtons]

    def hang(self, kg: float, newtons: float, at: float) -> None:
        """A mass on the mover in place of what is on it: where, m from its centre of mass towards the first plane, and what it
        weighs there."""
        self._p.hung, self._p.hung_N, self._p.hung_at = kg, newtons, at

    def mount(self, kg: float, newtons: float, inertia: float, *, at: float = 0.0, off: float = 0.0, phase: float = 0.0,
              grip: float = math.inf) -> None:  # fmt: skip
        """A ring on the mover in place of what is on it: its mass, weight and inertia about its own axis; where, m from the
        mover's centre of mass towards the first plane; how far its middle is off the axis and in which phase, rad; the torque
        from which on it slips, N m."""
        p = self._p
        p.part, p.part_N, p.part_inertia, p.part_at, p.part_off, p.part_phase, p.part_grip = (
            kg, newtons, inertia, at, off, phase, grip)  # fmt: skip
        self._s.slip[0:3] = [0.0, 0.0, 0.0]

    @property
    def slip(self) -> float:
        """By what the ring has slipped since it was mounted, rad."""
        return float(self._s.slip[0])

    @property
    def link_V(self) -> float:
        """Of the DC link."""
        return float(self._s.link)

    @property
    def place(self) -> Array:
        """True x, y, alpha, beta, z, angle and their rates, (12,)."""
        return np.array([*self._s.q, *self._s.v])

    @property
    def electric(self) -> Array:
        """True inductor currents, capacitor and damper voltages, coil currents of the half-bridges, (4, 15)."""
        s = self._s
        return np.array([list(s.bridge), list(s.u), list(s.damper), list(s.coil)])

    @property
    def sent(self) -> Array:
        """What the half-bridges give now, V from the middle of the DC link, (15,)."""
        return np.array(list(self._s.sent))

    def run(self, seconds: float, every: int = POSITION_TICKS, *, whole: bool = False) -> Array:
        """Advance; of every so many ticks a row.

        Returns:
            (n, len(TRACE)), or (n, len(WHOLE)).
        """
        ticks = round(seconds * TICKS_S)
        rows = np.empty((ticks // every + 2 if every else 0, len(WHOLE if whole else TRACE)))
        count = self._advance(self._p, self._c, self._s, ticks, _ffi.cast("double *", rows.ctypes.data), every, whole)
        if self._unfed:
            self._leave_out(rows[:count])
        return rows[:count]

    def _leave_out(self, rows: Array) -> None:
        """Take what is fed forward against cogging off the currents that are told, as a reading of the loops' own would be."""
        z, angle, along, *around = (TRACE.index(name) for name in ("z", "angle", "i_q_L", "i_q_R1", "i_q_R2"))
        c = self._c
        rows[:, along] -= c.model_cogging_force / c.model_force * np.sin(4 * np.pi / c.model_pitch * rows[:, z])
        for k in around:
            rows[:, k] -= c.model_cogging_torque / (2 * c.model_torque) * np.sin(48 * rows[:, angle])


def ideal(params: PlantParams | None = None) -> PlantParams:
    """The plant with sensors that tell what is: no noise, rounding, lag or ripple."""
    p = params or PlantParams()
    return replace(p, **p.ideal())  # type: ignore[arg-type]


def coils(dq: Array, phase: float) -> Array:
    """Currents of six coils (6,) of (d, q) of R and of B, L (1) as corrected, for tests."""
    out, given = _ffi.new("double[6]"), _ffi.new("double[4]", [float(x) for x in dq])
    _lib.lira_coils(given, np.cos(phase), np.sin(phase), out)
    return np.array(list(out))
