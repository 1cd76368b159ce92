"""Weighted least squares of the map's terms over all flanks, with what certificates say as observations of their own.

Unknown are the map, what each phase has (the mean of the gains is one), what encoders are off (once a turn, and at each place
by less than half a count), and offsets of readings. Those of the last two kinds have a certificate: its value is an
observation with its u. So the covariance has everything, and the row of a term in (J'J)^-1 J' is what each certificate does to
it. How far fluxes scatter is what their residuals say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.errors import AnalysisError
from bench.uncertainty import Influence
from procedures.inductance_map.model import MAP, PHASES, Array, Rows, Terms, flux, inductance, places
from procedures.shared.leastsquares import nonlinear

FLOOR = 2e-6  # Wb: what counts of readings leave of a flux
SHARE = 2e-4  # of a flux, likewise
TIED = 1e-6  # of the mean of the gains


@dataclass(frozen=True)
class Known:
    """Of a term (its number): what a certificate says of it, and what a budget calls that. `influence` is that of the number
    itself, where it is uncertain; of a term that is a share of the number it moves it by one `per`."""

    term: int
    value: float
    u: float
    identity: str
    influence: Influence | None = None
    per: float = 1.0


@dataclass(frozen=True)
class Found:
    """Terms and covariance; `gains` (terms, known), what each certificate does to each term; `scatter` (terms, terms), the part
    of the covariance that residuals make, with `dof`; `residuals` (n,) Wb, and their size in units of what was expected."""

    terms: Array
    covariance: Array
    gains: Array
    scatter: Array
    dof: float
    residuals: Array
    expected: Array
    size: float


def start(rows: Rows, guess: Sequence[float], known: Sequence[Known]) -> Array:
    """The first guess of every term: the map's, L_l and i_s, and what certificates say."""
    at = Terms(len(rows.x))
    out = np.zeros(at.count)
    out[: len(MAP)] = guess[: len(MAP)]
    out[at.each("gain")], out[at.scale] = 1.0, 1.0
    out[at.each("leakage")], out[at.each("saturation")] = guess[len(MAP) :]
    for one in known:
        out[one.term] = one.value
    return out


def fitted(rows: Rows, first: Array, known: Sequence[Known]) -> Found:
    """The terms that fit.

    Raises:
        AnalysisError: the pulses do not determine the map.
    """
    terms, size = first, 1.0
    numbers = np.array([k.term for k in known])
    said, u = np.array([k.value for k in known]), np.array([k.u for k in known])
    at, n = Terms(len(rows.x)), len(rows.flux)
    observed = np.concatenate([rows.flux, said, [1.0]])
    base = np.sqrt(FLOOR**2 + (SHARE * rows.flux) ** 2 + (rows.noise * _henries(rows)) ** 2)

    def model(t: Array) -> Array:
        return np.concatenate([flux(t, rows), t[numbers], [t[at.each("gain")].mean()]])

    for _ in range(2):  # the second by what the residuals of the first are
        weight = np.concatenate([size * base, u, [TIED]])
        found = nonlinear(model, observed, terms, weight)
        terms = found.terms
        left = (rows.flux - flux(terms, rows)) / base
        free = max(n - (at.count - len(known)), 1)
        size = math.sqrt(float((left**2).sum()) / free)
        if not np.isfinite(size) or size <= 0:
            raise AnalysisError("residuals are not finite")
    j = found.jacobian / weight[:, None]
    by = found.covariance @ j.T / weight  # what each observation does to each term
    scatter = _by_pulses(by[:, :n], found.jacobian[:n], rows, rows.flux - flux(terms, rows))
    return Found(terms, found.covariance, by[:, n : n + len(known)], scatter, float(free), rows.flux - flux(terms, rows),
                 weight[:n], size)  # fmt: skip


def _henries(rows: Rows) -> Array:
    """Flux per ampere of each sample's pulse (n,): of the pulse, so that a sample's noise is not in its own weight."""
    pulse = rows.place * PHASES + rows.phase
    each = np.bincount(pulse, rows.flux * rows.current) / np.maximum(np.bincount(pulse, rows.current**2), 1e-30)
    out: Array = each[pulse]
    return out


def _by_pulses(by: Array, jacobian: Array, rows: Rows, left: Array) -> Array:
    """Covariance (terms, terms) that residuals make. Those of one pulse are no repeats of each other: a flux is an integral,
    and what is wrong with it is wrong on both flanks. So what each pulse does to the terms is taken whole, by the residuals it
    would have if it had not been fitted, (1 - H)^-1 of those it has (Bell and McCaffrey, Survey Methodology 28, 169 (2002),
    their CR3: the jackknife over pulses)."""
    pulse = rows.place * PHASES + rows.phase
    out = np.zeros((len(by), len(by)))
    for one in np.unique(pulse):
        some = np.flatnonzero(pulse == one)
        own = np.eye(len(some)) - jacobian[some] @ by[:, some]
        moved = by[:, some] @ np.linalg.solve(own, left[some])
        out += np.outer(moved, moved)
    return out


def by_place(found: Found, rows: Rows) -> tuple[Array, Array]:
    """G (places, 6) of the fit, and what the pulses' fluxes have beyond it, as a share of it, mean over each pulse's flanks."""
    g, _, _ = at_places(found, rows)
    per = rows.place * PHASES + rows.phase
    weight = rows.flux**2
    fit = rows.flux - found.residuals
    count = g.size
    share = np.bincount(per, found.residuals * fit, count) / np.maximum(np.bincount(per, weight, count), 1e-30)
    return g, share.reshape(g.shape)


def at_places(found: Found, rows: Rows) -> tuple[Array, Array, Array]:
    """G H and its slopes around and along (places, 6), where the shaft stands without currents."""
    x, angle = (np.repeat(v[:, None], PHASES, axis=1) for v in places(found.terms, rows))
    return inductance(found.terms, rows, x, angle, np.broadcast_to(np.arange(PHASES), x.shape))


def flanks(found: Found, rows: Rows, phase: int) -> tuple[float, float]:
    """What fluxes of a phase have beyond the fit on their way up and down, as a share."""
    fit = rows.flux - found.residuals
    out = []
    for down in (0.0, 1.0):
        some = (rows.phase == phase) & (rows.down == down)
        out.append(float((found.residuals * fit)[some].sum() / max(float((fit[some] ** 2).sum()), 1e-30)))
    return out[0], out[1]


def correlations(found: Found) -> Array:
    """Of the map's terms."""
    u = np.sqrt(np.diag(found.covariance))
    out: Array = (found.covariance / np.outer(u, u))[: len(MAP), : len(MAP)]
    return out
