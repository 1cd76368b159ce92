"""What the gate of the drawn machine and the catch of its bearings truly have to spare, levitated at rest.

A reading is where the mover is, and fresh noise: of N readings P(|r| > k q) N are beyond k counts in the mean, and the largest
of them is within with exp(-that), Poisson's. So the mean of the largest follows from how the mover moves, without the scatter
of a few largest ones.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from scipy.special import ndtr

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import TRACE
from sim_backend.machines.lira.truth_loops import RATE, Flying
from sim_backend.mission_motion import GateAsked

RADIAL: Final = ("x1", "x2", "y1", "y2")
TRUE: Final = [TRACE.index(f"true_{name}") for name in RADIAL]
FORCE: Final = [TRACE.index(f"force_{name}") for name in RADIAL]
THIN: Final = 7  # of samples of the way, one of so many tells
FAR: Final = 9.0  # standard deviations of noise: beyond nothing reads


def largest(p: PlantParams, way: Array, rest: Array, samples: float) -> float:
    """Mean of the largest |reading| of so many samples of the four probes; `way` (n, 4) m, of which the target's runout is no
    part, and how they read in the mean, `rest` (4,) m."""
    q = p.position_lsb[0]
    moved = (way - way.mean(axis=0))[::THIN]
    seen = [(p.position_gain[k] * moved[:, k] + rest[k], p.position_noise[k]) for k in range(4)]
    top = max(float(np.abs(f).max()) + FAR * s for f, s in seen)
    edges = (np.arange(math.ceil(top / q)) + 0.5) * q
    beyond = sum(
        (ndtr((f[:, None] - edges) / s) + ndtr((-f[:, None] - edges) / s)).mean(axis=0) * samples for f, s in seen
    )
    return float(q * (1 - np.exp(-np.asarray(beyond))).sum())


def excursion(way: Array, pole: float, windows: int) -> float:
    """Mean over windows of the largest |x| + |v|/lambda about where it stands."""
    rate = np.gradient(way) * RATE
    far = np.abs(way - way.mean()) + np.abs(rate) / pole
    return float(far[: len(far) // windows * windows].reshape(windows, -1).max(axis=1).mean())


def reach(built: Any, k: int, spare: float) -> float:
    """How far the pull of a plane is held by so much more of the firmware's force; a coil's gain makes its current less."""
    p, c, plane = built.plant, built.control, k % 2
    zero = p.zero_ra[plane] - (c.zero_ra1, c.zero_ra2)[0 if c.one_zero else plane]
    gain = 1.0 if built.reduced else float(np.mean(p.coil_gain[6 * plane : 6 * plane + 6]))
    return float(p.bearing_constant[plane] * math.cos(zero) / (c.model_bearing * gain) * spare / p.pull[plane])


def gates(rig: RigFile, drawn: Truth, asked: GateAsked) -> dict[tuple[str, str], float]:
    """By quantity and where; nothing where it does not fly."""
    del rig
    built: Any = drawn.plant
    p: PlantParams = built.plant
    flying = Flying(drawn, asked.settings, noise=1, whole=True)
    if flying.plant.state != "LEVITATED":
        return {}
    pole, samples = math.sqrt(sum(p.pull) / p.mass), round(asked.gate_s * RATE)
    out: dict[tuple[str, str], float] = {}
    for name, (z, angle) in asked.places.items():
        flying.go({asked.place: z, asked.angle: angle}, asked.settings)
        rows = flying.wait(asked.windows * asked.gate_s)
        out["gate_margin", name] = asked.gate_m - largest(p, rows[:, TRUE], rows[:, :4].mean(axis=0), samples)
        for k, probe in enumerate(RADIAL):
            if probe not in asked.limits:
                continue
            spare = asked.limits[probe] - abs(float(rows[:, FORCE[k]].mean()))
            margin = reach(built, k, spare) - excursion(rows[:, TRUE[k]], pole, asked.windows)
            out["catch_margin", probe] = min(margin, out.get(("catch_margin", probe), math.inf))
    return out
