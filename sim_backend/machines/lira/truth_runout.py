"""What truly turns with the drawn machine's shaft while its readings are held: target and magnets together, at each plane."""

from __future__ import annotations

import cmath
from collections.abc import Sequence

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.quantities import ACTUATORS

Z = 4


def runout(rig: RigFile, drawn: Truth, places: Sequence[float]) -> dict[tuple[str, str, float], complex]:
    """By quantity, plane and place along as it reads: R - M, m, as it points where the angle reads zero; the current that holds
    the readings, K_pull (R - M)/K_B, A, as the firmware has it, whose phase leads by what the encoder's zero is off."""
    del rig
    p: PlantParams = drawn.plant.plant
    out = {}
    for read in places:
        z = (read - p.position_offset[Z]) / p.position_gain[Z]
        target = p.runout * cmath.exp(1j * (p.runout_phase + p.runout_per_m * z))
        for k, name in enumerate(ACTUATORS):
            both = target - p.uneven[k] * cmath.exp(1j * p.uneven_phase[k])
            out["runout", name, read] = both
            turned = cmath.exp(-1j * p.zero_ra[k])
            out["runout_current", name, read] = p.pull[k] / p.bearing_constant[k] * both * turned
    return out
