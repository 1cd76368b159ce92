"""What holds the drawn machine at rest: its pull over its force constants, and where its bearings need no current."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.quantities import ACTUATORS, RADIAL

Z = 4


def pulls(rig: RigFile, drawn: Truth, z_read: float, angle: float) -> dict[tuple[str, str], float]:
    """By quantity and where, with the mover where z reads so much and at an angle, rad."""
    del rig
    p: PlantParams = drawn.plant.plant
    ratios = [pull / k for pull, k in zip(p.pull, p.bearing_constant, strict=True)]
    z = (z_read - p.position_offset[Z]) / p.position_gain[Z]
    free, middle = [read(p, true, z, angle) for true in (stands(p, z, angle, w) for w in (1.0, 0.0))]
    out = {("pull_ratio", name): ratios[k % 2] for k, name in enumerate(RADIAL)}
    out |= {("current_free", name): x for name, x in zip(RADIAL, free, strict=True)}
    out |= {("frame_turn", name): zero for name, zero in zip(ACTUATORS, p.zero_ra, strict=True)}
    out |= {("K_pull", name): pull for name, pull in zip(ACTUATORS, p.pull, strict=True)}
    out["lever_ratio", ""] = p.bearing_plane / p.sensor_plane
    out |= {("bearing_constant", axis): sum(p.pull) / sum(ratios) for axis in "xy"}
    out["magnet_centre", "y"] = (middle[2] + middle[3]) / 2
    return out


def stands(p: PlantParams, z: float, angle: float, weight: float) -> list[float]:
    """Where x1, x2, y1, y2 of the rotary actuators' planes are when the magnets alone hold that share of the weight, m: each
    plane its part, by levers about the centre of mass."""
    off, out = z - p.middle, []
    for k, sign in enumerate((1, -1)):
        out.append(-p.centre[k] - p.uneven[k] * math.cos(angle - p.uneven_phase[k]))
        carried = weight * p.mass * p.gravity * (1 + sign * off / p.bearing_plane) / 2
        up = -p.centre[2 + k] + p.uneven[k] * math.sin(angle - p.uneven_phase[k])
        out.append(up + carried / p.pull[k])
    return [out[0], out[2], out[1], out[3]]


def read(p: PlantParams, at: Sequence[float], z: float, angle: float) -> list[float]:
    """What the probes read there: in their own planes, with the target's runout, m."""
    share = p.sensor_plane / p.bearing_plane
    phase = p.runout_phase + p.runout_per_m * z - angle
    run = (p.runout * math.cos(phase), p.runout * math.sin(phase))
    seen = []
    for (first, second), beside in zip((at[:2], at[2:]), run, strict=True):
        mean, half = (first + second) / 2, (first - second) / 2 * share
        seen += [mean + half + beside, mean - half + beside]
    return [g * x + o for g, x, o in zip(p.position_gain[:4], seen, p.position_offset[:4], strict=True)]
