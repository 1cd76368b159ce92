"""What fluxes have beyond the formula: by the angle from where phases are aligned, and by how deep the mover is in a stator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from procedures.inductance_map import fit
from procedures.inductance_map.estimates import Result
from procedures.inductance_map.model import MAP, Array, Terms, overlapped, places

ORDERS = (1, 2, 3, 4, 5, 6)
"""Of the rotor's poles; cosines of the first three are the formula's."""


@dataclass(frozen=True)
class Left:
    """By pulse (places, 6): angle `d` from the aligned one, within half a period, `overlap` m, inductance per metre H/m that
    the fit has and what pulses have beyond it; `aligned`, what it is at d = 0."""

    d: Array
    overlap: Array
    fitted: Array
    beyond: Array
    aligned: float


def left(r: Result) -> Left:
    """Of a fit."""
    t, at = r.found.terms, Terms(len(r.rows.x))
    m = dict(zip(MAP, t, strict=False))
    g, share = fit.by_place(r.found, r.rows)
    zero = np.where(r.rows.stator == 0, m["zero_1"], m["zero_2"])
    along, angle = places(t, r.rows)
    period = 2 * np.pi / r.rows.poles
    d = (angle[:, None] - r.rows.aligned - zero + period / 2) % period - period / 2
    x = along[:, None]
    over = overlapped(m["overlap"] + r.rows.side * (x - m["centre"]), m["length"], m["fringe"])
    per = t[at.each("gain")] * over
    return Left(d, over, g / per, g * share / per, float(m["slope"]))


def harmonics(of: Left, poles: int) -> dict[str, tuple[float, float]]:
    """Of what is left, as a share of the aligned inductance, by name: size and its standard uncertainty."""
    d, y = of.d.ravel(), (of.beyond / of.aligned).ravel()
    columns = [np.cos(n * poles * d) for n in ORDERS] + [np.sin(n * poles * d) for n in ORDERS]
    x = np.column_stack([np.ones(d.size), *columns])
    weight = of.overlap.ravel() / of.overlap.max()  # shallow places are noisier
    terms, *_ = np.linalg.lstsq(x * weight[:, None], y * weight, rcond=None)
    rest = (y - x @ terms) * weight
    inverse = np.linalg.pinv((x * weight[:, None]).T @ (x * weight[:, None]))
    u = np.sqrt(np.diag(inverse) * (rest**2).sum() / max(d.size - x.shape[1], 1))
    names = [f"{kind} {n * poles}" for kind in ("cosine", "sine") for n in ORDERS]
    return {name: (float(a), float(b)) for name, a, b in zip(names, terms[1:], u[1:], strict=True)}


def by_depth(of: Left, r: Result) -> list[tuple[float, float, float]]:
    """Of each stator at each position: overlap m, what is left in the mean as a share of the greatest inductance, its
    scatter."""
    out = []
    sent = np.array([t.place.x for t in r.taken])
    for stator in np.unique(r.rows.stator):
        for x in np.unique(sent):
            some = np.ix_(sent == x, r.rows.stator == stator)
            y = (of.beyond * of.overlap)[some].ravel() / (of.aligned * of.overlap.max())
            out.append((float(of.overlap[some].mean()), float(y.mean()), float(y.std(ddof=1) / np.sqrt(y.size))))
    return sorted(out)


def torques(r: Result) -> Array:
    """Torque of each phase at the current of its pulse's end, N m (places, 6)."""
    _, around, _ = fit.at_places(r.found, r.rows)
    at = Terms(len(r.rows.x))
    most = np.array(
        [
            max((abs(p.current) for t in r.taken if (p := t.pulses.get(k.name)) is not None), default=0.0)
            for k in r.phases
        ]
    )
    root = np.sqrt(1 + (most / r.found.terms[at.each("saturation")]) ** 2)
    out: Array = around * most**2 / (1 + root)
    return out
