"""From pulses and turned pushes to each coil's share, and to what each system was seen to move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilMap
from bench.uncertainty import Estimate, Influence
from procedures.coil_map.bowl import Bowl, fitted, swing
from procedures.coil_map.steps import WAYS, Pulse, Tour, ability, radial
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
Row = tuple[str, str]


@dataclass(frozen=True)
class Pushed:
    """What a turned push moved: by radial system how far its axes went, m, and which of them it moved most, `most`; the bowl of
    that, and all of it."""

    far: Mapping[str, float]
    most: str
    bowl: Bowl
    tour: Tour

    @property
    def places(self) -> Array:
        """Where those axes were, (n, 2) m."""
        return self.tour.places[self.most]

    @property
    def turned(self) -> float:
        """How far the mover turned meanwhile, electrical, rad."""
        return float(np.ptp(self.tour.phi))


@dataclass(frozen=True)
class Result:
    """By coil its `share`, and what its own sensor and its half-bridge's read of one: `coils`, `bridges`, the latter with their
    standard uncertainty. By system and way, of 1 A: what each coil should carry and carried, (rows, coils); what the controller
    had of it along and across, (rows, 2); `moved` by axis, half of the difference between pulses either way, m or rad.
    `pushed` by radial system; `phi` by system, electrical, rad."""

    can: CoilMap
    share: Mapping[str, Estimate]
    coils: Mapping[str, float]
    bridges: Mapping[str, tuple[float, float]]
    rows: tuple[Row, ...]
    expected: Array
    found: Array
    read: Array
    moved: Mapping[Row, Mapping[str, float]]
    pushed: Mapping[str, Pushed]
    phi: Mapping[str, float]


def evaluate(pulses: Sequence[Pulse], tours: Mapping[str, Tour], rig: RigFile) -> Result:
    """All of it; of what was recorded.

    Raises:
        AnalysisError: no current flowed at all.
    """
    can = ability(rig)
    rows = tuple(dict.fromkeys((p.system, p.way) for p in pulses))
    if not rows:
        raise AnalysisError("no current flowed in any pulse")
    of = {row: [p for p in pulses if (p.system, p.way) == row] for row in rows}
    first = {row: [p for p in some if p.coils.keys() == set(can.coils)] or some for row, some in of.items()}

    def table(value: str) -> Array:
        return np.array([[_mean([getattr(p, value)[c] / p.size for p in first[row] if c in getattr(p, value)])
                          for c in can.coils] for row in rows])  # fmt: skip

    read = np.array(
        [np.mean([(p.read if p.way == "d" else p.read[::-1]) / p.size for p in of[row]], axis=0) for row in rows]
    )
    return Result(
        can, {c: _share(rig, c, _shares(pulses, c)) for c in can.coils if len(_shares(pulses, c)) > 1},
        {c: _mean(_shares(pulses, c)) for c in can.coils}, _bridges(pulses, can), rows, table("expected"), table("coils"), read,
        {row: {a: half(some, a) for a in can.axes} for row, some in of.items()},
        {name: _pushed(tour) for name, tour in tours.items()},
        {name: _mean([p.phi for p in pulses if p.system == name]) for name in can.systems},
    )  # fmt: skip


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def _shares(pulses: Sequence[Pulse], coil: str) -> list[float]:
    """A coil's reading of what is asked of it, by least squares over a repeat of all its systems' pulses of one sign."""
    groups: dict[tuple[int, bool], list[Pulse]] = {}
    for p in pulses:
        if coil in p.square:
            groups.setdefault((p.repeat, p.size > 0), []).append(p)
    return [sum(p.product[coil] for p in g) / sum(p.square[coil] for p in g) for g in groups.values()]


def _bridges(pulses: Sequence[Pulse], can: CoilMap) -> dict[str, tuple[float, float]]:
    """The same of the half-bridges, where they were captured, with its standard uncertainty: inner loops make noise."""
    out = {}
    for coil in can.coils:
        mine = [p for p in pulses if coil in p.bridges]
        if len(mine) > 1:
            square, product = (np.array([getattr(p, of)[coil] for p in mine]) for of in ("square", "product_bridge"))
            share = float(product.sum() / square.sum())
            noise = np.array([p.noise[coil] for p in mine])
            out[coil] = share, float(np.sqrt((square * noise**2).sum()) / square.sum())
    return out


def _share(rig: RigFile, coil: str, each: Sequence[float]) -> Estimate:
    u = float(np.std(each, ddof=1)) / math.sqrt(len(each))
    scatter = Influence(f"scatter/{coil}", "scatter of the repeats", u, "1", "A", "normal", len(each) - 1)
    return Estimate.of(float(np.mean(each)), scatter) / certified_gain(rig, coil)


def half(pulses: Sequence[Pulse], axis: str) -> float:
    """Half of what pulses either way moved differently: what creeps by itself is in both."""
    ways = [[p.moved[axis] for p in pulses if (p.size > 0) == up] for up in (True, False)]
    return (_mean(ways[0]) - _mean(ways[1])) / 2


def _pushed(tour: Tour) -> Pushed:
    far = {name: swing(places) for name, places in tour.places.items()}
    most = max(far, key=lambda name: far[name])
    return Pushed(far, most, fitted(tour.currents, tour.beside, tour.places[most]), tour)


def response(r: Result) -> Array:
    """Systems and ways against axes, (rows, axes): of a radial system what its turned push did to each axis of 1 A, of the
    clearance; of the others what a pulse moved, of the greatest of that axis."""
    out = np.zeros((len(r.rows), len(r.can.axes)))
    for j, axis in enumerate(r.can.axes):
        of = [r.moved[row][axis] for row in r.rows]
        aside = any(axis in r.can.systems[n].axes for n in radial(r.can))
        scale = max((p.far[p.most] / 2 for p in r.pushed.values()), default=1.0) if aside else max(map(abs, of))
        out[:, j] = np.array(of) / max(scale, 1e-12)
    return out


def asked(can: CoilMap, rows: Sequence[Row]) -> Array:
    """What should move: 1 where a system's way moves an axis, 0 elsewhere."""
    out = np.zeros((len(rows), len(can.axes)))
    for i, (name, way) in enumerate(rows):
        system = can.systems[name]
        if system.gives == "radial force":
            out[i, can.axes.index(system.axes[WAYS.index(way)])] = 1.0
        elif way == "q":
            out[i, can.axes.index(system.axes[0])] = 1.0
    return out
