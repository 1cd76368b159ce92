"""Which coil carries what of a controller's current systems, and what each system is to move. Bound as
`bench.rigfile.capabilities` says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from bench.rigfile.elements import Name
from bench.rigfile.part import Part

Given = Literal["torque", "radial force", "axial force"]


class CoilSystem(Part):
    """Currents d and q that the controller regulates in some coils: parameters `d` and `q`, A, are added to their references,
    channels `read_d` and `read_q` of captures show them as it has them. A coil at phase p of `coils`, deg, by the channel that
    reads its current, carries d cos(phi + p) - q sin(phi + p), with phi = `per` times the reading of the channel `angle`, rad
    or m, less the parameter `zero`, rad. What it `gives`: a radial force, d along the first of `axes` and q along the second;
    a torque or an axial force, q along the one axis and d none. Axes are channels of positions, of telemetry and captures."""

    d: str
    q: str
    read_d: str
    read_q: str
    angle: str
    per: float
    zero: str = ""
    coils: Mapping[str, float] = Field(min_length=3)
    gives: Given
    axes: tuple[str, ...] = Field(min_length=1, max_length=2)


class CoilMap(Part):
    """Coils of a winding: the current `systems` by name; by coil the channel of the current of the half-bridge that drives it,
    `bridges`; `stars` of coils whose currents have no other way. `still` are by axis the values of parameters at which the
    controller does not hold it, so that what flows is what it was told. `lasts`: the parameter that says after how many
    seconds, by its own clock, the controller takes what is added to a reference away again, 0: never; "": it cannot."""

    systems: Mapping[Name, CoilSystem] = Field(min_length=1)
    bridges: Mapping[str, str] = {}
    stars: tuple[tuple[str, ...], ...] = ()
    still: Mapping[str, Mapping[str, float]] = {}
    lasts: str = ""

    @property
    def coils(self) -> tuple[str, ...]:
        """Every coil, in the order of the systems."""
        return tuple(dict.fromkeys(coil for system in self.systems.values() for coil in system.coils))

    @property
    def axes(self) -> tuple[str, ...]:
        """Every axis, in the order of the systems."""
        return tuple(dict.fromkeys(axis for system in self.systems.values() for axis in system.axes))
