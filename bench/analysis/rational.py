"""A rational function of frequency fitted to a few lines about a resonance, and the greatest abs of it with its covariance.

z(u) = (b_0 + b_1 u + ...)/(1 + a_1 u + ...), u in -1..1 over the lines: in a band, the frequency response of a linear
system, a pole for each resonance in it, the rest in the other terms. First by the iteration of Sanathanan and Koerner
(IEEE Trans. AC-8, 56 (1963)), then by Levenberg and Marquardt's. Several orders may explain the lines; what they differ by is
part of what is not known. They are averaged with Akaike's weights, the spread between them added to their own (Burnham and
Anderson, Model Selection and Multimodel Inference, 2nd ed., 4.2 and 4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.analysis.sampling import Array, Complex
from bench.errors import AnalysisError

ORDERS = ((3, 1), (3, 2), (4, 2), (4, 3), (5, 3), (6, 4))  # terms in u above and below
POINTS, DRAWS = 201, 300
LEAST = 7  # lines, which the first of the orders takes
STEPS = 40  # of the descent, at most
NEGLIGIBLE = 1e-3  # weight of an order
STRONG = 0.25  # share of a curve that a pole must give to be a resonance


@dataclass(frozen=True)
class Rational:
    """`above` (n + 1,) and `below` (d,) of z(u), u = (x - middle)/half; `covariance` (p, p) of these terms, circular; `misfit`,
    mean square of the residuals over their expectation, `probability` that noise alone gives as much; `dof` of the noise;
    `akaike`, the criterion by which orders are weighed, less is better."""

    middle: float
    half: float
    above: Complex
    below: Complex
    covariance: Complex
    misfit: float
    probability: float
    dof: float
    akaike: float

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
    """By the order that Akaike's criterion takes, of lines `z` (m,) at `x` (m,) whose noise has the mean square `power` (m,),
    known with `dof` degrees of freedom.

    Raises:
        AnalysisError: fewer than seven lines.
    """
    return orders(x, z, power, dof)[0]


def orders(x: Array, z: Complex, power: Array, dof: float) -> list[Rational]:
    """All orders that the lines can carry, the likeliest first; arguments and errors as those of `fitted`. One with a pole
    between two lines, narrower than they can show, is passed over: noise makes such poles."""
    from scipy.special import chdtrc, fdtrc

    if x.size < LEAST or z.shape != x.shape or power.shape != x.shape:
        raise AnalysisError(
            f"rational model: found {x.size} lines and {power.size} variances; expected seven or more of each"
        )
    middle, half = float(x[0] + x[-1]) / 2, float(x[-1] - x[0]) / 2
    u, root = (x - middle) / half, 1 / np.sqrt(np.maximum(power, 1e-300))
    out: list[Rational] = []
    for n, d in ORDERS:
        left = 2 * (x.size - n - d - 1)
        if left < 4 or (out and left < 10):
            break
        above, below, slopes = _solved(u, z, root, n, d)
        if out and _hides(below, u):
            continue
        chi2 = 2 * float((np.abs((z - _evaluated(above, below, u)) * root) ** 2).sum())
        chance = float(chdtrc(left, chi2) if np.isinf(dof) else fdtrc(left, max(dof, 1.0), chi2 / left))
        covariance = np.asarray(np.linalg.pinv(slopes.conj().T @ slopes), np.complex128)
        out.append(Rational(middle, half, above, below, covariance, chi2 / left, chance, dof, chi2 + 4 * (n + d)))
    return sorted(out, key=lambda model: model.akaike)


def _hides(below: Complex, u: Array) -> bool:
    """Whether a pole stands between the lines, narrower than they can show."""
    poles = np.roots([*below[::-1], 1.0])
    return bool(((np.abs(poles.real) < 1) & (2 * np.abs(poles.imag) < np.diff(u).max())).any())


def top(model: Rational, low: float, high: float, seed: int = 0) -> Top:
    """The greatest abs between two places. Noise of the model's covariance, drawn onto the curve, gives bias and spread."""
    x = np.linspace(low, high, POINTS)
    z, sizes = model.at(x), np.abs(drawn_curves(model, x, seed))
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


def averaged(models: Sequence[Rational], low: float, high: float) -> Top:
    """The greatest abs by several orders of the same lines: means with Akaike's weights, `u` with the spread between the
    orders; width, and whether it lies inside, by the first of them."""
    kept = [(w, top(m, low, high)) for w, m in weighed(models)]
    weight, tops = np.array([w for w, _ in kept]) / sum(w for w, _ in kept), [t for _, t in kept]
    value, u, bias, at, u_at = np.array([(t.value, t.u, t.bias, t.at, t.u_at) for t in tops]).T

    return Top(
        *pooled(weight, value, u), float(weight @ bias), *pooled(weight, at, u_at), tops[0].width, tops[0].inside
    )


def weighed(models: Sequence[Rational]) -> list[tuple[float, Rational]]:
    """Akaike's weights of several orders of the same lines; those that say nothing are left out."""
    told = np.array([model.akaike for model in models])
    share = np.exp((told.min() - told) / 2)
    share /= share.sum()
    return [(float(w), m) for w, m in zip(share, models, strict=True) if w > NEGLIGIBLE]


def pooled(weight: Array, means: Array, spreads: Array) -> tuple[float, float]:
    """Weighted mean of several models, and its standard uncertainty with the spread between them."""
    mean = float(weight @ means)
    return mean, float(np.sqrt(weight @ (spreads**2 + (means - mean) ** 2)))


def drawn_curves(model: Rational, x: Array, seed: int = 0) -> Complex:
    """Curves (DRAWS, m) at `x` (m,): the model's, onto which noise of its covariance is drawn."""
    slopes = _slopes(model.above, model.below, (x - model.middle) / model.half)
    values, vectors = np.linalg.eigh(model.covariance)
    normal = np.random.default_rng(seed).standard_normal((2, DRAWS, values.size))
    terms = ((normal[0] + 1j * normal[1]) * np.sqrt(np.maximum(values, 0) / 2)) @ vectors.T
    return np.asarray(model.at(x) + terms @ slopes.T)


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
