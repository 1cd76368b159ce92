"""The bare model: currents that answer weights, arrays in and out.

A mass on the mover pulls with W; the magnets of both planes take it off, and where the mover is held in its place, nothing else
changes: the pull of the magnets is what it was. With r_kp, A per N, the current of plane k that answers a weight at place p,

    A_1 r_1p + A_2 r_2p = 1 at each place, and A_1 r_1p - A_2 r_2p = (2 h_p)/(l_1 - l_2) about the middle between the planes.

The first says A of both planes by two places without any length; the second says then where the weight hung.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import linear

Array = npt.NDArray[np.float64]
APART = 0.2  # determinant over the product of its rows, at least: two places that are one tell no two constants


@dataclass(frozen=True)
class Answer:
    """Of a plane: `rates` (places,) A/N along the direction `turned`, rad from q towards d, in which its current answers; their
    `covariance`; `dof`; what is `left` (n,) A of each visit; currents (n,) `along` it, less what is there without a load."""

    rates: Array
    covariance: Array
    turned: float
    u_turned: float
    dof: int
    left: Array
    along: Array


def answer(design: Array, currents: Array) -> Answer:
    """Of a plane's `currents` (n, 2), d and q. A field that is laid wrong turns the answer and takes nothing of its length.

    Raises:
        AnalysisError: too few visits, or nothing hung.
    """
    both = [linear(design, currents[:, k]) for k in (0, 1)]
    places = design.shape[1] - 2
    d, q = (fit.terms[:places] for fit in both)
    p = int(np.argmax(np.hypot(d, q)))
    turned = math.atan2(d[p] * math.copysign(1.0, q[p]), abs(q[p]))
    along = currents @ np.array([math.sin(turned), math.cos(turned)])
    across = currents @ np.array([math.cos(turned), -math.sin(turned)])
    fit, other = linear(design, along), linear(design, across)
    u = math.sqrt(other.covariance[p, p]) / max(abs(fit.terms[p]), 1e-300)
    less: Array = along - design[:, places:] @ fit.terms[places:]
    return Answer(fit.terms[:places], fit.covariance[:places, :places], turned, u, fit.dof, fit.residuals, less)


def forces(first: Array, other: Array) -> Array:
    """N per A that is read, of two planes by their `rates` (2,) at two places.

    Raises:
        AnalysisError: both places are answered alike.
    """
    rates = np.column_stack([first, other])
    if abs(np.linalg.det(rates)) < APART * float(np.prod(np.linalg.norm(rates, axis=1))):
        raise AnalysisError("weights at both places are answered alike: the currents tell one constant of both planes")
    return np.asarray(np.linalg.solve(rates, np.ones(2)), np.float64)
