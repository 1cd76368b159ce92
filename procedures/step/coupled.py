"""Two oscillations beside what a fast integrator leaves: position y and tilt h (as a length) that push each other.

While a stiff loop swings, two or three milliseconds of its response are left to tell its poles by, and the second oscillation
hardly shows in the position. Free poles and parts then fit noise. What they cannot be is known. Envelopes of both follow

    (y, h)' = [[p, r e], [e, p + d]] (y, h),   y(0) = C, h(0) = D,                                     (1)

where e says how position tilts the shaft, and r e how tilt moves it. The same stiffness couples both ways, so that r is what a
tilt weighs beside a displacement: J/(m a b), of a shaft of mass m and inertia J with probes at -a and a, which tell bearings at
-b and b; of the bearings' own stiffness J/(m b²). Its eigenvalues are
p + d/2 +- s, s² = d²/4 + r e², and the position's parts, with h/s for d/(2 s),

    c = C (1 -+ d/(2 s))/2 +- D r e/(2 s).                                                              (2)

The mean pole is y'(0)/y(0) = p + r e D/C. What the tilt does not show cannot be in the position: where the shaft does not tilt
there is one oscillation. The integrators leave two things that fade, alike but for a few percent of their constant: in the
position they add up to one, in the tilt they nearly cancel, as t e^(-t/constant); a tilt without it had the second pole
anywhere (-216 + 141i for -380 + 562i 1/s), and the damping 0.006 off. Where they are less alike, as with bearings whose gains
differ, the next term of both is seen, t² e^(-t/constant) (`ASKED`): without it the mean pole of such a spindle was 2.8 to 6.4
of 76 Hz off. Of d and r is known what shafts are like; it counts as readings of them (ridge regression), as far as the data do
not say otherwise, and how far the result hangs on each is kept with it (`Swing.doubts`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.errors import AnalysisError
from procedures.step.fading import LASTS, first_pole
from procedures.step.oscillation import FROM_S, UNTIL_S, Array, Complex, One, Swing, guess, shrinks

SCALE = 100.0  # 1/s, of the search
# Of a pole: standard uncertainty of what the other one of a shaft in two bearings is off by, either part of it.
ALIKE = 0.3
WEIGHS = math.log(2.0)  # of the logarithm of r where nothing is stated: from half to twice for two shafts of three
DAMPED = 0.2  # where a search begins that has nothing better
ALONE = 3  # of what is searched, for one oscillation
KNOWN = 3  # rows of what is known: both parts of d, and r
ASKED = 16.0  # of chi-squared, that two terms in t² of what fades have to explain: noise alone does once in 3000
# Damping from which it is open whether a pole counts as an oscillation (`oscillation.HARD`), and by how much of itself the mean
# pole may be moved by a second one where that is so.
NEARLY, TORN = 0.9, 0.05
TOLD = 1e-6  # of a sum of squares and of what is searched, at which a search ends
BLOCK = 5  # samples that are one from UNTIL_S on
CLOSE = 1e-5  # of a pole, nearer than which two are not told apart


@dataclass(frozen=True)
class Tilting:
    """What is known of how much a tilt weighs beside a displacement: ln r, and its standard uncertainty."""

    weighs: float = 0.0
    doubt: float = WEIGHS


ANY = Tilting()


@dataclass(frozen=True)
class _Data:
    """Samples of all steps in one: times (n,), weights (n,), position and tilt times their weight (n, 2), the period of their
    means, what is known of its `tilting`, and the `noise` of a sample, which says what readings count beside what is known."""

    t: Array
    weight: Array
    seen: Array
    period: float
    tilting: Tilting = ANY
    noise: float = 0.0
    unlike: bool = False  # what fades

    def alone(self, x: Array) -> Array:
        """What is left of the position by one oscillation, x = (-Re p, Im p, 1/constant)."""
        a = self._one(x)
        return np.asarray(self.seen[:, 0] - a @ _solved(a, self.seen[:, 0]))

    def _one(self, x: Array) -> Array:
        p = np.array([SCALE * complex(-x[0], x[1])])
        e = np.exp(np.outer(self.t, p))[:, 0] * shrinks(p, self.period)[0]
        return np.column_stack([*self._slow(x[2]), e.real * self.weight, -e.imag * self.weight])

    def _slow(self, rate: float) -> tuple[Array, Array]:
        fades = np.array([-SCALE * rate + 0j])
        fading = np.exp(fades[0].real * self.t) * shrinks(fades, self.period)[0].real
        return self.weight, fading * self.weight

    def columns(self, x: Array) -> Array:
        """Of what is linear, (2 n, 9 or 11): level and what fades, of position and of tilt, the parts of C and D, the tilt's t
        e^(-t/constant), and of `unlike` fades t² e^(-t/constant) of both; equation 1 with x = (-Re p, Im p, Re d, Im d, Re e,
        Im e, ln r, 1/constant), rates over SCALE."""
        poles, shares = _modes(x)
        e = np.exp(np.outer(self.t, poles)) * shrinks(poles, self.period) * self.weight[:, None]
        out = np.zeros((2 * len(self.t), 11 if self.unlike else 9))
        for k, half in enumerate((slice(None, len(self.t)), slice(len(self.t), None))):
            out[half, 2 * k], out[half, 2 * k + 1] = self._slow(x[-1])
            for j in (0, 1):
                column = e @ shares[k, j]
                out[half, 4 + 2 * j], out[half, 5 + 2 * j] = column.real, -column.imag
        late = self.t * SCALE * x[-1]
        out[half, 8] = out[half, 3] * late
        if self.unlike:
            out[: len(self.t), 9] = out[half, 10] = out[half, 3] * late**2
        return out

    def both(self, x: Array) -> Array:
        """What is left of position and tilt (2 n,), and of what is known (KNOWN,)."""
        a, seen = self.columns(x), self.seen.T.ravel()
        size = math.hypot(x[0], x[1])
        known = np.array(
            [x[2] / (ALIKE * size), x[3] / (ALIKE * size), (x[6] - self.tilting.weighs) / self.tilting.doubt]
        )
        return np.append(seen - a @ _solved(a, seen), self.noise * known)

    def swing(self, x: Array) -> Swing:
        """Of what was found, with its best linear terms."""
        if len(x) == ALONE:
            level, fades, real, imag = map(float, _solved(self._one(x), self.seen[:, 0]))
            poles, parts = np.array([SCALE * complex(-x[0], x[1])]), np.array([complex(real, imag)])
            apart = 0.0
        else:
            terms = _solved(self.columns(x), self.seen.T.ravel())
            level, fades, apart = float(terms[0]), float(terms[1]), float(terms[9]) if self.unlike else 0.0
            poles, shares = _modes(x)
            parts = complex(terms[4], terms[5]) * shares[0, 0] + complex(terms[6], terms[7]) * shares[0, 1]
        turned = poles.imag < 0
        poles, parts = np.where(turned, poles.conj(), poles), np.where(turned, parts.conj(), parts)
        return Swing(poles, parts, level, 0.0, 0.0, fades, 1 / (SCALE * float(x[-1])), apart, self.unlike)


def _modes(x: Array) -> tuple[Complex, Complex]:
    """Poles (2,) of equation 1, and their shares (2, 2, 2) in position and tilt, of C and of D."""
    p, half, e, r = (
        SCALE * complex(-x[0], x[1]),
        SCALE * complex(x[2], x[3]) / 2,
        SCALE * complex(x[4], x[5]),
        math.exp(x[6]),
    )
    s = np.sqrt(half**2 + r * e**2 + 0j)
    s = s if abs(s) > CLOSE * abs(p) else complex(CLOSE * abs(p))
    own, aside, across = half / s, r * e / (2 * s), e / (2 * s)
    shares = [[[(1 - own) / 2, (1 + own) / 2], [aside, -aside]], [[across, -across], [(1 + own) / 2, (1 - own) / 2]]]
    return np.array([p + half + s, p + half - s]), np.array(shares)


def _solved(a: Array, seen: Array) -> Array:
    """Best linear terms; of many rows by their squares.

    Raises:
        FloatingPointError: rates so great that the squares are no numbers, which LAPACK would print about, and go on.
    """
    squares, products = a.T @ a, a.T @ seen
    if not (np.isfinite(squares).all() and np.isfinite(products).all()):
        raise FloatingPointError("the search went astray")
    return np.asarray(np.linalg.lstsq(squares, products, rcond=None)[0])


def hardly_swings(swing: Swing) -> bool:
    """Whether one of two oscillations beside what fades is so heavily damped that it is open whether it counts, and their mean
    pole depends on that."""
    damping = -swing.poles.real / np.abs(swing.poles)
    return len(swing.found) > ALONE and bool((damping > NEARLY).any()) and swing.torn > TORN


def fitted(steps: Sequence[One], constant: float, start: Swing | None = None, tilting: Tilting = ANY) -> Swing:
    """Beside what fades with about that time constant, s; one oscillation where nothing tilts. `start`: a fit to nearly the
    same steps; `tilting`: what is known of the shaft's.

    Raises:
        AnalysisError: no oscillation fits.
    """
    data = _data(steps, constant, tilting)
    try:
        if start is not None and len(start.found):
            data = replace(data, noise=start.misfit * _rms(data.weight), unlike=start.unlike)
            return _searched(data, np.array(start.found))
        pole = first_pole(steps) or guess(steps[0]) * complex(-DAMPED, 1.0)
        one = _searched(data, np.array([-pole.real, pole.imag, 1 / constant]) / SCALE)
        if not np.any(data.seen[:, 1]):
            return one
        x = np.array(one.found)
        x0 = np.array([x[0], x[1], 0.0, 0.0, 0.0, 0.0, tilting.weighs, x[2]])
        alike = _searched(replace(data, noise=one.misfit * _rms(data.weight)), x0)
        return _by_what_fades(replace(data, noise=alike.misfit * _rms(data.weight), unlike=True), alike)
    except (ValueError, OverflowError, np.linalg.LinAlgError) as error:
        raise AnalysisError(f"no oscillation fits the response: {error}") from error


def _by_what_fades(data: _Data, alike: Swing) -> Swing:
    """The fit to `data` whose fades are unlike where that explains more than noise would, else the one where they are alike."""
    try:
        seen = _searched(data, np.array(alike.found))
    except AnalysisError:
        return alike
    more = 2 * len(data.t) * ((alike.misfit / seen.misfit) ** 2 - 1)
    return seen if more > ASKED else alike


def _searched(data: _Data, x0: Array) -> Swing:
    from scipy import optimize

    of = data.alone if len(x0) == ALONE else data.both
    with np.errstate(over="raise", invalid="raise"):
        try:
            found = optimize.least_squares(of, x0, x_scale=0.1, method="lm", ftol=TOLD, xtol=TOLD, max_nfev=300)
            out = data.swing(found.x)
        except FloatingPointError as error:
            raise AnalysisError(f"no oscillation fits the response: {error}") from error
    misfit = _rms(found.fun) / _rms(data.weight)
    return replace(out, misfit=misfit, found=tuple(found.x), doubts=_doubts(data, found.x, found.jac))


def _doubts(data: _Data, x: Array, slopes: Array) -> tuple[Swing, ...] | None:
    """The fit were what is known off by its standard uncertainty, one thing after the other: x + (J'J)^-1 J_k' noise.
    None where that goes astray: straight on from a fit that hardly tells a second oscillation, rates grow beyond numbers."""
    if len(x) == ALONE:
        return ()
    with np.errstate(over="raise", invalid="raise"):
        try:
            moved = np.linalg.pinv(slopes.T @ slopes) @ slopes[-KNOWN:].T * data.noise
            return tuple(data.swing(x + by) for by in moved.T)
        except (FloatingPointError, OverflowError, np.linalg.LinAlgError):
            return None


def _data(steps: Sequence[One], constant: float, tilting: Tilting) -> _Data:
    parts = [_thinned(s, max(UNTIL_S, LASTS * constant)) for s in steps]
    t, weight = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    seen = np.concatenate([part[2] for part in parts], axis=1).T
    return _Data(t, weight, seen, float(steps[0].t[1] - steps[0].t[0]), tilting)


def _thinned(s: One, until: float) -> tuple[Array, Array, Array]:
    """Times (n,), weights (n,) and what was seen times them (2, n) of one step: every sample while it swings, then means over
    BLOCK, which a decay of `fading.SHORT_S` and more passes to 2e-3 of what is left of it."""
    swings, after = (np.flatnonzero((s.t > low) & (s.t < high)) for low, high in ((FROM_S, UNTIL_S), (UNTIL_S, until)))
    blocks = after[: len(after) // BLOCK * BLOCK].reshape(-1, BLOCK)
    t = np.append(s.t[swings], s.t[blocks].mean(axis=1))
    both = np.append(s.both[:, swings], s.both[:, blocks].mean(axis=2), axis=1)
    weight = s.weight * np.sqrt(np.append(np.ones(len(swings)), np.full(len(blocks), BLOCK)))
    return t, weight, both * weight


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))
