"""Currents of the coils that carry most: which of them does is as uncertain as their sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.series import SeriesMean, batch_means
from procedures.shared.certificates import certified
from procedures.tracking.ellipse import revolutions
from procedures.tracking.requires import upper_and_lower
from procedures.tracking.steps import Orbit

APART = 5.0  # standard deviations of their difference, beyond which it is clear which of two is greater


def of_coils(orbit: Orbit, rig: RigFile) -> dict[str, Estimate]:
    """Mean current in A of the lower and of the upper coil that carries most, over whole revolutions of the reference.

    Where several read alike, the errors of their sensors say which one it is: the variance is the mean of theirs, each by how
    likely it is the one (law of total variance; what their means differ by is less than that).
    """
    out, per = {}, revolutions(orbit.path)
    batches = max(2, min(16, len(per) // 2))
    upper, lower = upper_and_lower(orbit.machine)
    for quantity, names, currents in (("lower_current", lower, orbit.lower), ("upper_current", upper, orbit.upper)):
        means = [batch_means([row[m].mean() for m in per], batches) for row in currents]
        most = int(np.argmax([mean.value for mean in means]))
        coils = [_true(rig, name, mean.value) for name, mean in zip(names, means, strict=True)]
        found = coils[most].value + _scatter(f"{orbit.law}/{quantity}", means[most], batches)
        for part, coil in zip(likely([c.value for c in coils], [c.u for c in coils]), coils, strict=True):
            found = found + math.sqrt(part) * (coil - coil.value) if part else found
        out[quantity] = replace(found, unit="A")
    return out


def likely(values: Sequence[float], us: Sequence[float]) -> list[float]:
    """How likely each of independent normal values (n,) with standard deviations `us` is the greatest: integral of its density
    by the distributions of the others. 1 for one that is so beyond doubt."""
    from scipy.special import ndtr

    v, u = np.array(values), np.array(us)
    if (v.max() - v < APART * np.hypot(u, u[v.argmax()])).sum() == 1:
        return [float(k == v.argmax()) for k in range(v.size)]
    x = np.linspace((v - 8 * u).max(), (v + 8 * u).max(), 4001)
    z = (x - v[:, None]) / u[:, None]
    below = ndtr(z)
    others = np.array([np.delete(below, k, axis=0).prod(axis=0) for k in range(v.size)])
    parts = (np.exp(-(z**2) / 2) / u[:, None] * others).sum(axis=1)
    return [float(part) for part in parts / parts.sum()]


def _true(rig: RigFile, channel: str, reading: float) -> Estimate:
    """A coil's current by its sensor's certificate, A."""
    gain, offset = (certified(f"sensors/{channel}/{what}", t)
                    for what, t in (("gain", rig.sensors[channel].gain), ("offset", rig.sensors[channel].offset)))  # fmt: skip
    return (reading - offset) / gain


def _scatter(identity: str, mean: SeriesMean, batches: int) -> Estimate:
    """Zero, with the scatter of a mean."""
    influence = Influence(
        id=f"scatter/{identity}",
        name="scatter of the current",
        u=mean.u,
        unit="A",
        kind="A",
        distribution="normal",
        dof=mean.dof,
        source=f"{batches} batches of revolutions of the reference",
    )
    return Estimate.of(0.0, influence)
