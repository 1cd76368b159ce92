"""The rig file's own numbers, undrawn, and what follows from them by rule (docs/reference/twin.md). SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, PLACED
from bench.rigfile.supports import once_per_rig
from bench.rigfile.toleranced import Toleranced
from sim_backend.machines.twin.layout import Geometry, Layout, layout_of

STEEL = 7850.0  # kg/m^3
SLENDER = 0.2  # of the transverse inertia, a shaft and no disc
SPREAD_M = 1e-3  # radial axes that are nearer to each other along the shaft cannot hold a tilt
CAPACITY = (
    6.0  # times its share of the weight, or of what it is to accelerate by 1 g, that an axis pulls at its current limit
)


def set_in(rig: RigFile, key: str, where: str) -> Toleranced | float | None:
    """What `[simulation]` says of a key, for one axis, bearing, probe or plane first."""
    table: Any = rig.simulation.get(key)
    for found in (
        table.get(where) if isinstance(table, Mapping) else None,
        rig.simulation.get(f"{key}_{where}"),
        table,
    ):
        if isinstance(found, Toleranced | int | float):
            return found
    return None


@dataclass(frozen=True)
class Nominal:
    """The rig file's own numbers, undrawn, and what follows from them by rule. SI."""

    rig: RigFile

    @cached_property
    def layout(self) -> Layout:
        """Its parts."""
        return layout_of(self.rig)

    @cached_property
    def geometry(self) -> Geometry:
        """Its places as stated."""
        return Geometry(self.rig, self.layout, {})

    @cached_property
    def tick_s(self) -> float:
        """The controller's."""
        return self.rig.devices["controller"].tick_s if "controller" in self.rig.devices else 1e-4

    @cached_property
    def period_ticks(self) -> int:
        """Ticks between two samples of telemetry, by the cycle time of its first message; of 1 ms where the DBC has none."""
        names = self.rig.binding.telemetry if "controller" in self.rig.devices else ()
        known = self.rig.messages.messages if self.rig.dbc_text else {}
        period = next((known[name].period_s for name in names if name in known), 0.0) or 1e-3
        return max(1, round(period / self.tick_s))

    @cached_property
    def mass(self) -> float:
        """Of what floats, kg."""
        shaft = self.rig.shaft
        assert shaft is not None
        stated = self.rig.simulation.get("mass") if shaft.mass is None else None
        if stated is not None:
            return stated.value if isinstance(stated, Toleranced) else float(stated)
        assert shaft.mass is not None
        return self.geometry.number(shaft.mass, "shaft.mass")

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Stations of the shaft's ends: as stated, else of its outermost parts."""
        shaft = self.rig.shaft
        if shaft is not None and shaft.ends is not None:
            centre = self.geometry.told(self.geometry.places.place(CENTRE))
            found = [self.layout.sense * (self.geometry.told(self.geometry.places.end(k)) - centre) for k in (0, 1)]
        else:
            placed = [p for p in self.geometry.places.parts if p.split("/")[0] in PLACED]
            found = [self.geometry.station(part) for part in placed]
        return min(found), max(found)

    @cached_property
    def length(self) -> float:
        """Of the shaft, m; at least 1 cm."""
        return max(self.ends[1] - self.ends[0], 0.01)

    @cached_property
    def current_limit(self) -> float:
        """Of each coil's reference, A: as set, else nine tenths of what the envelope lets pass, else 5 A."""
        most = self.rig.envelope.max_current_A
        return self.set("current_limit", 0.9 * most if math.isfinite(most) else 5.0)

    @cached_property
    def amplifier_hz(self) -> float:
        """Bandwidth of the current loops: as set, else what the rig file's loop delay leaves after a tick, else a tenth of the
        tick's rate, 200 Hz to 1 kHz."""
        told = self.rig.capabilities.loop_delay
        by_rule = min(max(0.1 / self.tick_s, 200.0), 1000.0)
        return self.set("amplifier_hz", by_rule if told is None else 1 / (2 * math.pi * (told.value - self.tick_s)))

    @cached_property
    def tilt(self) -> float:
        """How far the far end stands above the horizontal, rad: as stated, else 0."""
        shaft = self.rig.shaft
        if shaft is None or shaft.tilt is None:
            return self.set("tilt", 0.0)
        return self.geometry.number(shaft.tilt, "shaft.tilt")

    @cached_property
    def gravity(self) -> float:
        """m/s^2."""
        return self.rig.site.gravity.value

    def set(self, key: str, default: float, where: str = "") -> float:
        """A number as `[simulation]` sets it, undrawn."""
        stated = set_in(self.rig, key, where)
        return default if stated is None else stated.value if isinstance(stated, Toleranced) else float(stated)

    def beta(self, k: int) -> float:
        """Of an axis: F = beta (ip^2/(gap - xi)^2 - in^2/(gap + xi)^2); as set, else so that the axis pulls CAPACITY times
        its share of the weight at its gap and current limit."""
        axis = self.layout.axes[k]
        most = max(self.shares[k] * self.gravity, abs(self.carried[k]))
        rule = CAPACITY * most * (self.gap(axis.bearing) / self.current_limit) ** 2
        return self.set("beta", rule, axis.name)

    def offset(self, k: int) -> float:
        """Of an axis' magnetic centre, m: as set, 0 by rule; what is set for all axes does not hold for the axial one."""
        axis = self.layout.axes[k]
        if axis is self.layout.axial and not self.own("magnetic_offset", axis.name):
            return 0.0
        return self.set("magnetic_offset", 0.0, axis.name)

    def own(self, key: str, where: str) -> bool:
        """Whether `[simulation]` sets a key for this one part."""
        table = self.rig.simulation.get(key)
        return f"{key}_{where}" in self.rig.simulation or (isinstance(table, Mapping) and where in table)

    def gap(self, axis_bearing: str) -> float:
        """Of a bearing, m; 0.5 mm where the file says nothing."""
        stated = self.rig.bearings[axis_bearing].gap
        return 5e-4 if stated is None else self.geometry.number(stated, f"bearings.{axis_bearing}.gap")

    @cached_property
    def clearances(self) -> tuple[float, ...]:
        """Of each plane where the shaft can touch, m: as stated, else four tenths of the smallest radial gap."""
        smallest = min(self.gap(a.bearing) for a in self.layout.radial)
        return tuple(
            self.geometry.number(self.rig.rings[r.ring].clearance, f"rings.{r.ring}.clearance")
            if r.ring
            else 0.4 * smallest
            for r in self.layout.rings
        )

    @cached_property
    def reach(self) -> float:
        """The largest way that the shaft has, across or along itself, m."""
        along = () if self.layout.axial is None else (stop_of(self, self.geometry),)
        return max(*self.clearances, *along, 0.0)

    @cached_property
    def tilts(self) -> bool:
        """Whether the radial axes pull in more than one plane, and tilts are free."""
        at = [self.geometry.station(f"bearings/{a.bearing}") for a in self.layout.radial]
        return max(at) - min(at) > SPREAD_M

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """Of each axis, the mass it feels: what a force at its place and along it accelerates as, kg."""
        m, inertia = self.mass, transverse(self)
        at = [self.geometry.station(f"bearings/{a.bearing}") for a in self.layout.radial]
        radial = [1 / (1 / m + (s * s / inertia if self.tilts else 0.0)) for s in at]
        return (*radial, *((m,) if self.layout.axial is not None else ()))

    @cached_property
    def carried(self) -> tuple[float, ...]:
        """Of each axis, the force that holds the shaft against gravity, the least squares of all, N."""
        n = 4 if self.tilts else 2
        rows = []
        for a in self.layout.radial:
            s, angle = self.geometry.station(f"bearings/{a.bearing}"), self.geometry.angle(a.part)
            rows.append([math.cos(angle), math.sin(angle), -s * math.sin(angle), s * math.cos(angle)][:n])
        weight = self.mass * self.gravity
        up = np.array([weight * math.cos(self.tilt), 0.0, 0.0, 0.0])[:n]
        held = np.linalg.lstsq(np.array(rows).T, up, rcond=None)[0].tolist()
        return (*held, *((weight * math.sin(self.tilt),) if self.layout.axial is not None else ()))


def stop_of(n: Nominal, geometry: Geometry) -> float:
    """How far the shaft may move along itself, m: the axial ring's clearance, else four tenths of the axial gap; 1 m
    without an axial bearing, which then holds it."""
    if n.layout.axial is None:
        return 1.0
    for name, ring in n.rig.rings.items():
        if ring.kind == "axial":
            return geometry.number(ring.clearance, f"rings.{name}.clearance")
    return n.set("stop", 0.4 * n.gap(n.layout.axial.bearing))


def transverse(n: Nominal) -> float:
    """About the centre of mass, kg m^2: as stated, else of a steel cylinder of the shaft's length and mass."""
    shaft = n.rig.shaft
    if shaft is not None and shaft.transverse_inertia is not None:
        return n.geometry.number(shaft.transverse_inertia, "shaft.transverse_inertia")
    return n.set("transverse_inertia", n.mass * (3 * n.mass / (math.pi * STEEL * n.length) + n.length**2) / 12)


def polar(n: Nominal) -> float:
    """About the shaft, kg m^2: as stated, else of a steel cylinder of the shaft's length and mass, at most SLENDER times the
    transverse one."""
    shaft = n.rig.shaft
    if shaft is not None and shaft.polar_inertia is not None:
        return n.geometry.number(shaft.polar_inertia, "shaft.polar_inertia")
    return n.set("polar_inertia", min(n.mass**2 / (2 * math.pi * STEEL * n.length), SLENDER * transverse(n)))


@once_per_rig
def nominal_of(rig: RigFile) -> Nominal:
    """Of a rig file, which is asked time and again."""
    return Nominal(rig)
