"""What a phase presses on load cells that hold the shaft, by the map's formula.

    F = dG/dx Q(i),   T = dG/da Q(i),   Q = i_s^2 (sqrt(1 + (i/i_s)^2) - 1)

are the slopes of the co-energy (R (9) with partial derivatives; R prints i^2/2 dL/dx, which holds only while iron does not
saturate), G = overlap times inductance per metre as `inductance_map.model` has it. What cells show, each by what its
certificates say, is

    F shown = c_x (F + k_x T/r),   T shown = c_a (T/b + k_a r F),

c a cell's gain over the stated one, b the arm over the stated one r, k what it reads of the load on the other cell. So the
shaft is where it was without currents, and as far away from there as cells yield under what they show. A current i is read as
g i + o.

Both cells tell one field: dT/dx = dF/da, whatever the map. A gain of one of them, or an arm, that is not as it is stated shows
by that; one that both have does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.inductance_map.model import mapped

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
MAP = ("slope", "unaligned", "c2", "c3", "length", "overlap", "fringe", "zero_1", "zero_2", "centre", "cosine", "sine",
       "saturation")  # fmt: skip
CELLS = ("cell_x", "cell_angle", "arm", "cross_x", "cross_angle", "give_x", "give")
PHASES = 6
EACH = ("gain", "current", "offset")
"""By phase: share of the slope, gain and offset of its current's reading."""


@dataclass(frozen=True)
class Rows:
    """Every load that was read (n,): `phase`, `place` (numbers), `current` A as read, `force` N and `torque` N m as cells show
    them less what they show without currents; of each place (m,) the readings `x` m and `angle` rad; of each phase (6,) `side`,
    `stator`, `aligned` as `stators.Phase` has them; the rotor's `poles`; `reach` m of the arm, 1 without one; `noise` (2,) of
    a load, N and N m."""

    phase: Index
    place: Index
    current: Array
    force: Array
    torque: Array
    x: Array
    angle: Array
    side: Array
    stator: Index
    aligned: Array
    poles: int
    reach: float
    noise: tuple[float, float]


@dataclass(frozen=True)
class Terms:
    """Where each kind of unknown lies in the vector: the map, cells, what each phase has, errors of encoders."""

    places: int

    def cell(self, name: str) -> int:
        """Of the cells, one by name."""
        return len(MAP) + CELLS.index(name)

    def each(self, name: str) -> slice:
        """Of six phases."""
        first = len(MAP) + len(CELLS) + PHASES * EACH.index(name)
        return slice(first, first + PHASES)

    @property
    def once(self) -> slice:
        """What the encoder around is off, rad, as the cosine and as the sine of the angle."""
        first = len(MAP) + len(CELLS) + PHASES * len(EACH)
        return slice(first, first + 2)

    @property
    def off(self) -> slice:
        """By how much the angle of a place is more than what is read, rad."""
        first = self.once.start + 2
        return slice(first, first + self.places)

    @property
    def scale(self) -> int:
        """True metres to one that is read."""
        return len(MAP) + len(CELLS) + PHASES * len(EACH) + 2 + self.places

    @property
    def count(self) -> int:
        """Of all."""
        return self.scale + 1


def q_of(current: Array, saturation: float) -> Array:
    """Integral of i/sqrt(1 + (i/s)^2) over the current, A^2."""
    out: Array = current**2 / (1 + np.sqrt(1 + (current / saturation) ** 2))
    return out


def held_at(t: Array, rows: Rows) -> tuple[Array, Array]:
    """True x m and angle rad of each load (n,): those of its place, and as far on as cells yield."""
    at, p = Terms(len(rows.x)), rows.place
    c, s = t[at.once]
    turned = rows.angle + c * np.cos(rows.angle) + s * np.sin(rows.angle) + t[at.off]
    return (rows.x * t[at.scale])[p] + t[at.cell("give_x")] * rows.force, turned[p] + t[at.cell("give")] * rows.torque


def acting(t: Array, rows: Rows) -> tuple[Array, Array]:
    """True force N and torque N m of each load (n,)."""
    at, k = Terms(len(rows.x)), rows.phase
    m = dict(zip(MAP, t, strict=False))
    x, angle = held_at(t, rows)
    _, around, along = mapped(m, t[at.each("gain")], rows, k, x, angle)
    q = q_of((rows.current - t[at.each("offset")][k]) / t[at.each("current")][k], m["saturation"])
    return along * q, around * q


def shown(t: Array, rows: Rows) -> tuple[Array, Array]:
    """Force N and torque N m of each load as cells show them."""
    at = Terms(len(rows.x))
    force, torque = acting(t, rows)
    c = {name: float(t[at.cell(name)]) for name in CELLS}
    r, arm = rows.reach, c["arm"]
    return (c["cell_x"] * force + c["cross_x"] * torque / (r * arm),
            c["cell_angle"] * torque / arm + c["cross_angle"] * r * force)  # fmt: skip
