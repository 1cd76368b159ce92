"""The bare model: flux that a moving field links with the coils of a winding, from voltages, currents and the coordinate.

A coil at phase p carries i, and

    u - v = R i + L di/dt + c + d/dt lambda,    lambda = Psi cos(phi + p - delta),   phi = per * reading

with v common to the coils of a star, c what offsets of both readings leave. Multiplied by a window w that is zero with its
slope at both ends, and integrated by parts, nothing that is read is differentiated:

    int w u = R int w i - L int w' i + c int w - int w' lambda.

So the speed is in it by the coordinate itself. Of the coils of a star the mean is taken off, and v with it. What another
current system of the same coils links of its own field, at a mover off the middle, is a constant by its own phases, and fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
TINY = 1e-10  # of a singular value, of columns scaled alike: what the data leave open is none of the flux


@dataclass(frozen=True)
class Move:
    """Of one capture: `t` (n,) s, `at` (n,) m or rad, `voltages` V and `currents` A (coils, n)."""

    t: Array
    at: Array
    voltages: Array
    currents: Array


def averaged(t: Array, at: Array, voltages: Array, currents: Array, held: int) -> Move:
    """Of readings (n,) of which a place stands for `held` samples: means over each such time, with the place in its middle. New
    places come where the reading changes."""
    changes = np.flatnonzero(np.diff(at)) + 1
    first = int(np.bincount(changes % held, minlength=held).argmax()) if changes.size else 0
    count = (t.size - first) // held
    at_new = at[first : first + held * count].reshape(count, held)[:, 0]
    middle = at_new[:-1] + (held - 1) / (2 * held) * np.diff(at_new)

    def mean(values: Array) -> Array:
        out: Array = (
            values[..., first : first + held * (count - 1)].reshape(*values.shape[:-1], count - 1, held).mean(axis=-1)
        )
        return out

    return Move(mean(t), middle, mean(voltages), mean(currents))


@dataclass(frozen=True)
class Rows:
    """Windowed equations, with the mean of each star taken off: `voltage` (windows, coils), `design` (windows, coils, terms):
    R and L and c of each coil, flux along cos and sin, then constants of the other systems' fields; `each` (windows, coils,
    coils, 2), what one coil's flux has in the equation of another of its star."""

    voltage: Array
    design: Array
    each: Array


@dataclass(frozen=True)
class Flux:
    """Psi cos delta and Psi sin delta; resistances and inductances by coil; `shares` (coils,) of the flux that each coil's
    voltage makes."""

    cos: float
    sin: float
    resistance: Array
    inductance: Array
    shares: Array
    rms: float

    @property
    def size(self) -> float:
        """Psi, Wb: the greatest that a coil links."""
        return math.hypot(self.cos, self.sin)

    @property
    def angle(self) -> float:
        """delta, rad: by how much the encoder's zero is off."""
        return math.atan2(self.sin, self.cos)


def rows(
    move: Move, per: float, phases: Array, others: Sequence[Array], stars: Sequence[Sequence[int]], window_s: float
) -> Rows:
    """Of windows that overlap by half."""
    step = float(move.t[1] - move.t[0])
    n, coils = max(4, round(window_s / step)), len(phases)
    starts = np.arange(0, move.t.size - n, max(1, n // 2))
    s = np.arange(1, n) / n
    w, slope = np.sin(np.pi * s) ** 2 * step, np.pi / n * np.sin(2 * np.pi * s)  # times the step: sums are integrals
    index = starts[:, None] + np.arange(1, n)[None, :]
    terms = 3 * coils + 2 + 2 * len(others)
    design, each = np.zeros((starts.size, coils, terms)), np.zeros((starts.size, coils, coils, 2))
    phi = per * move.at
    voltage = move.voltages[:, index] @ w
    for k, phase in enumerate(phases):
        current = move.currents[k][index]
        design[:, k, k], design[:, k, coils + k], design[:, k, 2 * coils + k] = current @ w, -(current @ slope), w.sum()
        linked = np.stack([-(f(phi + phase)[index] @ slope) for f in (np.cos, np.sin)], axis=1)
        design[:, k, 3 * coils : 3 * coils + 2] = each[:, k, k] = linked
        for j, other in enumerate(others):
            at = 3 * coils + 2 + 2 * j
            design[:, k, at : at + 2] = np.stack(
                [-(f(phi + other[k])[index] @ slope) for f in (np.cos, np.sin)], axis=1
            )
    less = _without_mean(coils, stars)
    return Rows((less @ voltage).T, np.einsum("jk,wkp->wjp", less, design), np.einsum("jk,wkcp->wjcp", less, each))


def _without_mean(coils: int, stars: Sequence[Sequence[int]]) -> Array:
    out = np.eye(coils)
    for star in stars:
        out[np.ix_(star, star)] -= 1 / len(star)
    return out


def together(parts: Sequence[Rows]) -> Rows:
    """Of several moves."""
    return Rows(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("voltage", "design", "each")))


def flux(found: Rows) -> Flux:
    """Least squares over all windows and coils."""
    coils = found.voltage.shape[1]
    x, y = found.design.reshape(-1, found.design.shape[2]), found.voltage.ravel()
    scale = np.maximum(np.sqrt((x**2).sum(axis=0)), 1e-300)
    inverse = np.linalg.pinv(x / scale, rcond=TINY) / scale[:, None]
    terms = inverse @ y
    c, s = (float(v) for v in terms[3 * coils : 3 * coils + 2])
    size = math.hypot(c, s)
    unit = (c * inverse[3 * coils] + s * inverse[3 * coils + 1]) / max(size, 1e-300)
    alone = found.each @ np.array([c, s])  # (windows, coils, coils)
    shares = unit @ alone.reshape(-1, coils) / max(size, 1e-300)
    rms = math.sqrt(float(np.mean((y - x @ terms) ** 2)))
    return Flux(c, s, terms[:coils], terms[coils : 2 * coils], shares, rms)


def by_coil(found: Rows, known: Flux) -> Array:
    """Flux of each coil (coils,) Wb, at the angle that they have together."""
    coils = found.voltage.shape[1]
    alone = found.each @ (np.array([known.cos, known.sin]) / known.size)
    rest = np.delete(found.design, [3 * coils, 3 * coils + 1], axis=2)
    x = np.concatenate([alone, rest], axis=2).reshape(-1, coils + rest.shape[2])
    scale = np.maximum(np.sqrt((x**2).sum(axis=0)), 1e-300)
    out: Array = ((np.linalg.pinv(x / scale, rcond=TINY) @ found.voltage.ravel()) / scale)[:coils]
    return out
