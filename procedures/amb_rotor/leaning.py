"""Where a shaft that is not lifted stands in its rings while somebody pushes it aside: by the lever of weight and push."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.supports import least_clearance
from procedures.amb_rotor.stations import Ring, stations

Array = npt.NDArray[np.float64]
SLIGHT = 0.1  # of the weight: less than that at a ring does not say where the shaft stands there


def reads(rig: RigFile, angle: float) -> dict[str, float]:
    """By channel of the radial probes, what each should read over the least clearance while the shaft is pushed at `angle` rad
    from y towards z, midway between its rings and with as much as it weighs.

    Each ring carries its share of weight and push, and the shaft touches it on the side to which they press it. Where not two
    rings are told, it goes where it is pushed, all of it alike.
    """
    s = stations(rig)
    push = np.array([math.cos(angle), math.sin(angle)])
    told = [(ring, ring.arm.value) for ring in s.rings if ring.arm is not None]
    (near, one), (far, other) = (min(told, key=_arm), max(told, key=_arm)) if told else ((None, 0.0), (None, 0.0))
    if near is None or far is None or other - one < 1e-6:
        return {name: float(np.array(p.row[:2]) @ push) for name, p in s.probes.items()}
    weight, least = -np.array(s.up), least_clearance(rig)
    at = [_at(ring, push / 2 + weight * share, least) for ring, share in
          ((near, other / (other - one)), (far, -one / (other - one)))]  # fmt: skip
    return {
        name: float(np.array(p.row[:2]) @ _between(at, (p.arm.value - one) / (other - one)))
        for name, p in s.probes.items()
    }


def _arm(ring: tuple[Ring, float]) -> float:
    return ring[1]


def _at(ring: Ring, carried: Array, least: float) -> Array:
    """Where the shaft touches a ring that carries so much of its weight, (2,) over the least clearance."""
    out: Array = carried / max(float(np.hypot(*carried)), SLIGHT) * (ring.clearance.number.value / least)
    return out


def _between(at: list[Array], share: float) -> Array:
    out: Array = at[0] + (at[1] - at[0]) * share
    return out
