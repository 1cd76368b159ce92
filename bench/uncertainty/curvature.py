"""A model's expansion to second order about the values of its inputs, used for draws only where the model itself agrees.

A fit that takes a millisecond takes minutes for the draws of JCGM 101; its expansion takes none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import combinations

import numpy as np

from bench.uncertainty.estimate import Array, Deviations

Model = Callable[[Mapping[str, float]], float]
"""The output for shifts of the influences, by id, in standard uncertainties; those that are left out are 0."""
MOST = 12  # influences that are looked at in pairs: the strongest
CHECKED = 200  # draws for which the model is asked too
AGREES, NEVER = 0.01, 0.05  # root mean square and greatest difference there, of the standard deviation of the output


def expanded(model: Model, units: Mapping[str, float], deviations: Deviations) -> Array | None:
    """Draws of the model's output by its expansion to second order (GUM 5.1.2 note), products of two influences included;
    None where the first draws of the model itself do not agree with it.

    Args:
        model: it must be asked some 500 times.
        units: standard uncertainty of each influence, by id.
        deviations: drawn deviations (n,) by id.
    """
    middle, out = model({}), np.zeros(len(next(iter(deviations.values()))))
    weights: dict[str, float] = {}
    shift = np.empty_like(out)  # one at a time: hundreds of influences with a million draws each are gigabytes
    for key, u in units.items():
        np.divide(deviations[key], u, out=shift)
        up, down = model({key: 1.0}), model({key: -1.0})
        slope, bend = (up - down) / 2, up - 2 * middle + down
        out += middle / len(units) + slope * shift + bend / 2 * shift**2
        weights[key] = abs(slope) + abs(bend)
    strongest = sorted(weights, key=lambda key: -weights[key])[:MOST]
    z = {key: deviations[key] / units[key] for key in strongest}
    for a, b in combinations(strongest, 2):
        corners = (s * t * model({a: s, b: t}) for s in (1.0, -1.0) for t in (1.0, -1.0))
        out += sum(corners) / 4 * z[a] * z[b]
    first = {key: deviations[key][:CHECKED] / u for key, u in units.items()}
    asked = np.array(
        [model({key: float(drawn[k]) for key, drawn in first.items()}) for k in range(min(CHECKED, len(out)))]
    )
    apart, scale = np.abs(out[: len(asked)] - asked), float(out.std())
    if np.sqrt(np.mean(apart**2)) > AGREES * scale or apart.max() > NEVER * scale:
        return None
    return out
