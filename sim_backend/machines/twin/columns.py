"""What a unit of each coordinate moves at an axis or a probe, and what of the shaft is free to move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.machines.twin.layout import AxisPart, Geometry, Layout, Numbers
from sim_backend.machines.twin.nominal import Nominal, stop_of

Array = npt.NDArray[np.float64]
Two = tuple[float, float]
FREE_BEAM = (4.730040744862704, 7.853204624095838)  # roots of cos b cosh b = 1
TELLS_APART = 1e-6  # of the greatest singular value: what is less is a motion that axes or probes do not see


@dataclass(frozen=True)
class Free:
    """What of the radial motion is free: `tilts`, and the projector yy, yz, zz on the directions in which the shaft moves.
    `basis` (4, n) spans it, of y, z, psi, theta."""

    tilts: bool
    radial: tuple[float, float, float]
    basis: Array


@dataclass(frozen=True)
class Columns:
    """Of one machine: its places, its nominal numbers, and what was drawn for it."""

    geometry: Geometry
    nominal: Nominal
    v: Numbers

    @property
    def rig(self) -> RigFile:
        """Its rig file."""
        return self.geometry.rig

    @property
    def layout(self) -> Layout:
        """Its parts."""
        return self.geometry.layout

    def axis(self, a: AxisPart) -> tuple[float, ...]:
        """Displacement at a radial axis by y, z, psi, theta and bending y1 z1 y2 z2: c (y + s theta) + d (z - s psi)."""
        return self._row(self.geometry.station(f"bearings/{a.bearing}"), self.geometry.angle(a.part))

    def probe(self, name: str) -> tuple[float, ...]:
        """The same of a probe, and by x at last."""
        if name in self.layout.along:
            return (*(0.0,) * 8, float(self.layout.sense))
        return (*self._row(self.geometry.station(f"probes/{name}"), self.geometry.angle(f"probes/{name}")), 0.0)

    def _row(self, station: float, angle: float) -> tuple[float, ...]:
        c, d = math.cos(angle), math.sin(angle)
        one, two = self.shape(station)
        return c, d, -d * station, c * station, c * one, d * one, c * two, d * two

    def shape(self, station: float) -> Two:
        """Of both bending modes at a station: a uniform beam with free ends, 1 at its near end."""
        if not (self.nominal.set("mode_1_on", 0.0) or self.nominal.set("mode_2_on", 0.0)):
            return 0.0, 0.0
        low, high = self.nominal.ends
        share = min(max((station - low) / (high - low), 0.0), 1.0)
        return _beam(0, share), _beam(1, share)

    def gap(self, a: AxisPart) -> float:
        """Of an axis' bearing, m."""
        stated = self.rig.bearings[a.bearing].gap
        return 5e-4 if stated is None else self.geometry.number(stated, f"bearings.{a.bearing}.gap")

    @property
    def clearances(self) -> tuple[float, ...]:
        """Of each plane where the shaft can touch, m."""
        return tuple(
            self.geometry.number(self.rig.rings[r.ring].clearance, f"rings.{r.ring}.clearance") if r.ring else nominal
            for r, nominal in zip(self.layout.rings, self.nominal.clearances, strict=True)
        )

    @property
    def stop(self) -> float:
        """How far the shaft may move along itself, m."""
        return stop_of(self.nominal, self.geometry)

    def noise(self, channel: str) -> float:
        """Of a probe's reading in one tick, m rms: as set, else 0.3 um, and so much that the samples of the telemetry have
        half as much again as the rig file states for the channel at least."""
        stated = self.rig.channels[channel].noise if channel in self.rig.channels else None
        averaged = self.nominal.period_ticks if self.nominal.rig.binding.samples == "mean" else 1
        least = 1.5 * (stated or 0.0) * math.sqrt(averaged)
        return self.nominal.set("position_noise", max(3e-7, least), channel)

    def runout(self, name: str, order: int) -> Two:
        """Of a probe, what goes with cos and sin of `order` times the shaft's angle: a journal of a cos(n phi + p) where it is
        looked at along y is seen as a cos(n (phi - alpha) + p) along alpha."""
        if name in self.layout.along:
            return 0.0, 0.0
        journal = next(j for j, names in self.layout.journals.items() if name in names)
        size = self.v[f"runout_{order}.{journal}"]
        at = self.v[f"runout_phase_{order}.{journal}"] - order * self.geometry.angle(f"probes/{name}")
        return size * math.cos(at), -size * math.sin(at)

    @property
    def mark(self) -> float:
        """Angle from y at which the mark is told, rad: its direction if the file says one, else as drawn."""
        mark = self.rig.mark
        return self.geometry.angle("mark") if mark is not None and mark.direction is not None else self.v["pulse_angle"]

    @cached_property
    def free(self) -> Free:
        """By the radial axes, nominally: all four motions where they pull in two planes and two directions each; without tilts
        where they pull in one plane, there in one direction or two.

        Raises:
            ConfigError: something between these.
        """
        rows = np.array([self.axis(a)[:4] for a in self.layout.radial])
        length = max(float(np.abs(rows[:, 2:]).max()), 1e-3)
        scaled = rows / np.array([1.0, 1.0, length, length])
        if self.nominal.tilts:
            if (held := rank(scaled)) == 4:
                return Free(True, (1.0, 0.0, 1.0), np.eye(4))
            found = f"rig {self.rig.name}: bearings: their axes hold {held} of the four radial motions"
            raise ConfigError(f"{found}; expected all four, or axes in one plane alone, whose twin has no tilts")
        if rank(rows[:, :2]) == 2:
            return Free(False, (1.0, 0.0, 1.0), np.eye(4)[:, :2])
        c, d = rows[0, :2] / np.linalg.norm(rows[0, :2])
        return Free(False, (float(c * c), float(c * d), float(d * d)), np.array([[c], [d], [0.0], [0.0]]))


def rank(rows: Array) -> int:
    """How many motions a table of rows sees."""
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > TELLS_APART * sizes[0]).sum())


def _beam(mode: int, share: float) -> float:
    """(cosh bx + cos bx - k (sinh bx + sin bx))/2, which is 1 at x = 0."""
    b = FREE_BEAM[mode]
    k = (math.cosh(b) - math.cos(b)) / (math.sinh(b) - math.sin(b))
    x = b * share
    return (math.cosh(x) + math.cos(x) - k * (math.sinh(x) + math.sin(x))) / 2
