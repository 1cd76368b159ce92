"""The bare model: currents and loads of the motor around a circle, and what balancing makes of them; arrays in, arrays out.

Complex numbers are horizontal + j up; currents are those along the field. T (6.5) for currents w = chi i_x + j i_y that act,
with the field turned by gamma: F = alpha_d (cos M g + j/r sin M g) w, g = gamma - gamma_0, r = alpha_d/alpha_c. So phi of T
(6.27) turns and alpha_eff scales them, and nothing else is in T (6.28).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
NEAR = 0.02  # of a turn to either side of a peak, through which a parabola is laid
AGAIN = 200  # draws of the turns
ORDERS = 2  # harmonics of the circle that the deviation from it is looked at with
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Law:
    """How the phase angle is led: turns of the circle in a second (negative: backwards), its slew rad/s, its bound rad, the
    sign of i_x as against that of i_y."""

    hz: float
    slew: float
    limit: float
    branch: int


@dataclass(frozen=True)
class Balanced:
    """What balancing should make of a load: `gamma` (bins,) rad, and `current` (bins,), true A."""

    gamma: Array
    current: Complex


def true(i: Complex, p: Numbers) -> Complex:
    """True currents of what the sensors read: an amplifier closes its loop on its own sensor, and opposite segments carry
    opposite currents, so that gains and offsets act by pairs."""
    ax, bx, ay, by = pairs(p)
    return ax * i.real - bx + 1j * (ay * i.imag - by)


def pairs(p: Numbers) -> tuple[float, float, float, float]:
    """Factor and zero of i_x, then of i_y, by the gains and offsets of the segments' sensors."""
    g = {k: 1 / p[f"gain_m{k}"] for k in range(1, 5)}
    o = {k: p[f"offset_m{k}"] * g[k] for k in range(1, 5)}
    return (g[4] + g[2]) / 2, (o[4] - o[2]) / 2, (g[1] + g[3]) / 2, (o[1] - o[3]) / 2


def factor(gamma: Array | float, p: Numbers) -> Complex:
    """Force over alpha_d and acting current (n,), alpha_eff e^(j phi)/alpha_d."""
    angle = p["pole_pairs"] * (np.asarray(gamma) - p["gamma_0"])
    out: Complex = np.cos(angle) + 1j / p["ratio"] * np.sin(angle)
    return out


def acting(i: Complex, p: Numbers) -> Complex:
    """What acts of true currents: the x winding's constant may be another than the y winding's."""
    return p["chi"] * i.real + 1j * i.imag


def load(read: Complex, gamma: Array | float, p: Numbers) -> Complex:
    """Load on the motor (n,) N: what its force holds."""
    out: Complex = -p["alpha_d"] * factor(gamma, p) * acting(true(read, p), p)
    return out


def balanced(d: Complex, law: Law, p: Numbers) -> Balanced:
    """T (6.36), (6.37) on a load `d` (bins,) N, without dynamics: the field is turned until the controller's i_x and i_y are
    alike, within the bound, no faster than the slew, on its branch."""
    needed = -d / p["alpha_d"]
    goal = _equal(needed, law.branch, p)
    period = 2 * math.pi / p["pole_pairs"]
    goal = np.clip((goal + period / 2) % period - period / 2, -law.limit, law.limit)
    gamma = _followed(goal, law)
    w = needed / factor(gamma, p)
    return Balanced(gamma, w.real / p["chi"] + 1j * w.imag)


def _equal(needed: Complex, branch: int, p: Numbers) -> Array:
    """gamma (n,) at which the readings of i_x and i_y are alike."""
    turned, size = np.zeros(len(needed)), np.abs(needed)
    for _ in range(4):  # the size counts by the sensors' zeros alone
        way = acting(true(size * complex(branch, 1) / math.sqrt(2), p), p)
        phi = np.angle(needed) - np.angle(way)
        turned = np.arctan2(p["ratio"] * np.sin(phi), np.cos(phi))
        size = np.abs(needed) / np.hypot(np.cos(turned), np.sin(turned) / p["ratio"])
    out: Array = turned / p["pole_pairs"] + p["gamma_0"]
    return out


def _followed(goal: Array, law: Law) -> Array:
    """What a slew makes of it in the second turn, in the way in which the circle goes."""
    step = law.slew / (abs(law.hz) * len(goal))
    way = goal if law.hz > 0 else goal[::-1]
    if np.abs(np.diff(way, append=way[0])).max() <= step:
        return goal
    gamma, out = float(way[0]), np.empty_like(way)
    for _ in range(2):
        for k, to in enumerate(way):
            gamma += min(max(float(to) - gamma, -step), step)
            out[k] = gamma
    return out if law.hz > 0 else out[::-1]


def peak(x: Array, at: int | None = None) -> float:
    """Greatest of what (bins,) are means of around a circle, by a parabola through those near it: the largest of many noisy
    values is too large, by sigma sqrt(2 ln n); a parabola through m of them is so by some millionth. The mean over a bin at the
    top is lower than the top by a twelfth of the second coefficient, 7 parts in 100 000 with the widest bins. `at`: where it
    is."""
    k = int(np.argmax(x)) if at is None else at
    reach = max(round(NEAR * len(x)), 2)
    s = np.arange(-reach, reach + 1)
    c2, c1, c0 = np.polyfit(s, np.take(x, k + s, mode="wrap"), 2)
    if c2 >= 0 or abs(c1) > -2 * c2 * reach:  # a corner: there is no smooth top
        return float(x[k])
    return float(c0 - c1**2 / (4 * c2) - c2 / 12)


def smooth(x: Array) -> Array:
    """The harmonics up to ORDERS of values (..., bins) around a circle."""
    spectrum = np.fft.rfft(x)
    spectrum[..., ORDERS + 1 :] = 0
    out: Array = np.fft.irfft(spectrum, x.shape[-1])
    return out


def off_circle(distance: Array, radius: float) -> float:
    """Greatest deviation of distances (turns, bins) in the mean from a circle's radius, m. The greatest of noisy values is
    too large; by how much is seen in turns that are drawn from these again and again (Efron's bootstrap), and taken off."""
    off = smooth(distance - radius)
    found = float(np.abs(off.mean(axis=0)).max())
    n = len(off)
    if n < 2:
        return found
    drawn = np.random.default_rng(n).multinomial(n, np.full(n, 1 / n), AGAIN) / n
    return 2 * found - float(np.abs(drawn @ off).max(axis=1).mean())


def share(x: Array, y: Array, noise: tuple[float, float] = (0.0, 0.0)) -> float:
    """rms(|x| - |y|) over rms(|x| + |y|), less the mean squares that noise adds to either."""
    a, b = np.abs(x), np.abs(y)
    apart = max(float(((a - b) ** 2).mean()) - noise[0], 0.0)
    return math.sqrt(apart / max(float(((a + b) ** 2).mean()) - noise[1], 1e-30))
