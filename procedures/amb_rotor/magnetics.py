"""Force constant and magnetic offset of the radial AMBs from eccentric positions (thesis 2.3), beside the linear model.

At rest every radial force follows from gravity and the coupling's spring, by moments about the other AMB's plane:

    F_i = (-m g_a l_oa + K c (l_oa + l_c)) / (l_ia + l_oa)      F_o = (-m g_a l_ia + K c (l_ia - l_c)) / (l_ia + l_oa)

g_a is gravity along the axis, below zero with the positive coils above (T (2.6), corrected), c the displacement at the
coupling. Nonlinear model, T (2.8) with each coil's own measured current:

    F = beta (ip^2 / (gap - xi)^2 - in^2 / (gap + xi)^2),   xi = offset + r

with r the displacement of the AMB's plane off the sensors' zero. Linear model, T (2.9), without an intercept and so
without an offset: F = K_i (ip - in)/2 + K_xi r.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile.numbers import Sum
from procedures.amb_rotor.conventions import AMB_ROTOR
from procedures.amb_rotor.keys import gap_key, number_key
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import Placed, row, upward
from procedures.shared import leastsquares
from procedures.shared.leastsquares import Fit

Array = npt.NDArray[np.float64]
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Positions:
    """Means as the sensors read them: `read` (probes, N) m; of the machine's radial axes `p` and `n` (4, N) A (coils pulling to
    the positive and the negative side)."""

    read: Array
    p: Array
    n: Array
    machine: AmbRotor = AMB_ROTOR


@dataclass(frozen=True)
class Statics:
    """Freed of gains and offsets, each (4, N): `r` m at the AMBs off the sensors' zero, `p`, `n` A, `force` N that carries."""

    r: Array
    p: Array
    n: Array
    force: Array


@dataclass(frozen=True)
class AxisFit:
    """One axis: `terms` beta (N m^2/A^2) and offset (m) of the nonlinear model, its `residuals` (N,) in N, model less force;
    the linear model's fit with K_i (N/A) and K_xi (N/m)."""

    terms: Array
    residuals: Array
    linear: Fit

    @property
    def beta(self) -> float:
        """N m^2/A^2."""
        return float(self.terms[0])

    @property
    def offset(self) -> float:
        """From the magnetic centre to where the sensors read zero, m."""
        return float(self.terms[1])


def statics(d: Positions, p: Numbers) -> Statics:
    """From readings to displacements, currents and forces.

    `p` holds mass, gravity, axes (rad to the vertical), l_is, l_os, l_oa, amb_span, l_c, coupling (N/m), relaxed_y and
    relaxed_z (m, where the coupling does not pull, off the rings' centre); per axis gain_*, zero_* (reading where the shaft
    is in the rings' centre), runout_*; per coil gain_*, offset_* of its current sensor.
    """
    if "l_is" not in p:
        return _by_tables(d, p)
    l_is, l_os, l_oa, axes = p["l_is"], p["l_os"], p["l_oa"], d.machine.axes
    l_ia, span = p["amb_span"] - l_oa, l_is + l_os
    off = np.array([d.read[k] / p[f"gain_{a}"] - p[f"runout_{a}"] for k, a in enumerate(axes)])
    zero = np.array([[p[f"zero_{a}"] / p[f"gain_{a}"]] for a in axes])

    def at(station: float, x: Array) -> Array:
        share = (station + l_is) / span
        return x[:2] * (1 - share) + x[2:] * share

    r = np.concatenate([at(-l_ia, off), at(l_oa, off)])
    relaxed = np.array([[p["relaxed_y"]], [p["relaxed_z"]]])
    pull = p["coupling"] * (at(-p["l_c"], off - zero) - relaxed)
    weight = p["mass"] * p["gravity"] * np.array([[math.cos(p["axes"])], [math.sin(p["axes"])]])
    force = np.concatenate([weight * l_oa + pull * (l_oa + p["l_c"]), weight * l_ia + pull * (l_ia - p["l_c"])])
    pos, neg = _currents(d, p, axes)
    return Statics(r, pos, neg, force / p["amb_span"])


def _by_tables(d: Positions, p: Numbers) -> Statics:
    """The same for a machine as the rig file's tables have it: with q = (y, z, psi, theta), P q what the probes see and A q
    what is at the axes, forces f of the axes hold the shaft where A' f carries its weight and the coupling's pull."""
    s, m = d.machine.stations, d.machine

    def number(of: Sum) -> float:
        return of.exact + sum(t.factor * p.get(number_key(t.identity), t.number.value) for t in of.terms)

    def rows(placed: Iterable[Placed]) -> Array:
        return np.array([row(number(at.arm), number(at.angle)) for at in placed])

    reads, pulls = rows(s.probes.values()), rows(s.axes.values())
    off = np.array(
        [d.read[k] / (at.sign * p[f"gain_{c}"]) - p[f"runout_{c}"] for k, (c, at) in enumerate(s.probes.items())]
    )
    solved = np.linalg.pinv(reads)
    q = solved @ off
    up = np.array([*upward(number(s.first), s.hand, number(s.tilt)), 0.0, 0.0])
    carried = (p["mass"] * p["gravity"] * up)[:, None] + np.zeros_like(q)
    if p.get("coupling"):
        at = p["coupling_at"]
        end = np.array([[1.0, 0.0, 0.0, at], [0.0, 1.0, -at, 0.0]])
        zero = np.array([[p[f"zero_{c}"] / (x.sign * p[f"gain_{c}"])] for c, x in s.probes.items()])
        away = end @ (q - solved @ zero) - np.array([[p["relaxed_y"]], [p["relaxed_z"]]])
        carried = carried + p["coupling"] * end.T @ away
    pos, neg = _currents(d, p, m.axes)
    return Statics(pulls @ q, pos, neg, np.linalg.solve(pulls.T, carried))


def _currents(d: Positions, p: Numbers, axes: Sequence[str]) -> tuple[Array, Array]:
    """Of the coils (4, N) A, freed of gains and offsets."""
    pos, neg = (
        np.array([(c[k] - p[f"offset_{a}_{s}"]) / p[f"gain_{a}_{s}"] for k, a in enumerate(axes)])
        for s, c in (("p", d.p), ("n", d.n))
    )
    return pos, neg


def magnet(beta: float, offset: float, gap: float, r: Array, p: Array, n: Array) -> Array:
    """Force of one axis, T (2.4b)."""
    xi = offset + r
    out: Array = beta * (p**2 / (gap - xi) ** 2 - n**2 / (gap + xi) ** 2)
    return out


def nonlinear(r: Array, p: Array, n: Array, force: Array, gap: float) -> Fit:
    """T (2.8): beta and offset of one axis.

    Raises:
        AnalysisError: no convergence.
    """

    def model(terms: Array) -> Array:
        return magnet(terms[0], terms[1], gap, r, p, n)

    def jacobian(terms: Array) -> Array:
        near, far = gap - terms[1] - r, gap + terms[1] + r
        slope = 2 * terms[0] * (p**2 / near**3 + n**2 / far**3)
        return np.column_stack([(p / near) ** 2 - (n / far) ** 2, slope])

    found: list[Fit] = []
    for start in _starts(r, p, n, force, gap):
        try:
            found.append(leastsquares.nonlinear(model, force, start, jacobian=jacobian))
        except AnalysisError as error:
            why = error
    if not found:
        raise why
    return min(found, key=lambda fit: fit.chi2)


def _starts(r: Array, p: Array, n: Array, force: Array, gap: float) -> list[Array]:
    """The bottom of each valley of the sum of squares in a row of offsets, each with the beta that fits it best. There are
    several where the wiring is wrong, and two alike where equal currents carry the load: in that of -beta at -offset a row so
    coarse may lie lower."""
    room = gap - float(np.abs(r).max())
    offsets = np.linspace(-0.8, 0.8, 33) * room
    unit = np.array([magnet(1.0, o, gap, r, p, n) for o in offsets])
    betas = (unit @ force) / (unit**2).sum(axis=1)
    left = ((force - betas[:, None] * unit) ** 2).sum(axis=1)
    walled = np.concatenate([[np.inf], left, [np.inf]])
    bottoms = np.flatnonzero((left <= walled[:-2]) & (left < walled[2:]))
    return [np.array([betas[k], offsets[k]]) for k in bottoms]


def linear(r: Array, p: Array, n: Array, force: Array) -> Fit:
    """T (2.9): K_i and K_xi of one axis, without intercept."""
    return leastsquares.linear(np.column_stack([(p - n) / 2, r]), force)


def fits(d: Positions, p: Numbers) -> dict[str, AxisFit]:
    """Both models of every axis by itself, with the numbers as they are given, of positions at one bias."""
    s = statics(d, p)
    out = {}
    for k, a in enumerate(d.machine.axes):
        of = (s.r[k], s.p[k], s.n[k], s.force[k])
        fit = nonlinear(*of, p[gap_key(d.machine, a)])
        out[a] = AxisFit(fit.terms, -fit.residuals, linear(*of))
    return out


def slopes(terms: Array, gap: float, bias: float) -> tuple[float, float]:
    """dF/di (N/A) and dF/dxi (N/m) of the fitted magnet at the sensors' zero with both coils at the bias: what the
    linear model is taken for."""
    beta, xi = terms
    near, far = gap - xi, gap + xi
    return (
        float(2 * beta * bias * (1 / near**2 + 1 / far**2)),
        float(2 * beta * bias**2 * (1 / near**3 + 1 / far**3)),
    )
