"""Ratios of each plane and axis, the readings without current, and with a measured pole what follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.uncertainty import Estimate, Influence
from procedures.pull_ratio import fit
from procedures.pull_ratio.fit import Statics
from procedures.pull_ratio.planes import Plane, axes, planes, upwards
from procedures.pull_ratio.steps import Taken
from procedures.shared.certificates import certified, certified_gain

Array = npt.NDArray[np.float64]
Found = dict[tuple[str, str], Estimate]
RATIO, FREE, TURN, LEVER = "pull_ratio", "current_free", "frame_turn", "lever_ratio"
CONSTANT, CENTRE, PULL = "bearing_constant", "magnet_centre", "K_pull"
ALONG_WEIGHT = 0.5  # cosine from which on an axis carries the weight


@dataclass(frozen=True)
class Slope:
    """Of a `plane` by its number along one axis, `way` 0 or 1 of its two: the `loop`; the current's part along `direction` (2,)
    of d and q, in which it goes, per metre of its `own` reading and of the `other` plane's, `noise` (2, 2) their covariance;
    `turn` of the direction from the axis, rad, and its standard uncertainty by noise."""

    plane: int
    way: int
    axis: str
    loop: str
    own: float
    other: float
    direction: Array
    noise: Array
    turn: float
    u_turn: float

    @property
    def psi(self) -> float:
        """Angle of the direction."""
        return math.atan2(self.direction[1], self.direction[0])


@dataclass(frozen=True)
class Result:
    """What was fitted, slopes of each loop in the order of the planes, and the quantities by name and where."""

    statics: Statics
    slopes: Sequence[Slope]
    estimates: Found = field(default_factory=dict)


@dataclass(frozen=True)
class Coil:
    """Of a plane: its gain's and offset's channel, phi + p of what it carries, rad, and 2/n of its plane's n coils."""

    plane: int
    channel: str
    phase: float
    share: float


def result(
    taken: Sequence[Taken],
    rig: RigFile,
    poles: Mapping[str, Estimate] | None,
    constants: Mapping[str, Estimate] | None = None,
) -> Result:
    """All of it; as they were measured `poles`, 1/s, by `pole@` and the axis, and `constants`, N/A, by `K_B@` and the plane.

    Raises:
        AnalysisError: levels that do not tell it.
    """
    some = [t for t in taken if t.readings is not None]
    found = fit.statics(np.array([t.readings for t in some]), np.array([t.currents for t in some]))
    slopes = [_slope(found, rig, k, way) for k in (0, 1) for way in (0, 1)]
    coils = [coil for k, plane in enumerate(planes(rig)) for coil in _coils(rig, k, plane, some)]
    out: Found = {(RATIO, s.loop): _ratio(s, rig, coils, found.dof) for s in slopes}
    out |= _free(found, slopes, rig, coils)
    out |= {(TURN, plane.name): _turn(k, plane, slopes, rig, coils, found.dof) for k, plane in enumerate(planes(rig))}
    out[LEVER, ""] = _lever(slopes, rig, found.dof)
    if poles is not None:
        out |= _by_pole(out, rig, poles)
    if constants is not None:
        out |= _by_constants(out, rig, constants)
    return Result(found, slopes, out)


def gain(rig: RigFile, channel: str) -> Estimate:
    """Of a channel's sensor, exact where it has no certificate."""
    return certified_gain(rig, channel) if channel in rig.sensors else Estimate.exact(1.0)


def _probes(rig: RigFile, s: Slope) -> tuple[str, str]:
    """Channels of its own reading and of the other plane's."""
    own, other = (planes(rig)[k].system.axes[s.way] for k in (s.plane, 1 - s.plane))
    return own, other


def _slope(found: Statics, rig: RigFile, k: int, way: int) -> Slope:
    """Complex over what d would be along d and q along q: -P/K e^(-j d)."""
    rows, both = slice(2 * k, 2 * k + 2), [2 * k + way, 2 * (1 - k) + way]
    plane = planes(rig)[k]
    weights = np.array([gain(rig, planes(rig)[j].system.axes[way]).value for j in (k, 1 - k)])
    vector = found.slopes[rows][:, both] @ weights
    size = float(np.hypot(*vector))
    direction = vector / size
    spread, normal = found.spread[rows, rows], found.normal[np.ix_(both, both)]
    across = np.array([-direction[1], direction[0]])
    u_turn = math.sqrt(float(across @ spread @ across) * float(weights @ normal @ weights)) / size
    turn = float(np.angle(complex(*vector) / (-1j if way else -1.0)))
    own, other = (float(direction @ found.slopes[rows, j]) for j in both)
    noise = float(direction @ spread @ direction) * normal
    return Slope(k, way, list(axes(rig))[way], plane.loops[way], own, other, direction, noise, turn, u_turn)


def _coils(rig: RigFile, k: int, plane: Plane, taken: Sequence[Taken]) -> list[Coil]:
    """At phase phi + p each carries d cos - q sin."""
    system, n = plane.system, len(plane.system.coils)
    zero = rig.parameters[system.zero].default if system.zero else 0.0
    phi = system.per * float(np.mean([t.angles[system.angle] for t in taken])) - zero
    return [Coil(k, name, phi + math.radians(p), 2 / n) for name, p in system.coils.items()]


def _scatter(name: str, u: float, unit: str, dof: float) -> Estimate:
    return Estimate.of(0.0, Influence(f"scatter/{name}", "scatter of the levels", u, unit, "A", "normal", dof,
                                      source="what is left of the straight line"))  # fmt: skip


def _in(unit: str, x: Estimate) -> Estimate:
    return Estimate(x.value, unit, x.sensitivities, x.sampler)


def _ratio(s: Slope, rig: RigFile, coils: Sequence[Coil], dof: float) -> Estimate:
    """Sum of both slopes, each by its probe's gain, over what is read a true ampere along the direction, by what each coil
    carries of it."""
    own, other = (gain(rig, c) for c in _probes(rig, s))
    weights = np.array([own.value, other.value])
    read = _in("A/m", own * s.own + other * s.other)
    read = read + _scatter(f"{s.loop}/ratio", math.sqrt(float(weights @ s.noise @ weights)), "A/m", dof)
    seen = Estimate.exact(0.0)
    for c in coils:
        if c.plane == s.plane:
            seen = seen + gain(rig, c.channel) * (c.share * math.cos(c.phase + s.psi) ** 2)
    return _in("A/m", read / seen)


def _free(found: Statics, slopes: Sequence[Slope], rig: RigFile, coils: Sequence[Coil]) -> Found:
    """Readings without current. Offsets o of the coils' readings move the currents by 2/n sum(o cos) along d, -2/n sum(o sin)
    along q."""
    at, covariance = fit.without_current(found)
    inverse = np.linalg.inv(found.slopes)
    out: Found = {}
    for j, s in enumerate(slopes):
        value = Estimate.exact(float(at[j]), "m")
        value = value + _scatter(f"{s.loop}/free", math.sqrt(covariance[j, j]), "m", found.dof)
        for c in coils:
            if c.channel not in rig.sensors:
                continue
            d, q = inverse[j, 2 * c.plane], inverse[j, 2 * c.plane + 1]
            moved = c.share * float(d * math.cos(c.phase) - q * math.sin(c.phase))
            offset = rig.sensors[c.channel].offset
            value = value + _in("m", certified(f"sensors/{c.channel}/offset", offset, f"offset of {c.channel}") * moved)
        out[FREE, s.loop] = value
    return out


def _turn(k: int, plane: Plane, slopes: Sequence[Slope], rig: RigFile, coils: Sequence[Coil], dof: float) -> Estimate:
    """The frame's angle against the probes, mean of both axes. A coil that reads 1 + g turns what it carries: along an axis of
    which it carries the cosine c, its part across is the sine."""
    some = [s for s in slopes if s.plane == k]
    value = Estimate.exact(-float(np.mean([s.turn for s in some])), "rad")
    u = math.sqrt(sum(s.u_turn**2 for s in some)) / len(some)
    value = value + _scatter(f"{plane.name}/turn", u, "rad", dof)
    for c in coils:
        if c.plane == k:
            part = c.share * float(np.mean([math.cos(c.phase + s.psi) * math.sin(c.phase + s.psi) for s in some]))
            value = value + _in("rad", (gain(rig, c.channel) - 1.0) * part)
    return value


def _lever(slopes: Sequence[Slope], rig: RigFile, dof: float) -> Estimate:
    """Mean over planes and axes of (own - other)/(own + other): of x_1 = (1 + r)/2 y_1 + (1 - r)/2 y_2."""
    out = Estimate.exact(0.0, "1")
    for s in slopes:
        own, other = (gain(rig, c) * part for c, part in zip(_probes(rig, s), (s.own, s.other), strict=True))
        by = np.array([2 * s.other, -2 * s.own]) / (s.own + s.other) ** 2
        one = _in("1", (own - other) / (own + other))
        one = one + _scatter(f"{s.loop}/lever", math.sqrt(float(by @ s.noise @ by)), "1", dof)
        out = out + one * (1 / len(slopes))
    return out


def _by_pole(found: Found, rig: RigFile, poles: Mapping[str, Estimate]) -> Found:
    """P_1 + P_2 = lambda^2 m: the constant that both planes have together, (P_1 + P_2)/(P_1/K_1 + P_2/K_2). What the weight
    moves the mean of both planes by is m g/(P_1 + P_2) = g/lambda^2: neither mass nor force constant."""
    out: Found = {}
    can = rig.capabilities.hold
    for way, (axis, loops) in enumerate(axes(rig).items()):
        pole = poles.get(f"pole@{axis}")
        if pole is None or can is None:
            continue
        mass = certified(can.mass, Places(rig).known[can.mass], "mass")
        ratios, free = ([found[name, loop] for loop in loops] for name in (RATIO, FREE))
        out[CONSTANT, axis] = _in("N/A", pole**2 * mass / (ratios[0] + ratios[1]))
        channels = [p.system.axes[way] for p in planes(rig)]
        up = upwards(rig, channels[0])
        if abs(up) >= ALONG_WEIGHT:
            sag = certified("site/gravity", rig.site.gravity, "gravity") * up / pole**2
            read = sag * (gain(rig, channels[0]) + gain(rig, channels[1])) * 0.5
            out[CENTRE, axis] = (free[0] + free[1]) * 0.5 - _in("m", read)
    return out


def _by_constants(found: Found, rig: RigFile, constants: Mapping[str, Estimate]) -> Found:
    """K_pull of each plane, the mean of both its axes, where its K_B was measured."""
    out: Found = {}
    for plane in planes(rig):
        if (known := constants.get(f"K_B@{plane.name}")) is not None:
            ratio = (found[RATIO, plane.loops[0]] + found[RATIO, plane.loops[1]]) * 0.5
            out[PULL, plane.name] = _in("N/m", known * ratio)
    return out
