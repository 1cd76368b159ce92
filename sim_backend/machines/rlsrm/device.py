"""The rotary-linear motor as its simulated controller has it: parameters by the rig file's names, time in ticks of the
amplifiers that are counted so that a reading of the loops ends a tick before a telemetry period does, readings with their
sensors' errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, cast, overload

import numpy as np

from sim_backend.core.plant import Array, DriveLaw
from sim_backend.machines.rlsrm.params import PHASES, ControlParams, Each, Pair, PlantParams
from sim_backend.machines.rlsrm.plant import AXES, FAULTS, LOOP_TICKS, STATES, TICKS_S
from sim_backend.machines.rlsrm.served import READINGS, ROW, Served

SHIFT: Final = LOOP_TICKS - 1
CHANNELS: Final = ROW[: ROW.index("state")]
TOLD: Final = len(PHASES)
KELVIN: Final = 273.15
OF_AXES: Final = {
    "kp": "kp", "ki": "ki", "kd": "kd", "hz": "cut", "limit": "limit",
}  # fmt: skip
OF_SET_POINTS: Final = {
    "rate": "speed", "rise": "rise", "wave": "wave", "amplitude": "amplitude", "period": "period", "phase": "phase",
}  # fmt: skip
OF_ALL: Final = {
    "integrators_wait": "wait", "rule": "rule", "hysteresis": "hysteresis", "priority": "priority",
    "current_limit": "current_max", "open_phase": "test_phase", "open_current": "test_current", "safe_holds": "safe_holds",
}  # fmt: skip
OF_MAP: Final = ("slope", "unaligned", "c2", "c3", "length", "overlap", "fringe", "leakage", "saturation", "centre")
CURRENT_ZERO: Final = "current_zero_"
SETTABLE: Final = frozenset((
    *OF_ALL, "pulse_s", *(f"{axis}_target" for axis in AXES),
    *(f"{name}_{axis}" for name in OF_AXES for axis in AXES),
    *(f"{axis}_{name}" for name in OF_SET_POINTS for axis in AXES),
    *(f"{CURRENT_ZERO}{k}" for k in range(1, 7)),
    *(f"map_{name}" for name in OF_MAP), "map_zero_1", "map_zero_2", *(f"map_gain_{k}" for k in range(1, 7)),
))  # fmt: skip
"""What can be set, by the rig file's names."""


@dataclass(frozen=True)
class Sensed:
    """What sensors make of currents and voltages, by amplifier, and what the mover carries from outside.

    `told`: factors on what is told of a current, beside what its loop reads; `cold`: temperatures are told as at the start.
    """

    current_gain: Each = (1.0,) * 6
    current_offset: Each = (0.0,) * 6
    voltage_gain: Each = (1.0,) * 6
    voltage_offset: Each = (0.0,) * 6
    current_noise: float = 0.0
    voltage_noise: float = 0.0
    told: Each = (1.0,) * 6
    cold: float = 0.0


@dataclass(frozen=True)
class Built:
    """A rotary-linear motor: its plant, its controller as it is made, its sensors, and where its mover was left, m and rad."""

    plant: PlantParams
    control: ControlParams
    sensed: Sensed = Sensed()
    rest: Pair = (0.0, 0.0)


class StagePlant:
    """`sim_backend.machine.SimulatedPlant` of the rotary-linear motor.

    Args:
        built: the machine.
        seed: of all noise.
    """

    tick_s: float = 1 / TICKS_S
    period_ticks: int = LOOP_TICKS
    moved, drive_torque = True, 0.0
    pulse_age_s = turn_s = None

    def __init__(self, built: Built, seed: int = 0) -> None:
        self.built, self.mode = built, 0
        self.core = Served(built.plant, built.control)
        self.core.put(*built.rest)
        self._chosen = int(built.control.test_phase)
        self._means, self._instants = (np.random.default_rng([seed & (2**64 - 1), k]) for k in (1, 2))

    @property
    def tick(self) -> int:
        """Ticks since the start, as its telemetry counts them."""
        return self.core.tick + SHIFT

    @property
    def speed(self) -> float:
        """rad/s, as the controller sees it."""
        return self.core.rates[1]

    @property
    def shaft_speed(self) -> float:
        """The true one."""
        return float(self.core.place[3])

    @property
    def trips(self) -> int:
        """It latches its faults itself."""
        return 0

    def clear_trips(self) -> None:
        """It has none but its own faults."""

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None:
        """Nothing turns it but itself."""

    def hear(self, tick: int) -> None:
        """When the host's last heartbeat came, while one is waited for."""
        if self.core.heard >= 0:
            self.core.heard = max(tick - SHIFT, 0)

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the controller, SI.

        Raises:
            KeyError: it has no such parameter.
        """
        if name == "lift_time_s":  # which every controller has that lifts
            return
        if name not in SETTABLE:
            raise KeyError(name)
        if name == "pulse_s":
            self.core.pulse(self._chosen, value)
        elif name.startswith(CURRENT_ZERO):
            self.core.zero(int(name.removeprefix(CURRENT_ZERO)) - 1, value)
        elif name.startswith("map_"):
            self.core.know(name.removeprefix("map_"), value)
        elif name.endswith("_target"):
            self.core.send(AXES.index(name.removesuffix("_target")), value)
        elif name in OF_ALL:
            self._chosen = int(value) if name == "open_phase" else self._chosen
            self.core.set(OF_ALL[name], value)
        else:
            field, axis = _of_axis(name)
            self.core.set(field, value, AXES[axis])

    @overload
    def run(self, ticks: int, trace: Literal[0] = 0) -> Array: ...
    @overload
    def run(self, ticks: int, trace: int) -> Any: ...
    def run(self, ticks: int, trace: int = 0) -> Any:
        """Advance by so many ticks.

        Returns:
            (n, len(ROW)), a row for each period that ends; with `trace`, also the readings of every so many ticks,
            (k, len(READINGS)).
        """
        rows, readings = self.core.serve(ticks, trace, SHIFT)
        self._sense_rows(rows)
        if not trace:
            return rows
        self._sense_readings(readings)
        return rows, readings

    def _sense_rows(self, rows: Array) -> None:
        s, at = self.built.sensed, ROW.index("i_a1")
        noise = s.current_noise / LOOP_TICKS**0.5 * self._means.standard_normal((len(rows), TOLD))
        currents = rows[:, at : at + TOLD]
        currents[:] = np.array(s.told) * (np.array(s.current_gain) * currents + s.current_offset + noise)
        temperatures = rows[:, ROW.index("temp_1") : ROW.index("temp_2") + 1]
        temperatures += KELVIN
        if s.cold:
            temperatures[:] = self.built.plant.ambient + KELVIN

    def _sense_readings(self, readings: Array) -> None:
        s, at = self.built.sensed, READINGS.index("i_a1")
        noise = self._instants.standard_normal((len(readings), 2 * TOLD))
        currents, voltages = readings[:, at : at + TOLD], readings[:, at + TOLD : at + 2 * TOLD]
        seen = np.array(s.current_gain) * currents + s.current_offset + s.current_noise * noise[:, :TOLD]
        currents[:] = np.array(s.told) * seen
        voltages[:] = np.array(s.voltage_gain) * voltages + s.voltage_offset + s.voltage_noise * noise[:, TOLD:]


def control_of(settings: Mapping[str, float]) -> ControlParams:
    """The controller with parameters by the rig file's names, for truths that run it by themselves; set points and pulses are
    no part of it."""
    control: Any = ControlParams()
    for name, value in settings.items():
        if name.startswith(CURRENT_ZERO):
            zeros = list(control.current_zero)
            zeros[int(name.removeprefix(CURRENT_ZERO)) - 1] = value
            control = replace(control, current_zero=tuple(zeros))
        elif name.startswith("map_"):
            control = replace(control, map=_mapped(control.map, name.removeprefix("map_"), value))
        elif name in OF_ALL:
            control = replace(control, **{OF_ALL[name]: value})
        elif name == "watchdog_s":
            control = replace(control, watchdog_s=value)
        elif name in SETTABLE and name != "pulse_s" and not name.endswith("_target"):
            field, axis = _of_axis(name)
            pair = list(getattr(control, field))
            pair[axis] = value
            control = replace(control, **{field: tuple(pair)})
    return cast(ControlParams, control)


def _mapped(known: Any, name: str, value: float) -> Any:
    first, _, last = name.partition("_")
    if not last:
        return replace(known, **{name: value})
    several = list(getattr(known, first))
    several[int(last) - 1] = value
    return replace(known, **{first: tuple(several)})


def _of_axis(name: str) -> tuple[str, int]:
    """Field of the controller and number of the axis."""
    first, _, last = name.partition("_")
    return (OF_SET_POINTS[last], AXES.index(first)) if first in AXES else (OF_AXES[first], AXES.index(last))


def named(row: Array) -> tuple[str, str]:
    """State and fault of a row."""
    return STATES[int(row[-2])], FAULTS[int(row[-1])]
