"""A rational function of frequency fitted to a few lines about a resonance, and the greatest abs of it with its covariance.

z(u) = (b_0 + b_1 u + ...)/(1 + a_1 u + ...), u in -1..1 over the lines: in a band, the frequency response of a linear
system, a pole for each resonance in it, the rest in the other terms. First by the iteration of Sanathanan and Koerner
(IEEE Trans. AC-8, 56 (1963)), then by Levenberg and Marquardt's; of several orders the one that Akaike's criterion takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from bench.analysis.sampling import Array, Complex
from bench.errors import AnalysisError

ORDERS = ((3, 1), (3, 2), (4, 2), (4, 3), (5, 3), (6, 4))  # terms in u above and below
POINTS, DRAWS = 201, 300
STEPS = 40  # of the descent, at most
STRONG = 0.25  # share of a curve that a pole must give to be a resonance


@dataclass(frozen=True)
class Rational:
    """`above` (n + 1,) and `below` (d,) of z(u), u = (x - middle)/half; `covariance` (p, p) of these terms, circular; `misfit`,
    mean square of the residuals over their expectation, `probability` that noise alone gives as much; `dof` of the noise."""

    middle: float
    half: float
    above: Complex
    below: Complex
    covariance: Complex
    misfit: float
    probability: float
    dof: float

    def at(self, x: Array) -> Complex:
        """Values (m,) at `x` (m,)."""
        return _evaluated(self.above, self.below, (x - self.middle) / self.half)

    def width(self, near: float) -> float:
        """Half-power width of the resonance at `near`: twice the imaginary part of the nearest pole that gives the curve there
        a quarter of its value or more; infinite where there is none. Poles that a zero cancels give nothing."""
        poles = np.roots([*self.below[::-1], 1.0])
        if not poles.size:
            return np.inf
        u = (near - self.middle) / self.half
        slopes = np.polyval(np.polyder([*self.below[::-1], 1.0]), poles)
        share = np.abs(np.polyval(self.above[::-1], poles) / slopes / (u - poles)) / np.abs(self.at(np.array([near])))
        strong = poles[share > STRONG]
        return float(2 * self.half * abs(strong[int(np.abs(strong - u).argmin())].imag)) if strong.size else np.inf


@dataclass(frozen=True)
class Top:
    """Greatest abs of a fitted curve: `value`, freed of the `bias` that noise gives a maximum, its standard uncertainty `u`;
    `at`, where, with `u_at`; half-power `width` of its resonance; `inside`, whether it lies within the lines."""

    value: float
    u: float
    bias: float
    at: float
    u_at: float
    width: float
    inside: bool


def fitted(x: Array, z: Complex, power: Array, dof: float) -> Rational:
    """Of lines `z` (m,) at `x` (m,) whose noise has the mean square `power` (m,), known with `dof` degrees of freedom.

    Raises:
        AnalysisError: fewer than six lines.
    """
    if x.size < 6 or z.shape != x.shape or power.shape != x.shape:
        raise AnalysisError(
            f"rational model: found {x.size} lines and {power.size} variances; expected six or more of each"
        )
    middle, half = (x[0] + x[-1]) / 2, (x[-1] - x[0]) / 2
    u, root = (x - middle) / half, 1 / np.sqrt(np.maximum(power, 1e-300))
    best, least = None, np.inf
    for n, d in ORDERS:
        left = 2 * (x.size - n - d - 1)
        if left < 4 or (best is not None and left < 10):
            break
        above, below, slopes = _solved(u, z, root, n, d)
        chi2 = 2 * float((np.abs((z - _evaluated(above, below, u)) * root) ** 2).sum())
        if (told := chi2 + 4 * (n + d)) >= least or (best is not None and _hides(below, u)):
            continue
        chance = float(chdtrc(left, chi2) if np.isinf(dof) else fdtrc(left, max(dof, 1.0), chi2 / left))
        covariance = np.asarray(np.linalg.pinv(slopes.conj().T @ slopes), np.complex128)
        best, least = Rational(float(middle), float(half), above, below, covariance, chi2 / left, chance, dof), told
    assert best is not None
    return best


def _hides(below: Complex, u: Array) -> bool:
    """Whether a pole stands between the lines, narrower than they can show: noise makes such poles."""
    poles = np.roots([*below[::-1], 1.0])
    return bool(((np.abs(poles.real) < 1) & (2 * np.abs(poles.imag) < np.diff(u).max())).any())


def top(model: Rational, low: float, high: float, seed: int = 0) -> Top:
    """The greatest abs between two places. Noise of the model's covariance, drawn onto the curve, gives bias and spread."""
    x = np.linspace(low, high, POINTS)
    z = model.at(x)
    slopes = _slopes(model.above, model.below, (x - model.middle) / model.half)
    values, vectors = np.linalg.eigh(model.covariance)
    normal = np.random.default_rng(seed).standard_normal((2, DRAWS, values.size))
    terms = ((normal[0] + 1j * normal[1]) * np.sqrt(np.maximum(values, 0) / 2)) @ vectors.T
    sizes = np.abs(z + terms @ slopes.T)
    k = int(np.abs(z).argmax())
    found, places = _crest(x, np.abs(z)[None])
    drawn, at = _crest(x, sizes)
    bias = float(drawn.mean() - found[0])
    inside = 0 < k < POINTS - 1
    return Top(
        float(found[0] - bias),
        float(drawn.std()),
        bias,
        float(places[0]),
        float(at.std()),
        model.width(float(places[0])),
        inside,
    )


def _crest(x: Array, size: Array) -> tuple[Array, Array]:
    """Greatest of curves (c, m) and where, by a parabola through the greatest point and its neighbours."""
    k = np.clip(size.argmax(axis=1), 1, x.size - 2)
    rows = np.arange(len(size))
    a, b, c = size[rows, k - 1], size[rows, k], size[rows, k + 1]
    bend = np.minimum(a - 2 * b + c, -1e-300)
    shift = np.clip((a - c) / (2 * bend), -1, 1)
    return b - (a - c) * shift / 4, x[k] + shift * (x[1] - x[0])


def _evaluated(above: Complex, below: Complex, u: Array) -> Complex:
    out: Complex = np.polyval(above[::-1], u) / np.polyval([*below[::-1], 1.0], u)
    return out


def _slopes(above: Complex, below: Complex, u: Array) -> Complex:
    """Derivatives (m, p) of the values to the terms above and below."""
    under = np.polyval([*below[::-1], 1.0], u)
    value = np.polyval(above[::-1], u) / under
    up = [u**k / under for k in range(above.size)]
    down = [-value * u**k / under for k in range(1, below.size + 1)]
    return np.array([*up, *down]).T


def _solved(u: Array, z: Complex, root: Array, n: int, d: int) -> tuple[Complex, Complex, Complex]:
    """Terms above (n + 1,), below (d,), and the weighted slopes at the solution."""
    weight = root.astype(complex)
    above, below = np.zeros(n + 1, complex), np.zeros(d, complex)
    for _ in range(12):
        columns = [u**k for k in range(n + 1)] + [-z * u**k for k in range(1, d + 1)]
        terms = np.linalg.lstsq(np.array(columns).T * weight[:, None], z * weight, rcond=None)[0]
        above, below = terms[: n + 1], terms[n + 1 :]
        weight = root / np.polyval([*below[::-1], 1.0], u)
    terms = np.concatenate([above, below])
    return _descended(u, z, root, terms, n)


def _descended(u: Array, z: Complex, root: Array, terms: Complex, n: int) -> tuple[Complex, Complex, Complex]:
    """Levenberg and Marquardt's steps from there: without their damping, noisy lines do not reach the least squares."""

    def left(t: Complex) -> Complex:
        return np.asarray((z - _evaluated(t[: n + 1], t[n + 1 :], u)) * root)

    damping, miss = 1e-3, left(terms)
    slopes = _slopes(terms[: n + 1], terms[n + 1 :], u) * root[:, None]
    for _ in range(STEPS):
        normal = slopes.conj().T @ slopes
        eased = normal + damping * np.diag(np.diag(normal))
        moved = terms + np.linalg.lstsq(eased, slopes.conj().T @ miss, rcond=None)[0]
        again = left(moved)
        before, after = float((np.abs(miss) ** 2).sum()), float((np.abs(again) ** 2).sum())
        if not after < before:
            damping = min(damping * 8, 1e8)
            continue
        terms, miss, damping = moved, again, damping / 8
        slopes = _slopes(terms[: n + 1], terms[n + 1 :], u) * root[:, None]
        if before - after < 1e-6 * after:
            break
    return terms[: n + 1], terms[n + 1 :], slopes
