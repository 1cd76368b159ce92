"""The map's formula, and what readings make of it.

    psi = L_l i + G i/sqrt(1 + (i/i_s)^2),    G = ov(o) Lam(d) [1 + p cos a + q sin a]
    o = overlap + side (x - centre),    ov = [l + sqrt(o^2 + w^2) - sqrt((o - l)^2 + w^2)]/2
    Lam = slope gain [u + (1 - u) f],   f = (h(d) - h(quarter))/(h(0) - h(quarter)),   h = cos Nd + c2 cos 2Nd + c3 cos 3Nd

d is the angle from where the phase is aligned, N the poles of the rotor, `quarter` half a pole's pitch, where phases are
unaligned; a is the angle itself, and p, q what turns once with it. A lock that gives way by c rad for a N m lets the rotor
turn by c T, T = dG/da Q(i), Q = i_s^2 (sqrt(1 + (i/i_s)^2) - 1), and likewise along. G is that of where
it comes to by the current of the sample before: it takes a while.

Each phase has its own L_l and i_s. With readings g_i i and g_u u of current and voltage (g_u psi follows, `pulses`) L_l
g_u/g_i, gain g_u/g_i and g_i i_s fit as well as the true ones: gains of readings cost the fit nothing, and are put right after
it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
MAP = ("slope", "unaligned", "c2", "c3", "length", "overlap", "fringe", "zero_1", "zero_2", "centre", "cosine", "sine", "give",
       "give_x")  # fmt: skip
PHASES = 6
YIELDS = 2
EACH = ("gain", "leakage", "saturation", "offset_up", "offset_down", "offset_u")
"""By phase: share of the slope, L_l, i_s; offsets of a current's reading up and down, and of a voltage's."""


@dataclass(frozen=True)
class Rows:
    """Every sample of every flank (n,): `phase`, `place` (numbers), `down` (1 on the way down), current and flux as read, the
    current a sample `before`,
    factors of offsets; of each place (m,) the readings `x` m and `angle` rad; of each phase (6,) `side` (-1, 1: towards which
    its stator draws), `stator` (0, 1), `aligned` rad; the rotor's `poles`; `noise` of a current, A."""

    phase: Index
    place: Index
    down: Array
    current: Array
    before: Array
    flux: Array
    late: Array
    lean: Array
    lag: Array
    x: Array
    angle: Array
    side: Array
    stator: Index
    aligned: Array
    poles: int
    noise: float = 0.0


class Phases(Protocol):
    """Six phases, each (6,): `side`, `stator` and `aligned`, as `Rows` has them; the rotor's `poles`."""

    @property
    def side(self) -> Array: ...
    @property
    def stator(self) -> Index: ...
    @property
    def aligned(self) -> Array: ...
    @property
    def poles(self) -> int: ...


@dataclass(frozen=True)
class Terms:
    """Where each kind of unknown lies in the vector: the map, what each phase has, errors of encoders."""

    places: int

    def each(self, name: str) -> slice:
        """Of six phases."""
        first = len(MAP) + PHASES * EACH.index(name)
        return slice(first, first + PHASES)

    @property
    def once(self) -> slice:
        """What the encoder is off, rad, as the cosine and as the sine of the angle."""
        first = len(MAP) + PHASES * len(EACH)
        return slice(first, first + 2)

    @property
    def off(self) -> slice:
        """By how much the angle of a place is more than what is read, rad."""
        return slice(self.once.stop, self.once.stop + self.places)

    @property
    def along(self) -> slice:
        """By how much x is, m."""
        return slice(self.off.stop, self.off.stop + self.places)

    @property
    def scale(self) -> int:
        """True metres to one that is read."""
        return len(MAP) + PHASES * len(EACH) + 2 + 2 * self.places

    @property
    def count(self) -> int:
        """Of all."""
        return self.scale + 1


def overlapped(o: Array, length: float, fringe: float) -> Array:
    """How much of a stack the mover is in, m."""
    out: Array = 0.5 * (length + np.hypot(o, fringe) - np.hypot(o - length, fringe))
    return out


def angular(d: Array, unaligned: float, c2: float, c3: float, poles: int) -> tuple[Array, Array]:
    """u + (1 - u) f and its slope by the angle."""
    n = poles
    h = np.cos(n * d) + c2 * np.cos(2 * n * d) + c3 * np.cos(3 * n * d)
    slope = -n * (np.sin(n * d) + 2 * c2 * np.sin(2 * n * d) + 3 * c3 * np.sin(3 * n * d))
    lowest, swing = -1 + c2 - c3, (1 - unaligned) / (2 + 2 * c3)
    return unaligned + swing * (h - lowest), swing * slope


def advance(o: Array, length: float, fringe: float) -> Array:
    """Its slope by o."""
    out: Array = 0.5 * (o / np.hypot(o, fringe) - (o - length) / np.hypot(o - length, fringe))
    return out


def places(t: Array, rows: Rows) -> tuple[Array, Array]:
    """True x m and angle rad of each place, by what the encoders read and are off."""
    at = Terms(len(rows.x))
    c, s = t[at.once]
    turned = rows.angle + c * np.cos(rows.angle) + s * np.sin(rows.angle) + t[at.off]
    return rows.x * t[at.scale] + t[at.along], turned


def mapped(
    m: Mapping[str, float], gain: Array, of: Phases, k: Index, x: Array, angle: Array
) -> tuple[Array, Array, Array]:
    """G H of phases `k` at places `x` m and `angle` rad (which go with `k`), dG/da and dG/dx, by the map's terms `m` and each
    phase's `gain`."""
    side = of.side[k]
    d = angle - of.aligned[k] - np.where(of.stator[k] == 0, m["zero_1"], m["zero_2"])
    o = m["overlap"] + side * (x - m["centre"])
    over, rise = overlapped(o, m["length"], m["fringe"]), advance(o, m["length"], m["fringe"])
    lam, bend = angular(d, m["unaligned"], m["c2"], m["c3"], of.poles)
    c, s = np.cos(angle), np.sin(angle)
    even, turn = 1 + m["cosine"] * c + m["sine"] * s, m["sine"] * c - m["cosine"] * s
    whole = m["slope"] * gain[k]
    return whole * over * lam * even, whole * over * (bend * even + lam * turn), whole * side * rise * lam * even


def inductance(t: Array, rows: Rows, x: Array, angle: Array, k: Index) -> tuple[Array, Array, Array]:
    """As `mapped`, by the terms of a fit."""
    return mapped(dict(zip(MAP, t, strict=False)), t[Terms(len(rows.x)).each("gain")], rows, k, x, angle)


def flux(t: Array, rows: Rows) -> Array:
    """Of every sample as it is read, Wb (n,)."""
    m, at, k = dict(zip(MAP, t, strict=False)), Terms(len(rows.x)), rows.phase
    up, down = t[at.each("offset_up")][k], t[at.each("offset_down")][k]
    i, down_too = rows.current - np.where(rows.down > 0, down, up), np.where(rows.down > 0, down, 0.0)
    saturation = t[at.each("saturation")][k]
    root, earlier = np.sqrt(1 + (i / saturation) ** 2), rows.before - np.where(rows.down > 0, down, up)
    q = earlier**2 / (1 + np.sqrt(1 + (earlier / saturation) ** 2))
    x, angle = (values[rows.place] for values in places(t, rows))
    g, around, along = inductance(t, rows, x, angle, k)
    for _ in range(YIELDS):  # the lock gives way to where force and torque are those of that place
        g, around, along = inductance(t, rows, x + m["give_x"] * along * q, angle + m["give"] * around * q, k)
    psi = t[at.each("leakage")][k] * i + g * i / root
    out: Array = psi + t[at.each("offset_u")][k] * rows.late + up * rows.lean + down_too * rows.lag
    return out
