"""Which cable: what a wrong wiring would do, beside what was seen."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem
from procedures.coil_map import winding
from procedures.coil_map.bowl import Bowl

Array = npt.NDArray[np.float64]
DEG = math.pi / 180
GIVES = tuple(k / 10 for k in range(-10, 11))  # shares of its force that a coil is tried with
NEAR = 0.35  # of a direction, rad: as near as a thrust that friction bends tells


def turned(rotation: float) -> Array:
    """A turn by an angle, (2, 2)."""
    c, s = math.cos(rotation), math.sin(rotation)
    return np.array([[c, -s], [s, c]])


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


def weak_coil(can: CoilMap, name: str, bowl: Bowl, phi: float) -> tuple[str, float, bool]:
    """The coil of a radial system that explains its pushes best, the share of its force that it gives, and whether the one
    opposite would explain them as well."""
    system, other = can.systems[name], winding.beside(can, name)
    back = turned(-bowl.angle)
    s, m = back @ bowl.s, back @ bowl.m
    tried = []
    for coil, gives in itertools.product(system.coils, GIVES):
        model = winding.taken_by(system, coil, phi, gives)
        top = float(np.linalg.norm(model, 2))
        cross = winding.crossed(system, can.systems[other], coil, phi, gives) / top if other else np.zeros(2)
        tried.append((float(((s - model / top) ** 2).sum() + 2 * ((m - cross) ** 2).sum() * bool(other)), coil, gives))
    best = min(tried)
    rival = min(t for t in tried if t[1] != best[1])
    return best[1], best[2], rival[0] < 1.5 * best[0] + 1e-4


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
