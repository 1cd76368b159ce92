"""The truth of a passage through the speeds: where the amplitudes of a shaft are greatest when its speed stands.

Critical speeds and amplification factors are those of small orbits: of the same machine with a fiftieth of its unbalance and
runout. The amplitude is that of the orbit as it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from sim_backend.machines.amb5dof import truth_unbalance
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.machines.passing import POINTS, SMALL, Curves, greatest


def curves(p: AmbParams, settings: Mapping[str, float], low: float, high: float) -> Curves:
    """Of the machine under the controller's settings (SI, by name), between two speeds in rad/s."""
    speeds = np.linspace(low, high, POINTS)
    i, o = p.unbalance
    little = dataclasses.replace(p, unbalance=(SMALL * i, SMALL * o), runout=tuple(SMALL * x for x in p.runout))
    large, small = (truth_unbalance.response(one, settings, speeds) for one in (p, little))
    return Curves(speeds, large, small)


__all__ = ["Curves", "curves", "greatest"]
