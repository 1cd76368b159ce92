"""Which cable: what a wrong wiring would do, beside what was seen."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem
from procedures.coil_map import winding
from procedures.coil_map.bowl import rest_of
from procedures.coil_map.steps import Tour

Array = npt.NDArray[np.float64]
DEG = math.pi / 180
GIVES = (-1.0, -0.5, 0.0, 0.25, 0.5, 0.7, 0.85)  # shares of its force that a coil is tried with
NEAR = 0.35  # of a direction, rad: as near as a thrust that friction bends tells


def mirrored_pairs(system: CoilSystem, axis_deg: float) -> list[tuple[str, str]]:
    """Coils that change places where phases p and `axis_deg` - p do."""

    def off(p: float, q: float) -> float:
        return abs((p + q - axis_deg + 180) % 360 - 180)

    pairs = itertools.combinations(system.coils, 2)
    return [(a, b) for a, b in pairs if off(system.coils[a], system.coils[b]) < 1]


def exchanged_phases(system: CoilSystem, angle: float, phi: float) -> list[tuple[str, str]]:
    """Which coils are exchanged where a push goes as conj(i) turned by `angle` at the electrical angle `phi`: exchanged phases
    make i = e^(-2j phi + j rho) conj(i), rho twice the phase about which they are."""
    rho = math.degrees(angle + 2 * phi) % 360
    of_coils = {round(a + b) % 360 for a, b in itertools.combinations(system.coils.values(), 2)} & {0, 120, 240}
    axis = min(of_coils or {0}, key=lambda x: abs((x - rho + 180) % 360 - 180))
    return mirrored_pairs(system, axis)


def weak_coil(can: CoilMap, tour: Tour, places: Array) -> tuple[str, float, float, float]:
    """The coil of a radial system that explains a turned push best, the share of its force that it gives; what it leaves of
    the places, m, and what a winding without fault leaves."""
    system, other = can.systems[tour.system], winding.beside(can, tour.system)
    tried = [(rest_of(_pushes(system, can.systems[other] if other else None, tour, coil, gives), places), coil, gives)
             for coil in system.coils for gives in GIVES]  # fmt: skip
    sound = rest_of(tour.currents, places)
    left, coil, gives = min(tried)
    return coil, gives, left, sound


def _pushes(system: CoilSystem, other: CoilSystem | None, tour: Tour, coil: str, gives: float) -> Array:
    """What a system pushes with such a coil, at the angle and with the torque currents of each place, (n, 2)."""
    out = np.array(
        [winding.taken_by(system, coil, phi, gives) @ i for phi, i in zip(tour.phi, tour.currents, strict=True)]
    )
    if other is not None:
        for way, current in (("d", tour.beside), ("q", tour.beside_q)):
            share = winding.of_way(other, way, tour.phi)[coil] * current * -(1 - gives) * 2 / len(system.coils)
            out += share[:, None] * np.array([winding.unit(system, coil, phi) for phi in tour.phi])
    return out


def thrust(system: CoilSystem, along: float, across: float, phi: float) -> list[str]:
    """What turns (d, q) pulses into what they moved: `along` d, `across` q."""
    seen = math.atan2(along, across)
    tried = [("every coil of it connected the other way round", np.array([0.0, -1.0]))]
    for a, b in itertools.combinations(system.coils, 2):
        rho = (system.coils[a] + system.coils[b]) * DEG - 2 * phi
        tried.append((f"the cables of {a} and {b} exchanged", np.array([math.sin(rho), -math.cos(rho)])))
    for coil in system.coils:
        row = winding.taken_by(system, coil, phi, -1.0)[1]
        tried.append((f"coil {coil} connected the other way round", row))
    out = []
    for text, (d, q) in tried:
        if math.hypot(d, q) > 0.1 and abs((math.atan2(d, q) - seen + math.pi) % (2 * math.pi) - math.pi) < NEAR:
            out.append(text)
    return out


def across_stars(can: CoilMap, expected: Array, found: Array) -> tuple[str, str] | None:
    """Two cables whose exchange lets currents (rows, coils) flow as found: a star's currents have no other way, and the
    controller, which has all d and q as it wants, leaves what is common to a star free. None where none explains them."""
    names = list(can.coils)
    index = [[names.index(c) for c in star] for star in can.stars]
    best, left = None, 0.5 * float(((found - expected) ** 2).sum())
    for a, b in itertools.combinations(range(len(names)), 2):
        home = [next((k for k, star in enumerate(index) if c in star), -1) for c in (a, b)]
        if home[0] == home[1]:
            continue
        stars = [[b if c == a else a if c == b else c for c in star] for star in index]
        rest = float(((found - _flows(expected, index, stars)) ** 2).sum())
        if rest < left:
            best, left = (names[a], names[b]), rest
    return best


def _flows(expected: Array, index: Sequence[Sequence[int]], stars: Sequence[Sequence[int]]) -> Array:
    """Currents that the controller reaches, with coils in other stars than it takes them to be."""
    common = np.zeros((expected.shape[1], len(index)))
    for k, star in enumerate(index):
        common[list(star), k] = 1.0
    close = np.zeros((len(stars), expected.shape[1]))
    for k, star in enumerate(stars):
        close[k, list(star)] = 1.0
    free = np.linalg.lstsq(close @ common, -(close @ expected.T), rcond=None)[0]
    return np.asarray(expected + (common @ free).T)
