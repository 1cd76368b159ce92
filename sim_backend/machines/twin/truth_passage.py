"""The truth of a passage of a rig's twin through the speeds: where its amplitudes are greatest when its speed stands."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.passing import POINTS, SMALL, Curves
from sim_backend.machines.twin.truth_whirl import Turning

HELD_S, SEEN_S = 0.6, 0.2  # at each speed: until the orbit is that of the speed; looked at


def curves(
    rig: RigFile, drawn: Truth, settings: Mapping[str, float], low: float, high: float, channels: Sequence[str]
) -> Curves:
    """Between two speeds, rad/s, of the shaft's centre along the probes of `channels`: as it is, and of small orbits."""
    speeds, p = np.linspace(low, high, POINTS), drawn.plant
    little = dataclasses.replace(
        p, unbalance=tuple(SMALL * u for u in p.unbalance), runout_c=tuple(SMALL * r for r in p.runout_c),
        runout_s=tuple(SMALL * r for r in p.runout_s),
    )  # fmt: skip
    found = []
    for one in (p, little):
        turning = Turning(rig, dataclasses.replace(drawn, plant=one), settings, float(speeds[0]), channels)
        out = []
        for speed in speeds:
            turning.at(float(speed), HELD_S)
            out.append(turning.seen(SEEN_S)[0][0])
        found.append(np.array(out))
    return Curves(speeds, found[0], found[1])
