"""What the drawn machine's cogging truly is: its harmonics as force or torque and as the current that takes them off."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping

import numpy as np

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.quantities import POLE_PAIRS

ALONG, AROUND = "z", "gamma"
TWICE, SIX = 2, 6  # periods in a turn of the phase
GRID = 200_000


def cogging(rig: RigFile, drawn: Truth, speed: float, place: float) -> dict[tuple[str, str], float]:
    """By quantity and loop, or part of one, turned at `speed` rad/s at `place` m along."""
    p: PlantParams = drawn.plant.plant
    drag = braking(p, {name: one.default for name, one in rig.parameters.items()}, speed, place)
    first, other = (0.5 * p.cogging_torque * cmath.exp(-1j * SIX * zero) for zero in p.zero_ra)
    both = first + other
    along = _of(ALONG, "force", p.cogging_force, p.cogging_force_2 / p.cogging_force, 0.0, p.force_constant)
    around = _of(AROUND, "torque", abs(both), 0.0, drag, sum(p.torque_constant))
    phases = {
        ("cogging_phase", ALONG): math.remainder(p.zero_la, math.pi),
        ("cogging_phase", AROUND): -cmath.phase(both) / SIX,
    }
    return along | around | phases


def braking(p: PlantParams, firmware: Mapping[str, float], speed: float, place: float) -> float:
    """Half of what the torque up has over that down, N m. Nothing rubs on a mover that floats; but loops that hold it leave of
    their readings E = -K C/(G - K), C = R - M, G = k_P + k_I/s, of runout R and uneven magnets M: a quarter of a turn late, so
    that currents with K_B I = K (C - E) brake or drive, by P K_B Im(X* I), X = E - R. All turn as exp(-j angle)."""
    s = -1j * speed
    loop = firmware["kp.b"] + firmware["ki.b"] / s
    run = p.runout * cmath.exp(1j * (p.runout_phase + p.runout_per_m * place))
    out = 0.0
    for pull, uneven, phase in zip(p.pull, p.uneven, p.uneven_phase, strict=True):
        torque = []
        for gain in (loop, loop.conjugate()):  # up, down
            both = run - uneven * cmath.exp(1j * phase)
            left = -pull * both / (gain - pull)
            torque.append(POLE_PAIRS * pull * ((left - run).conjugate() * (both - left)).imag)
        out += (torque[1] - torque[0]) / 2
    return out


def _of(loop: str, kind: str, size: float, second: float, drag: float, constant: float) -> dict[tuple[str, str], float]:
    b = 2 * np.pi * np.arange(GRID) / GRID
    peak = size * float(np.abs(np.sin(b) + second * np.sin(2 * b)).max())
    return {
        ("cogging_current", loop): size / constant, (f"cogging_{kind}", loop): size,
        ("peak_current", loop): peak / constant, (f"peak_{kind}", loop): peak,
        ("friction_current", loop): drag / constant, (f"friction_{kind}", loop): drag,
        ("second_share", f"{loop}, sine"): second, ("second_share", f"{loop}, cosine"): 0.0,
    }  # fmt: skip
