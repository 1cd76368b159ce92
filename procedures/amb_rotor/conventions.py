"""What an AMB rotor's stand calls its things: axes, planes, channels, the bits of its flags, its laws and parameters.

A procedure asks for them once, `machine = conventions(rig)`, and hands them on; only what is declared before there is a rig
(quantities by axis, requirements, defaults of plans) takes the one machine there is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from functools import reduce
from operator import or_
from typing import Literal

from bench.rigfile import RigFile

Law = Literal["PID", "CCS", "CAC"]
Variant = Literal["off", "corrected", "literal"]


class Flag(IntFlag):
    """Bits of the telemetry signal `flags`, as rigs/amb5dof.dbc has them."""

    CURRENT_LIMIT = 1
    VOLTAGE_LIMIT = 2
    CONTACT_INBOARD = 4
    CONTACT_OUTBOARD = 8
    WATCHDOG_ARMED = 16
    CONTACT_AXIAL = 32
    SENSOR_RANGE = 64


@dataclass(frozen=True)
class AmbRotor:
    """The names of one machine.

    `axes` are the four radial ones, in the order of every array of four, `axial` is the fifth. `planes` has by name where their
    y and z stand among the axes; `rings` has by plane the flag of a touch there, `axial_stop` is that of the axial one.

    Of the controller: `law` is the parameter that chooses among `laws`, by name the value it takes; `set_points` are the
    parameters by coordinate; `variants` the parameters that set how disturbances are compensated, with the estimator's `poles`;
    `stands_s` is how long after the last pulse it knows that the shaft stands, s.
    """

    axes: tuple[str, str, str, str]
    axial: str
    planes: Mapping[str, tuple[int, int]]
    rings: Mapping[str, Flag]
    axial_stop: Flag
    current_limit: Flag
    voltage_limit: Flag
    sensor_range: Flag
    law: str
    laws: Mapping[Law, float]
    set_points: Mapping[str, str]
    observer: str
    compensate: str
    integral: str
    variants: Mapping[Variant, Mapping[str, float]]
    poles: Mapping[str, float]
    stands_s: float

    @property
    def contact(self) -> Flag:
        """A touch anywhere."""
        return reduce(or_, self.rings.values(), self.axial_stop)

    @property
    def all_axes(self) -> tuple[str, ...]:
        """The radial ones, then the axial one."""
        return (*self.axes, self.axial)

    @property
    def positions(self) -> tuple[str, ...]:
        """Channels of the radial position sensors."""
        return tuple(map(self.position, self.axes))

    @property
    def all_positions(self) -> tuple[str, ...]:
        """Those of all axes."""
        return tuple(map(self.position, self.all_axes))

    @property
    def coils(self) -> tuple[str, ...]:
        """Of the radial axes, in each the one that pulls to the positive side first."""
        return tuple(f"{axis}_{side}" for axis in self.axes for side in "pn")

    @property
    def currents(self) -> tuple[str, ...]:
        """Channels of the radial coils' current sensors."""
        return tuple(f"i_{coil}" for coil in self.coils)

    @property
    def all_currents(self) -> tuple[str, ...]:
        """Those of all axes."""
        return tuple(name for axis in self.all_axes for name in self.pair(axis))

    @property
    def voltages(self) -> tuple[str, ...]:
        """Channels of the radial coils' voltages."""
        return tuple(f"u_{coil}" for coil in self.coils)

    @property
    def model_parameters(self) -> tuple[str, ...]:
        """What the controller knows of the radial bearings: force constants, then magnetic offsets."""
        return (*map(self.model_beta, self.axes), *map(self.model_offset, self.axes))

    @property
    def lifting(self) -> dict[str, float]:
        """The PID, which needs no model, with nothing compensated."""
        return {**self.select("PID"), self.observer: 0.0, self.compensate: 0.0}

    def select(self, law: Law) -> dict[str, float]:
        """The parameter that selects a law."""
        return {self.law: self.laws[law]}

    def along(self, direction: str) -> tuple[str, ...]:
        """The axes along y, z (inboard, outboard) or x."""
        return tuple(axis for axis in self.all_axes if axis[0] == direction)

    def position(self, axis: str) -> str:
        """Channel of an axis' position sensor."""
        return f"pos_{axis}"

    def pair(self, axis: str) -> tuple[str, str]:
        """Channels of the currents that pull an axis to its positive and to its negative side."""
        return f"i_{axis}_p", f"i_{axis}_n"

    def model_beta(self, axis: str) -> str:
        """The parameter with the controller's force constant of an axis, N m^2/A^2."""
        return f"model_beta_{axis}"

    def model_offset(self, axis: str) -> str:
        """The parameter with the controller's magnetic offset of an axis, m."""
        return f"model_offset_{axis}"


AMB_ROTOR = AmbRotor(
    axes=("yi", "zi", "yo", "zo"),
    axial="x",
    planes={"inboard": (0, 1), "outboard": (2, 3)},
    rings={"inboard": Flag.CONTACT_INBOARD, "outboard": Flag.CONTACT_OUTBOARD},
    axial_stop=Flag.CONTACT_AXIAL,
    current_limit=Flag.CURRENT_LIMIT,
    voltage_limit=Flag.VOLTAGE_LIMIT,
    sensor_range=Flag.SENSOR_RANGE,
    law="law",
    laws={"PID": 0.0, "CCS": 1.0, "CAC": 2.0},
    set_points={"y": "ref_y", "z": "ref_z", "psi": "ref_psi", "theta": "ref_theta", "x": "ref_x"},
    observer="observer",
    compensate="compensate",
    integral="integral",
    variants={
        "off": {"observer": 0.0, "compensate": 0.0, "integral": 1.0},
        "corrected": {"observer": 1.0, "compensate": 3.0, "integral": 0.0},
        "literal": {"observer": 2.0, "compensate": 3.0, "integral": 0.0},
    },
    poles={"k1": 2e5, "k2_ccs": 400.0, "k2_cac": 400.0},  # T 3.5
    stands_s=1.0,  # it knows half a second after the last pulse
)
"""The AMB stand of the thesis, rigs/amb5dof.dbc."""


def conventions(rig: RigFile) -> AmbRotor:
    """What the rig's machine calls its things."""
    del rig  # there is one such machine
    return AMB_ROTOR
