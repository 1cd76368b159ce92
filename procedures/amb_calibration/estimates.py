"""What enters the estimates of a mass-hanging calibration beside its certificates and the scatter of its hangings."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from bench.uncertainty import Estimate, Influence
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.pulls import Loaded


def less_sure(estimate: Estimate, masses: Mapping[str, float], beyond: float) -> Estimate:
    """With `beyond` (relative) more on each of the `masses` (kg by label), as `hypotheses.scatter_of_set` finds it."""
    if beyond == 0:
        return estimate
    dof = len(masses) - 2.0
    slopes = {i.id: c for i, c in estimate.sensitivities.items()}
    for k, (label, kg) in enumerate(masses.items(), 1):
        more = Influence(id=f"masses/beyond/{k}", name=f"mass {label}, beyond its certificate", unit="1", kind="A", u=1.0,
                         distribution="normal", dof=dof, source="contradiction of the loads")  # fmt: skip
        estimate = estimate + Estimate.of(0.0, more) * (slopes.get(f"masses/{label}", 0.0) * beyond * kg)
    return estimate


def turning_point(axis: Loaded, shift: float) -> Estimate:
    """The heaviest load is where loading turns: it counts as loading, and at most half of that could be wrong, at all
    angles alike."""
    influence = Influence(id=f"hysteresis/{axis.key}", name=f"hysteresis at the turning point, {axis.title}",
                          u=1 / math.sqrt(3), unit="1", kind="B", distribution="rectangular",
                          source="branch of the heaviest load set to zero")  # fmt: skip
    return Estimate.of(0.0, influence) * shift


def unresolved_angles(name: str, bearing: int, f: Fit, bias_A: float, gap: float) -> Estimate:
    """What a mean over equally spaced angles can miss: orders of K(angle) that are multiples of their number.

    The zero-load current shows the eccentricity of the journal by order (i = xi b / gap). K grows with the square of
    xi / gap (T 2.4: factor 1 + 3 (xi/gap)^2), so order n of K needs products of eccentricity orders that add to n; the
    orders above half of the number of angles are bounded by the smallest that is resolved. `bearing` is the axis' number. At
    one
    angle nothing is a mean: zero.
    """
    if f.terms.shape[1] == 1:
        return Estimate.exact(0.0)
    current = f.control[bearing][:, [0, -1]].mean(axis=1)
    orders = np.abs(np.fft.rfft(current)) * 2 / len(current) * gap / bias_A
    ratio = 3 * float(orders[1:].max() * orders[1:].min()) / gap**2
    scale = abs(float(f.terms[bearing, :, 1].mean())) / (bias_A if name.startswith("K2") else 1.0)
    influence = Influence(id=f"angle/{name}", name="angle dependence not resolved", u=ratio * scale / math.sqrt(3),
                          unit="1", kind="B", distribution="rectangular", source="orders of the zero-load current")  # fmt: skip
    return Estimate.of(0.0, influence)


def turned_by_hand(name: str, bearing: int, f: Fit, u_rad: float) -> Estimate:
    """What it does to a mean over the angles that each is off by `u_rad`: the slope of the terms over the angle, by the orders
    that they have, root of the mean of its square; each angle is off by itself."""
    terms = f.terms[bearing, :, {"K": 1, "K2": 2, "Kw": 1}[name.partition("_")[0]]]
    count = len(terms)
    orders = np.fft.rfft(terms) / count
    n = np.arange(len(orders))
    twice = np.where((n == 0) | (2 * n == count), 1.0, 2.0)
    slope = math.sqrt(float((twice * (n * np.abs(orders)) ** 2).sum()))
    u = slope * u_rad / math.sqrt(count)
    influence = Influence(id=f"angle/hand/{name}", name="angle to which the shaft was turned by hand", u=u,
                          unit="1", kind="B", distribution="normal", source="shaft.hand_angle")  # fmt: skip
    return Estimate.of(0.0, influence)
