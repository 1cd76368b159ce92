"""The twin's core against vectors in the rig file's own frame: every place, angle, sense and sign on the way into its
tables."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from twin_rigs import SPINDLE, STAND, THREES, bearing, nominal, number, rig, shipped, truth

from bench.rigfile import RigFile
from sim_backend.machines.twin.plant import derivative, follow
from sim_backend.machines.twin.reference import Rotor
from sim_backend.machines.twin.reference import derivative as by_vectors

RINGS = (
    f"[rings.l]\nclearance = {number(0.1, 'mm')}\nat = {number(-140, 'mm')}",
    f"[balancing.b]\nat = {number(0, 'mm')}\nradius = {number(9, 'mm')}",
)
RIGS = {
    "spindle": rig("spindle", SPINDLE),
    "stand": rig("stand", (*STAND, *RINGS)),
    "threes": rig("threes", (*THREES, RINGS[1])),
    "shipped": shipped(),
    "slanted": rig(
        "slanted",
        ('[shaft]\nfar_end = "far"', f"mass = {number(2, 'kg')}\ntilt = {number(35, 'deg')}", *STAND[2:], *RINGS),
    ),
}


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("spread", [0.2, 2.0])
def test_right_hand_side_equals_the_vectors(name: str, spread: float) -> None:
    """Anywhere, at any speed and currents, in contact too where the rings of a rig have places."""
    r: RigFile = RIGS[name]
    t = truth(r, 3)
    n, rng = len(t.plant.names.axes), np.random.default_rng(7)
    far = spread if any(ring.at for ring in r.rings.values()) or not r.rings else 0.2
    plant = t.plant if any(ring.at for ring in r.rings.values()) else dataclasses.replace(t.plant, clearance=(1.0,) * 8)
    for _ in range(20):
        s = np.zeros(20)
        s[:3], s[3:5] = rng.normal(size=3) * 1e-4 * far, rng.normal(size=2) * 5e-4 * far
        s[0] = np.clip(s[0], -1e-4, 1e-4) if plant.axial else 0.0
        s[5], s[6:11], s[11] = rng.uniform(0, 6), rng.normal(size=5) * 0.02, rng.normal() * 800
        s[6] *= plant.axial
        coil = np.zeros((2, 16))
        coil[:, :n] = rng.uniform(0, 4, (2, n))
        expected = by_vectors(Rotor(r, t.values), s, coil[:, :n], 0.02)
        found = derivative(plant, s, coil.ravel(), np.zeros(9), 0.02)
        assert found[:12] == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
        assert not found[12:].any()


def test_what_hangs_acts_where_and_as_it_is_told() -> None:
    p = nominal(RIGS["stand"]).plant
    load = np.array([0.0, -20.0, 5.0, 0.3, -0.4, 0, 0, 0, 0])
    without, with_it = (derivative(p, np.zeros(20), np.zeros(32), x) for x in (np.zeros(9), load))
    change = (with_it - without)[7:11]
    assert change == pytest.approx([-20 / p.mass, 5 / p.mass, 0.3 / p.inertia, -0.4 / p.inertia])


def test_amplifiers_are_exact_under_and_at_the_voltage_limit() -> None:
    """L di/dt = u - R i in steps of a nanosecond against the closed form."""
    p = dataclasses.replace(nominal(RIGS["stand"]).plant, u_max=20.0)
    inductance, i, h = p.inductance[0], 0.5, 1e-8
    for _ in range(20000):
        u = inductance * p.amplifier_rate * (4.0 - i) + p.resistance * i
        i += h * (min(max(u, -20.0), 20.0) - p.resistance * i) / inductance
    assert follow(p, 0, 0.5, 4.0, 2e-4) == pytest.approx(i, rel=1e-4)


def test_a_bending_mode_rings_at_its_frequency() -> None:
    """By hand: q'' = -2 d w q' - w^2 q + f/m at a place whose shape is 1."""
    table = "[simulation]\nmode_1_on = 1\nmode_1 = 300.0\nmode_damping = 0.01"
    ends = f"ends = [{number(-150, 'mm')}, {number(100, 'mm')}]"
    bearings = bearing("a", -150, {"x1": 90, "y1": 0}), bearing("b", 100, {"x2": 90, "y2": 0})
    r = rig("bent", (STAND[0], STAND[1], ends, *bearings, *STAND[4:], table))
    p = nominal(r).plant
    s, coil = np.zeros(20), np.zeros(32)
    s[12], s[16] = 1e-6, 1e-3
    w = 2 * np.pi * 300
    assert derivative(p, s, coil, np.zeros(9))[16] == pytest.approx(-2 * 0.01 * w * 1e-3 - w * w * 1e-6)
    s[:] = 0
    coil[1] = 2.0  # y1, at the near end
    pull = p.beta[1] * (2.0 / p.gap[1]) ** 2
    assert derivative(p, s, coil, np.zeros(9))[16] == pytest.approx(pull / (p.mass / 4))
