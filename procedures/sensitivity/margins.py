"""Margins of an open loop L = 1/S - 1 by the sensitivity S at the lines of a survey. All functions are pure.

Each is where a curve crosses a line, and noise makes crossings of its own: what is between the lines has to be smooth.
Where |L| is 1, S is large and its local rational models are that. The gain may fall where the integrator bends the loop
from one line to the next: hz times L goes through a few of them. It may rise where S is nearly 1 and L is small and noisy:
many lines to either side make one polynomial of the logarithm of the frequency.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.analysis import peaks, rational
from bench.analysis.responses import Response
from bench.uncertainty import Estimate, Influence
from procedures.sensitivity.steps import Taken

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DRAWS = 150
DRAWN = 4  # points of a curve for each line about a bending mode
TOLERATED = 0.05  # share of the draws that may have no crossing
VAGUE = 0.2  # relative standard uncertainty above which a margin is not told
# Standard uncertainties, by which draws may lie beside the curve they were drawn about: where models of noisy lines have poles
# of their own, another crossing is the nearest one in most draws, and what they differ by is no bias of the one that was found.
LEANS = 2.0
FAINT = 0.1  # where |L| is less, it is noise that crosses the axis: a gain that may rise tenfold is not told
LOW, NODES, BETWEEN = 12, 4, 20  # lines between which the loop is bent, how many make a curve, points of it in a step
# Of the crossing's frequency, to either side, and degree of the polynomial of ln f: for lines of a comb, and where six lines
# are an octave. There, without noise, degree 3 puts the gain to which the plain stand's loop may rise 1.5 % too high over the
# widest reach, degree 5 0.14 %; degree 4 and 3 over the others 0.3 and 0.8 %.
DEGREE = 3
REACHES = ((1.8, DEGREE), (1.5, DEGREE), (1.3, DEGREE))
OF_SINES = ((3.0, 5), (2.5, 4), (2.1, 3))
ABOUT = 1.5  # of the frequency where |L| is 1: lines by which single sines' phase margin is told
MISFIT = 3.0  # standard deviations of its chi-squared over what noise explains: a bending mode is among the lines
HIDDEN = 4.0  # a circle whose half-power width is less than that share of a step between lines is not looked for
UNEXPLAINED = (
    1e-3  # chance that the lines about the modes of an axis are so badly explained by their models, all together
)


def margins(surveys: Sequence[Taken], where: str, modes: Sequence[Taken] = ()) -> dict[str, Estimate]:
    """Phase margin and both gain margins by the lines of the survey, those that exist and are told from noise; the gain that
    may rise also by the lines about bending `modes`, whose circles reach across the axis."""
    if not surveys:
        return {}
    hz, z, power = merged([(t.response, t.noise) for t in surveys])
    if hz.size < peaks.WINDOW:
        return {}
    covariance = power[:, None, None] / 2 * np.eye(2)
    alone = all(t.step_hz == 0 for t in surveys)
    smooth = peaks.smoother(hz, z, covariance, about=[] if alone else _evens(hz, z, covariance))
    base, drawn = smooth.at_lines(z), peaks.noise(covariance, 0, DRAWS)
    seen = smooth.everywhere(z), smooth.everywhere(base), smooth.everywhere(base + drawn)
    found = {
        "phase_margin": (
            "rad",
            _modelled(smooth.x, seen[0], (hz, z, power)) if alone else _told(seen, lambda s: phase(1 / s - 1)),
        ),
        # about the curve as it is seen: the local models follow it less well where it ends
        "gain_reduction": ("1", _told((z, z, z + drawn), lambda s: fall(between(hz, 1 / s - 1)))),
        "gain_increase": ("1", _least(hz, z, base, power, drawn, smooth, OF_SINES if alone else REACHES)),
    }
    dof = {name: max(float(min(t.dof for t in surveys)), 1.0) for name in found}
    for t in modes:
        of, nearest = of_mode(t), found["gain_increase"][1]
        if of is not None and (nearest is None or of[0] > nearest[0]):
            found["gain_increase"], dof["gain_increase"] = ("1", of), max(t.dof, 1.0)
    dof["gain_reduction"] = max(float(min(t.dof_at_ends for t in surveys)), 1.0)
    out = {}
    for name, (unit, of) in found.items():
        if of is not None:
            identity = f"scatter/{where}/{name}"
            out[name] = Estimate.of(
                of[0], Influence(identity, "noise of the lines", of[1], unit, "A", "normal", dof[name])
            )
    if "gain_increase" in out:  # that of L is what scatters alike to both sides
        out["gain_increase"] = replace(1 / out["gain_increase"], unit="1")
    return out


def _evens(hz: Array, z: Complex, covariance: Array) -> list[float]:
    """Frequencies where |L| is 1, by local models of the fewest lines: where S has its greatest value at 300 Hz and one nearly
    as great and narrower at 54 Hz, models as wide as the first allows put the phase margin a third too high."""
    fine = peaks.smoother(hz, z, covariance, peaks.WINDOW)
    loop = 1 / fine.everywhere(z) - 1
    return [float(f) for f in _crossings(np.abs(loop) - 1, fine.x.astype(np.complex128)).real]


def of_mode(t: Taken) -> tuple[float, float] | None:
    """|L| where the circle of a bending mode crosses the negative real axis farthest out, and its u, by rational models of
    the lines about it; None where it does not cross there."""
    if t.response.hz.size < rational.LEAST:
        return None
    return _by_models(_models(t), _fine(t), lambda s: 1 / rise(1 / s - 1))


def hides(t: Taken, nearest: float, chance: float) -> bool:
    """Whether lines about a bending mode hide a circle that may cross the negative real axis farther out than `nearest`, |L|.

    Something is there that no polynomial explains, and either the likeliest model crosses the axis, but how far out is not
    told from noise; or no model explains the lines (`chance` by which noise alone may ask for more), as where a circle lies
    between two of them. What is left at the nearer one is then its diameter times its width over twice the distance: a
    HIDDEN-th of the diameter or more, where the width is at least that share of a step.
    """
    r = t.response
    if r.hz.size < rational.LEAST or _smooth(t) > chance:
        return False
    best = _models(t)[0]
    vague = of_mode(t) is None and 1 / rise(1 / best.at(_fine(t)) - 1) > nearest
    left = float(np.abs((r.values - best.at(r.hz)) / r.values**2).max())  # of L
    return vague or (best.probability < chance and HIDDEN * left > nearest)


def modelled(t: Taken) -> Response:
    """Lines about a bending mode as their likeliest model has them, where one explains them: for pictures."""
    if t.response.hz.size < rational.LEAST or (best := _models(t)[0]).probability < UNEXPLAINED:
        return t.response
    fine = np.linspace(t.response.hz[0], t.response.hz[-1], DRAWN * t.response.hz.size)
    return Response(fine, best.at(fine), np.zeros((fine.size, 2, 2)), np.ones(fine.size), t.response.dof)


def _smooth(t: Taken) -> float:
    """The chance that noise alone leaves the lines as far from a polynomial as they are."""
    from scipy.special import fdtrc

    r, root = t.response, 1 / np.sqrt(t.noise)
    x = (r.hz - r.hz.mean()) / np.ptp(r.hz)
    terms, _ = np.linalg.qr(np.vander(x, DEGREE + 1) * root[:, None])
    z = r.values * root
    left = 2 * (r.hz.size - DEGREE - 1)
    chi2 = 2 * float((np.abs(z - terms @ (terms.T @ z)) ** 2).sum())
    return float(fdtrc(left, max(t.dof, 1.0), chi2 / left)) if left > 0 else 1.0


def _models(t: Taken) -> list[rational.Rational]:
    return rational.orders(t.response.hz, t.response.values, t.noise, t.dof)


def _fine(t: Taken) -> Array:
    """Twenty places for each line."""
    return np.linspace(t.response.hz[0], t.response.hz[-1], 20 * t.response.hz.size)


def merged(parts: Sequence[tuple[Response, Array]]) -> tuple[Array, Complex, Array]:
    """Lines of several responses in order of frequency, with their noise; of those that coincide the last one counts."""
    hz = np.concatenate([r.hz for r, _ in parts])
    z = np.concatenate([r.values for r, _ in parts])
    power = np.concatenate([p for _, p in parts])
    kept = {float(f): k for k, f in enumerate(hz)}
    order = np.array([kept[f] for f in sorted(kept)])
    return hz[order], z[order], power[order]


def _told(curves: tuple[Complex, Complex, Complex], of: Callable[[Complex], float]) -> tuple[float, float] | None:
    """A margin of a curve (m,), freed of the bias that draws (d, m) about its smoothed one (m,) show, and its u."""
    seen, base, drawn = curves
    found, again, values = of(seen), of(base), np.array([of(each) for each in drawn])
    return _freed(found, again, values)


def _modelled(x: Array, seen: Complex, lines: tuple[Array, Complex, Array]) -> tuple[float, float] | None:
    """The phase margin of lines that stand unevenly, and its u: by rational models of those about where |L| is 1, which the
    smoothed curve `seen` at `x` shows. Local models of as many lines would reach over octaves beside a refined peak."""
    at = (
        _crossings(np.abs(1 / seen - 1) - 1, 1 / seen - 1),
        _crossings(np.abs(1 / seen - 1) - 1, x.astype(np.complex128)).real,
    )
    if not at[0].size:
        return None
    middle = float(at[1][int(np.abs(np.angle(-at[0])).argmin())])
    near = (lines[0] > middle / ABOUT) & (lines[0] < middle * ABOUT)
    hz = lines[0][near]
    if hz.size < rational.LEAST:
        return None
    models = rational.orders(hz, lines[1][near], lines[2][near], math.inf)
    return _by_models(models, np.linspace(hz[0], hz[-1], 20 * hz.size), lambda s: phase(1 / s - 1))


def _by_models(
    models: Sequence[rational.Rational], fine: Array, of: Callable[[Complex], float]
) -> tuple[float, float] | None:
    """A margin by the models of several orders with Akaike's weights, and its u; by those that have it."""
    told = [(w, _told((s := m.at(fine), s, rational.drawn_curves(m, fine)), of)) for w, m in rational.weighed(models)]
    known = [(w, t) for w, t in told if t is not None]
    if not known:
        return None
    weight = np.array([w for w, _ in known]) / sum(w for w, _ in known)
    return rational.pooled(weight, *np.array([t for _, t in known]).T)


def _freed(found: float, again: float, values: Array) -> tuple[float, float] | None:
    known = np.isfinite(values)
    if not (math.isfinite(found) and math.isfinite(again) and known.mean() > 1 - TOLERATED):
        return None
    u = float(values[known].std())
    bias = float(values[known].mean()) - again
    told = u <= VAGUE * found and bias < found and abs(bias) <= LEANS * u
    return (found - bias, u) if told else None


def _crossings(level: Array, other: Complex) -> Complex:
    """A curve where `level` changes its sign, interpolated."""
    k = np.flatnonzero(np.sign(level[1:]) != np.sign(level[:-1]))
    share = level[k] / (level[k] - level[k + 1])
    return np.asarray(other[k] + share * (other[k + 1] - other[k]))


def phase(loop: Complex) -> float:
    """Phase margin of an open loop (m,), rad; NaN where |L| is not 1."""
    at = _crossings(np.abs(loop) - 1, loop)
    return float(np.abs(np.angle(-at)).min()) if at.size else math.nan


def _real(loop: Complex) -> Array:
    """Distances from the origin where the loop crosses the negative real axis."""
    at = _crossings(loop.imag, loop).real
    return np.asarray(-at[at < 0])


def fall(loop: Complex) -> float:
    """Factor to which its gain may fall; NaN where that is not told."""
    at = _real(loop)
    return float((1 / at[at > 1]).max()) if (at > 1).any() else math.nan


def rise(loop: Complex) -> float:
    """Factor to which its gain may rise; NaN where that is not told."""
    at = _real(loop)
    some = at[(at < 1) & (at > FAINT)]
    return float((1 / some).min()) if some.size else math.nan


def between(hz: Array, loop: Complex) -> Complex:
    """The lowest LOW lines of an open loop (m,) at `hz`, and BETWEEN points to each of them: hz times the loop goes through
    NODES lines. Straight lines between them would cross the axis 0.4 to 0.9 % beside it."""
    out = []
    for k in range(min(LOW, len(hz) - NODES)):
        first = max(k - 1, 0)
        x = np.linspace(hz[k], hz[k + 1], BETWEEN, endpoint=False)
        nodes = hz[first : first + NODES]
        apart = nodes[:, None] - nodes + np.eye(NODES)
        factors = np.where(np.eye(NODES)[:, :, None] > 0, 1.0, (x - nodes[:, None])[None]) / apart[:, :, None]
        out.append((loop[first : first + NODES] * nodes) @ factors.prod(axis=1) / x)
    return np.concatenate([*out, loop[len(out) :]])


def _least(
    hz: Array,
    z: Complex,
    base: Complex,
    power: Array,
    drawn: Complex,
    smooth: peaks.Smoother,
    reaches: Sequence[tuple[float, int]] = REACHES,
) -> tuple[float, float] | None:
    """|L| where it crosses the negative real axis below 1, and its u, by a polynomial about where a first look sees that;
    `base` is S as its local models have it at the lines."""
    loop = 1 / smooth.everywhere(z) - 1
    at = _crossings(loop.imag, loop + 0j).real, _crossings(loop.imag, smooth.x.astype(np.complex128)).real
    can = (at[0] < -FAINT) & (at[0] > -1)
    if not can.any():
        return None
    middle = float(at[1][can][np.argmin(at[0][can])])
    for reach, degree in reaches:
        near = (hz > middle / reach) & (hz < middle * reach)
        x, many = np.log(hz[near] / middle), int(near.sum())
        if many < 3 * (degree + 1):
            continue
        # d(1/S) = dS/S²; by the smooth S: noise that makes a line larger would weigh it more, and pull all to one side
        terms, weight = np.vander(x, degree + 1), np.abs(base[near]) ** 2 / np.sqrt(power[near])
        inverse = np.linalg.pinv(terms * weight[:, None]) * weight
        fitted = inverse @ (1 / z[near] - 1)
        off = float((np.abs((1 / z[near] - 1 - terms @ fitted) * weight) ** 2).sum()) / (many - degree - 1)
        if off < 1 + MISFIT / math.sqrt(many - degree - 1):
            fine = np.vander(np.linspace(x[0], x[-1], 20 * many), degree + 1)
            noisy = 1 / (1 / (1 + terms @ fitted) + drawn[:, near]) - 1
            found = 1 / rise(fine @ fitted)
            return _freed(found, found, 1 / np.array([rise(fine @ (inverse @ each)) for each in noisy]))
    return None
