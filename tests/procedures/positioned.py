"""Axes of a rig that were positioned, as arrays: deviations that are known, readings of a sound instrument."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bench.rigfile import load_rig
from procedures.positioning.plan import Plan
from procedures.positioning.steps import Taken
from procedures.positioning.way import tested

UM = 1e-6
RLSRM = load_rig("rlsrm")
PLAN = Plan()
ALONG, AROUND = tested(RLSRM, PLAN)


def times(m: int, n: int, every_s: float = 3.0) -> np.ndarray:
    return np.arange(2 * m * n).reshape(n, 2, m).transpose(1, 2, 0) * every_s


def true_deviations(r: np.random.Generator, m: int, n: int, scatter: float = 0.3 * UM) -> np.ndarray:
    means = 0.5 * UM * np.sin(np.linspace(0, 6, m) + r.uniform(0, 6))
    ways = np.array([0.5, -0.5])[:, None] * (0.5 * UM + 0.2 * UM * r.standard_normal(m))
    return np.asarray((means + ways)[..., None] + scatter * r.standard_normal((2, m, n)))


def taken(deviations: np.ndarray, of: Any = ALONG, **changed: Any) -> Taken:
    """Readings of an axis with these deviations, at rest, its encoder as they are."""
    read = of.at[None, :, None] + deviations
    still, shape = np.zeros_like(read), read.shape
    made = Taken(of, read, read, read, still, times(shape[1], shape[2]), still + 300.0, ("HOLDING",), 0, 1000)
    return replace(made, **changed)
