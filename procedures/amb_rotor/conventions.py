"""What an AMB rotor's stand calls its things: axes, planes, channels, the bits of its flags, its laws and parameters.

A procedure asks for them once, `machine = conventions(rig)`, and hands them on: bearings, axes and channels are those of the
rig file. Flags, laws and parameters are those of the one controller there is, AMB_ROTOR, which is also what a declaration
takes that has no rig (quantities by axis, defaults of plans).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from operator import or_
from typing import Literal

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.roles import Status
from bench.rigfile.supports import axial_support, once_per_rig, two_planes
from procedures.shared.unsupported import unlike

Law = Literal["PID", "CCS", "CAC"]
Variant = Literal["off", "corrected", "literal"]


@dataclass(frozen=True)
class AmbRotor:
    """The names of one machine.

    `axes` are the four radial ones, in the order of every array of four, `axial` is the fifth. `planes` has by name where
    their y and z stand among the axes; `rings` has by plane the flag of a touch there, `axial_stop` is that of the axial one.
    By axis, `probes` has the channel of its position, `pulls` those of the currents that pull to its positive and to its
    negative side, `coil_voltages` those of the same coils. `plane_voltages` are the channels of the greatest coil voltage of
    each plane, none where they are not told.

    Of the controller: `law` is the parameter that chooses among `laws`, by name the value it takes; `set_points` are the
    parameters by coordinate; `variants` the parameters that set how disturbances are compensated, with the estimator's `poles`;
    `stands_s` is how long after the last pulse it knows that the shaft stands, s.
    """

    axes: tuple[str, str, str, str]
    axial: str
    planes: Mapping[str, tuple[int, int]]
    rings: Mapping[str, Status]
    probes: Mapping[str, str]
    pulls: Mapping[str, tuple[str, str]]
    coil_voltages: Mapping[str, tuple[str, str]]
    plane_voltages: tuple[str, ...]
    axial_stop: Status
    current_limit: Status
    voltage_limit: Status
    sensor_range: Status
    law: str
    laws: Mapping[Law, float]
    set_points: Mapping[str, str]
    observer: str
    compensate: str
    integral: str
    variants: Mapping[Variant, Mapping[str, float]]
    poles: Mapping[str, float]
    stands_s: float
    lacks: tuple[str, ...] = ()  # where the rig is not as these procedures take it

    @property
    def contact(self) -> Status:
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
    def currents(self) -> tuple[str, ...]:
        """Channels of the radial coils' currents, of each axis the one that pulls to the positive side first."""
        return tuple(name for axis in self.axes for name in self.pair(axis))

    @property
    def all_currents(self) -> tuple[str, ...]:
        """Those of all axes."""
        return tuple(name for axis in self.all_axes for name in self.pair(axis))

    @property
    def voltages(self) -> tuple[str, ...]:
        """Channels of the radial coils' voltages; none where the rig does not tell them all."""
        if not all(axis in self.coil_voltages for axis in self.axes):
            return ()
        return tuple(name for axis in self.axes for name in self.coil_voltages[axis])

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
        """The axes along y, z (near end first) or x."""
        if direction == "x":
            return (self.axial,)
        return tuple(self.axes[pair["yz".index(direction)]] for pair in self.planes.values())

    def position(self, axis: str) -> str:
        """Channel of an axis' position sensor.

        Raises:
            Lacking: it has none.
        """
        if axis not in self.probes:
            raise Lacking(f"probes: found none that looks along {axis or 'the shaft'}")
        return self.probes[axis]

    def pair(self, axis: str) -> tuple[str, str]:
        """Channels of the currents that pull an axis to its positive and to its negative side.

        Raises:
            Lacking: it has not two.
        """
        if axis not in self.pulls:
            raise Lacking(f"bearings: found none with two coils along {axis or 'the shaft'}")
        return self.pulls[axis]

    def model_beta(self, axis: str) -> str:
        """The parameter with the controller's force constant of an axis, N m^2/A^2."""
        return f"model_beta_{axis}"

    def model_offset(self, axis: str) -> str:
        """The parameter with the controller's magnetic offset of an axis, m."""
        return f"model_offset_{axis}"


_AXES = ("yi", "zi", "yo", "zo", "x")
AMB_ROTOR = AmbRotor(
    axes=("yi", "zi", "yo", "zo"),
    axial="x",
    planes={"inboard": (0, 1), "outboard": (2, 3)},
    rings={"inboard": Status.CONTACT_NEAR, "outboard": Status.CONTACT_FAR},
    probes={axis: f"pos_{axis}" for axis in _AXES},
    pulls={axis: (f"i_{axis}_p", f"i_{axis}_n") for axis in _AXES},
    coil_voltages={axis: (f"u_{axis}_p", f"u_{axis}_n") for axis in _AXES},
    plane_voltages=("u_i", "u_o"),
    axial_stop=Status.CONTACT_AXIAL,
    current_limit=Status.CURRENT_LIMIT,
    voltage_limit=Status.VOLTAGE_LIMIT,
    sensor_range=Status.SENSOR_RANGE,
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


@once_per_rig
def conventions(rig: RigFile) -> AmbRotor:
    """What the rig's machine calls its things: two radial bearings, from the near end to the far one, and an axial one.

    Raises:
        Lacking: the rig has other bearings, or one of them without what belongs to an axis.
    """
    planes, axial = two_planes(rig), axial_support(rig)
    axes = [axis for plane in planes for axis in plane.axes]
    everywhere = [*axes, *([axial] if axial is not None else [])]
    first, second, third, fourth = (axis.name for axis in axes)
    told = tuple(plane.voltage for plane in planes)
    lean = rig.machine["radial_axes"].value if "radial_axes" in rig.machine else math.pi / 4
    return replace(
        AMB_ROTOR,
        axes=(first, second, third, fourth),
        axial=axial.name if axial is not None else "",
        planes={plane.name: (2 * k, 2 * k + 1) for k, plane in enumerate(planes)},
        rings=dict(zip((plane.name for plane in planes), AMB_ROTOR.rings.values(), strict=True)),
        probes={axis.name: axis.position for axis in everywhere if axis.position},
        pulls={axis.name: (axis.coils[0], axis.coils[1]) for axis in everywhere if len(axis.coils) == 2},
        coil_voltages={
            axis.name: (axis.voltages[0], axis.voltages[1]) for axis in everywhere if len(axis.voltages) == 2
        },
        plane_voltages=told if all(told) else (),
        lacks=unlike(rig, planes, (-lean, math.pi / 2 - lean)),
    )
