"""The names of one AMB rotor's machine: its axes, planes, channels and status bits, and what its controller can be asked for.

`procedures.amb_rotor.conventions` makes it of a rig file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_

from bench.errors import Lacking
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.recorded import AGE, COUNT
from bench.rigfile.roles import Status
from procedures.amb_rotor.stations import ALONG, Stations

Law = str
"""Of the controller, by the name that the rig file gives it; "": as the controller is set."""
Variant = str
"""How the controller compensates disturbances, by the rig file's name."""


@dataclass(frozen=True)
class AmbRotor:
    """The names of one machine.

    `axes` are the four radial ones, in the order of every array of four, `axial` is the fifth. `planes` has by name where
    their y and z stand among the axes; `rings` has by plane the flag of a touch there, `axial_stop` is that of the axial one.
    By axis, `probes` has the channel of its position, `pulls` those of the currents that pull to its positive and to its
    negative side, `coil_voltages` those of the same coils. `plane_voltages` are the channels of the greatest coil voltage of
    each plane, none where they are not told.

    `can` is what its controller can be asked to do. `stations` has where axes pull and probes look; `stands_s`: how long after
    the last pulse the controller knows that the shaft stands, s.
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
    can: Capabilities
    stations: Stations
    stands_s: float
    lag_s: float  # by which currents follow their references, as the controller knows it, or as the rig file says
    loop_rad_s: float  # the rigid modes' own, by the laws that say so (`flatness`); infinite where none does
    gaps: Mapping[str, float]  # air gap by axis, m, as far as it is told
    speed_told: bool
    marked: bool  # whether the angle and the speed are told by a mark
    clearance: float  # the least of the rings', m; infinite where the rig has none
    pulsed: tuple[str, ...] = (COUNT, AGE)  # of a capture: the mark's count, its age; none where it has not both
    lacks: tuple[str, ...] = ()  # where the rig is not as these procedures take it
    crooked: tuple[str, ...] = ()  # where it is not two planes of like axes; what goes by rows takes it
    unweighed: tuple[str, ...] = ()  # where it is not as those take it that go by the shaft's weight

    @property
    def contact(self) -> Status:
        """A touch anywhere."""
        return reduce(or_, self.rings.values(), self.axial_stop)

    @property
    def all_axes(self) -> tuple[str, ...]:
        """The radial ones, then the axial one, if it is held and watched as they are."""
        return (*self.axes, self.axial) if self.axial in self.probes and self.axial in self.pulls else self.axes

    @property
    def positions(self) -> tuple[str, ...]:
        """Channels of the position sensors that look along the radial axes."""
        return tuple(map(self.position, self.axes))

    @property
    def probed(self) -> bool:
        """Whether every radial axis has a probe of its own, which reads the way the axis counts."""
        return all(a in self.probes and self.stations.probes[self.probes[a]].sign > 0 for a in self.axes)

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
        """Captured channels of the radial coils' voltages; none where the rig does not tell or record them all."""
        if not all(axis in self.coil_voltages for axis in self.axes):
            return ()
        return tuple(name for axis in self.axes for name in self.coil_voltages[axis])

    @property
    def laws(self) -> tuple[str, ...]:
        """The controller's, by the rig file's names; none where there is no choice. The first is what it lifts and stops by."""
        return tuple(self.can.settings.get("law", ()))

    @property
    def variants(self) -> Mapping[Variant, Mapping[str, float]]:
        """How disturbances are compensated: the parameters that set it, by name; "off" alone where nothing is."""
        return self.can.settings.get("compensation", {"off": {}})

    @property
    def poles(self) -> Mapping[str, float]:
        """Parameters of the laws where disturbances are observed."""
        return self.can.settings.get("poles", {}).get("observed", {})

    @property
    def model_parameters(self) -> tuple[str, ...]:
        """What the controller knows of the radial bearings: force constants, then magnetic offsets, as far as it does."""
        return tuple(self.can.model[f"{kind}_{axis}"] for kind in ("beta", "offset") for axis in self.axes
                     if f"{kind}_{axis}" in self.can.model)  # fmt: skip

    @property
    def biases(self) -> dict[str, str]:
        """By radial axis, the parameter of its own bearing's bias current; nothing where the rig file binds none."""
        of = self.can.bias
        return {self.axes[k]: of[plane] for plane, pair in self.planes.items() if plane in of for k in pair}

    @property
    def lifting(self) -> dict[str, float]:
        """What the controller is set to before a lift: a law that needs no model, nothing compensated."""
        plain = self.can.settings.get("lift", {})
        return dict(next(iter(plain.values()))) if plain else self.select(self.plain_law)

    @property
    def plain_law(self) -> Law:
        """The law that it lifts and stops by."""
        return next(iter(self.laws), "")

    def select(self, law: Law) -> dict[str, float]:
        """The parameters that select a law; nothing where the controller stays as it is set."""
        return dict(self.can.settings.get("law", {}).get(law, {}))

    def gain(self, key: str, axis: str) -> str:
        """The parameter of a gain of the laws that are no flatness; "" where there is none."""
        bound: str | Mapping[str, str] = getattr(self.can.gains, key)
        return bound if isinstance(bound, str) else bound.get(axis, "")

    def point(self, coordinate: str, value: float) -> dict[str, float]:
        """The set points, by parameter, that hold the shaft at a coordinate: m along x, y or z (of the centre of mass), rad of
        a tilt about y or z, by T (2.17): at l_k from it y_k = y + l_k theta and z_k = z - l_k psi.

        Raises:
            Lacking: the controller takes no set point there.
        """
        shaft: Mapping[str, str] = {str(name): parameter for name, parameter in self.can.set_points.shaft.items()}
        if coordinate in shaft:
            return {shaft[coordinate]: value}
        return self._by_axes({coordinate: value})

    def points(self, at: Mapping[str, float]) -> dict[str, float]:
        """As `point`, along several coordinates at once: where set points are by axis, an axis may look along more than one.

        Raises:
            Lacking: the controller takes no set point there.
        """
        if {str(name) for name in self.can.set_points.shaft} >= {*at}:
            return {name: value for c, x in at.items() for name, value in self.point(c, x).items()}
        return self._by_axes(at)

    def _by_axes(self, at: Mapping[str, float]) -> dict[str, float]:
        """By T (2.17) at each bearing; an axis that no coordinate moves is left alone."""
        out = {self.axial if name == ALONG else name: value for name, value in self.stations.moved(at).items()}
        parameters = self.can.set_points.axes
        if missing := [axis or "the shaft" for axis in out if axis not in parameters]:
            raise Lacking(f"capabilities.set_points: found none for {', '.join(missing)}")
        return {parameters[axis]: value for axis, value in out.items()}

    def moved_by(self, parameter: str) -> str | None:
        """The coordinate whose only set point a parameter is; None where it is none, or one of several."""
        coordinates = ("y", "theta", "z", "psi", "x")
        return next((c for c in coordinates if self.can_point(c) and [*self.point(c, 0.0)] == [parameter]), None)

    def can_point(self, coordinate: str) -> bool:
        """Whether the controller takes set points along a coordinate."""
        try:
            return bool(self.point(coordinate, 0.0))
        except Lacking:
            return False

    def unmoved(self, coordinates: Iterable[str]) -> tuple[str, ...]:
        """A line for each coordinate along which a controller that takes set points takes none."""
        points = self.can.set_points
        asked = coordinates if points.axes or points.shaft else ()
        return tuple(f"capabilities.set_points: found none along {c}" for c in asked if not self.can_point(c))

    def along(self, direction: str) -> tuple[str, ...]:
        """The axes along y, z (near end first) or x; of a bearing's two the one that looks more along."""
        if direction == "x":
            return (self.axial,)
        k, sort = "yz".index(direction), self.stations.sorted_pair
        return tuple(sort(self.axes[one], self.axes[other])[k] for one, other in self.planes.values())

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
        """The parameter with the controller's force constant of an axis, N m^2/A^2; "" where it has none."""
        return self.can.model.get(f"beta_{axis}", "")

    def model_offset(self, axis: str) -> str:
        """The parameter with the controller's magnetic offset of an axis, m; "" where it has none."""
        return self.can.model.get(f"offset_{axis}", "")
