"""The twin in cases that are solved by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from twin_rigs import ONE_AXIS, SPINDLE, STAND, column, levitated, nominal, plant_of, rig

from sim_backend.core import DriveLaw
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.plant import TwinPlant

STAND_RIG, SPINDLE_RIG = rig("stand", STAND), rig("spindle", SPINDLE)


def floating(p: TwinParams, **changes: object) -> TwinPlant:
    """Without weight, coupling, drag and currents."""
    weightless = {"gravity": (0.0, 0.0, 0.0), "coupling": 0.0, "viscous": 0.0, "coulomb": 0.0}
    return TwinPlant(dataclasses.replace(p, **weightless | changes))


def test_without_currents_it_falls() -> None:
    p = nominal(STAND_RIG).plant
    plant = TwinPlant(p)
    plant.set_state(np.zeros(20))
    plant.run(40)  # 78 um; the rings are at 160
    assert plant.state()["s"][1] == pytest.approx(-9.81175 * 4e-3**2 / 2, rel=1e-9)
    assert plant.state()["s"][7] == pytest.approx(-9.81175 * 4e-3, rel=1e-9)


def test_static_currents_carry_the_weight() -> None:
    """F = beta ((b + i)^2 - (b - i)^2)/gap^2 = 4 beta b i/gap^2, by the lever rule: 150 and 100 mm from the centre of mass."""
    t = nominal(STAND_RIG)
    plant, p = levitated(t, 3.0), t.plant
    rows = plant.run(1000)
    for k, (axis, share) in enumerate({"xl": 0.0, "yl": 0.4, "xr": 0.0, "yr": 0.6}.items()):
        bias = plant.get("bias.links" if k < 2 else "bias.rechts")
        i = share * 8.0 * 9.81175 * p.gap[k] ** 2 / (4 * p.beta[k] * bias)
        plus, minus = (column(plant, rows, f"amp_{axis}_{c}").mean() for c in "pn")
        assert (plus, minus) == pytest.approx((bias + i, bias - i), abs=1e-5)


def test_one_coil_carries_with_its_bias() -> None:
    t = nominal(rig("one", ONE_AXIS))
    plant = levitated(t, 2.0)
    i = 5e-4 * math.sqrt(2.0 * 9.81175 / t.plant.beta[0])
    assert column(plant, plant.run(1000), "amp_y_p").mean() == pytest.approx(i, abs=1e-5)
    assert "amp_y_n" not in plant.channels


def test_an_upright_shaft_carries_no_radial_weight() -> None:
    t = nominal(SPINDLE_RIG, **{"coupling__offset": 0.0})
    plant, p = levitated(t, 3.0), t.plant
    rows = plant.run(1000)
    for axis in ("u1", "v1", "u2", "v2"):
        plus, minus = (column(plant, rows, f"amp_{axis}_{c}").mean() for c in "pn")
        assert plus == pytest.approx(minus, abs=1e-4)
    bias = plant.get("bias.thrust")
    i = 4.0 * 9.81175 * p.gap_x**2 / (4 * p.beta_x * bias)
    assert column(plant, rows, "amp_w_p").mean() == pytest.approx(bias + i, abs=1e-5)


def test_nutation_of_a_free_shaft() -> None:
    """I psi'' = -I_p w theta', I theta'' = I_p w psi': the rates turn at w I_p/I."""
    p = nominal(STAND_RIG).plant
    plant = floating(dataclasses.replace(p, unbalance=(0.0,) * 4))
    s = np.zeros(20)
    s[9], s[11] = 0.01, 1500.0
    plant.set_state(s)
    plant.run(100)
    turned = plant.state()["s"][9:11]
    angle = 1500.0 * p.polar_inertia / p.inertia * 0.01
    assert turned == pytest.approx(0.01 * np.array([math.cos(angle), math.sin(angle)]), rel=1e-6)


def test_a_fast_shaft_turns_about_its_mass_centre() -> None:
    """Nothing holds it: the centre line runs on a circle of u/m, opposite to the unbalance, and the mass centre stands."""
    p = nominal(STAND_RIG).plant
    u, phase, w = 2e-4, 0.7, 1200.0
    plant = floating(p, plane=(0.0,) * 4, unbalance=(u, 0.0, 0.0, 0.0), unbalance_phase=(phase, 0.0, 0.0, 0.0))
    s, r = np.zeros(20), u / p.mass
    s[1:3] = -r * math.cos(phase), -r * math.sin(phase)
    s[7:9] = r * w * math.sin(phase), -r * w * math.cos(phase)
    s[11] = w
    plant.set_state(s)
    plant.run(200)
    at, turned = plant.state()["s"], w * 0.02 + phase
    assert at[1:3] == pytest.approx(-r * np.array([math.cos(turned), math.sin(turned)]), rel=1e-5, abs=1e-5 * r)


def test_a_probe_reads_the_projection() -> None:
    """The spindle's u2 looks along 75 degrees, v1 along 120 with sign -1, whatever the axes of the bearings; its speed counts
    clockwise, so that the core's z is to the right."""
    t = nominal(SPINDLE_RIG, site__gravity=0.0)
    plant = plant_of(t)
    up, left = 30e-6, 50e-6
    s = np.zeros(20)
    s[0], s[1], s[2] = -20e-6, up, -left
    plant.set_state(s)
    row = plant.run(1, 1)[1][0]
    read = dict(zip(plant.trace_channels, row.tolist(), strict=True))
    deg = math.radians
    assert read["pos_u2"] == pytest.approx(up * math.cos(deg(75)) + left * math.sin(deg(75)), abs=1e-12)
    assert read["pos_v1"] == pytest.approx(-(up * math.cos(deg(120)) + left * math.sin(deg(120))), abs=1e-12)
    assert read["pos_w"] == pytest.approx(20e-6, abs=1e-12)


def test_coasting_down() -> None:
    """I_p w' = -(c w + T): w = (w0 + T/c) exp(-c t/I_p) - T/c."""
    t = nominal(STAND_RIG)
    plant, p = levitated(t, 0.2), t.plant
    s = plant.state()["s"]
    s[11] = 400.0
    plant.set_state(s)
    plant.run(20000)
    decay = math.exp(-p.viscous * 2.0 / p.polar_inertia)
    assert plant.shaft_speed == pytest.approx((400 + p.coulomb / p.viscous) * decay - p.coulomb / p.viscous, rel=1e-6)


def test_the_mark_tells_edges_speed_and_angle() -> None:
    """Driven at 200 rad/s: an edge every 2 pi/200 s, told in microseconds when the mark is at 40 degrees."""
    plant = levitated(nominal(SPINDLE_RIG), 0.1)
    s = plant.state()["s"]
    s[11] = 200.0
    plant.set_state(s)
    plant.drive(DriveLaw(5.0, 100.0, 1e6), 200.0)
    rows = plant.run(5000)
    edges, counts, told = (column(plant, rows, name) for name in ("edge", "count", "rate"))
    new = np.flatnonzero(np.diff(counts) == 1) + 1
    assert np.diff(edges[new])[2:] == pytest.approx(2 * math.pi / 200, abs=2e-6)
    assert edges[new] * 1e6 == pytest.approx(np.round(edges[new] * 1e6), abs=1e-3)
    assert told[-50:] == pytest.approx(200.0, rel=1e-3)
    core = (plant.state()["s"][5] - (-math.radians(40))) % (2 * math.pi)  # clockwise: the mark is told at -40 degrees
    assert column(plant, rows, "ang")[-1] % (2 * math.pi) == pytest.approx(core, abs=200 * 2e-4)


def test_a_touching_shaft_rests_on_its_ring() -> None:
    plant = plant_of(nominal(STAND_RIG))
    rows = plant.run(10000)
    assert column(plant, rows, "status.current_limit").max() == 0
    depth = 8.0 * 9.81175 / 2 / plant.params.ring_stiffness
    at = plant.state()["s"]
    assert at[1] == pytest.approx(-(plant.params.clearance[0] + depth), rel=0.02)
