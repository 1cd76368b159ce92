"""Bearing constants against their formulas, and the levitated machine against statics (T 6.11 with corrected signs)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import centred, floating, levitated

from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import Plant, derivative

Array = npt.NDArray[np.float64]
BIAS = 3.0


def vertical_force(p: PlantParams, b: int, y: float, control: float) -> float:
    """Force in N of bearing `b` at a displacement, from the acceleration that it causes."""
    s, coil = np.zeros(14), np.zeros(10)
    s[1] = y
    coil[4 * b + 2], coil[4 * b + 3] = BIAS + control, BIAS - control
    return float(derivative(p, s, coil, np.zeros(4))[7]) * p.mass


@pytest.mark.parametrize("bearing", [0, 1])
@pytest.mark.parametrize("xi", [-60e-6, 0.0, 45e-6])
def test_force_is_quadratic_in_the_control_current(bearing: int, xi: float) -> None:
    """T (2.4) at constant current sum: F = K2 (b^2 + i^2) + K i with K = 2 b (A + B), K2 = A - B."""
    p = floating()
    near, far = (p.beta[bearing] / (p.gap[bearing] + side * xi) ** 2 for side in (-1, 1))
    k, k2 = 2 * BIAS * (near + far), near - far
    currents = np.linspace(-2, 2, 9)
    force = [vertical_force(p, bearing, xi, i) for i in currents]
    found = np.polyfit(currents, force, 2)
    np.testing.assert_allclose(found, [k2, k, k2 * BIAS**2], rtol=1e-9, atol=1e-9)


def test_nominal_slope_and_stiffness_at_the_centre() -> None:
    """At the magnetic centre K = 4 beta b / gap^2 and dF/dx = 4 beta b^2 / gap^3 = K b / gap, and both push outward."""
    p = floating()
    for b, slope in enumerate((73.2, 74.4)):
        assert (vertical_force(p, b, 0, 1e-3) - vertical_force(p, b, 0, -1e-3)) / 2e-3 == pytest.approx(slope, rel=1e-9)
        stiffness = (vertical_force(p, b, 1e-8, 0) - vertical_force(p, b, -1e-8, 0)) / 2e-8
        assert stiffness == pytest.approx(slope * BIAS / p.gap[b], rel=1e-6)


def bearing_forces(plant: Plant) -> Array:
    """Vertical force (2,) in N of both AMBs, from true currents and positions, T (2.4)."""
    p, state = plant.params, plant.state()
    s, coil = state["s"], state["coil"]
    xi = [s[1] - z * s[3] for z in p.z_amb]
    rows = [
        p.beta[b] * (coil[4 * b + 2] ** 2 / (p.gap[b] - xi[b]) ** 2 - coil[4 * b + 3] ** 2 / (p.gap[b] + xi[b]) ** 2)
        for b in (0, 1)
    ]
    return np.array(rows)


def test_bearings_share_the_rotor_and_a_hung_weight_by_the_levers() -> None:
    """A weight W at the hook, d outboard of the outboard AMB, changes F_o by W (1 + d/s) and F_i by -W d/s.

    Printed the other way round in the stacked system after T (6.11).
    """
    plant = levitated(centred())
    p = plant.params
    plant.run(5000)
    empty = bearing_forces(plant)
    span = p.z_amb[1] - p.z_amb[0]
    d = p.z_hook - p.z_amb[1]
    weight = p.mass * p.gravity
    np.testing.assert_allclose(empty, [weight * p.z_amb[1] / span, -weight * p.z_amb[0] / span], rtol=1e-6)
    plant.load(2.0, 19.6, 0.5)
    plant.run(25000)
    np.testing.assert_allclose(bearing_forces(plant) - empty, [-19.6 * d / span, 19.6 * (1 + d / span)], rtol=1e-6)


def test_off_centre_the_motor_carries_its_share() -> None:
    """Statics with the motor's pull alpha_x (y_m + offset), the rotor held where the sensors read zero."""
    plant = levitated(centred(motor_y=1e-5))
    plant.run(5000)
    p = plant.params
    pull, weight, (zi, zo) = p.alpha_x * 1e-5, p.mass * p.gravity, p.z_amb
    outboard = (-p.z_motor * pull - zi * (weight - pull)) / (zo - zi)
    np.testing.assert_allclose(bearing_forces(plant), [weight - pull - outboard, outboard], rtol=1e-6)


def test_telemetry_shows_the_same_forces_through_the_slope() -> None:
    """Without offsets F = K i exactly, so the telemetered control currents weigh the hung mass."""
    plant = levitated(centred())
    before = plant.run(1000)[-1]
    plant.load(1.0, 9.8, 0.5)
    plant.run(20000)
    after = plant.run(1000)[-1]
    change = after - before
    control = np.array([change[9] - change[10], change[13] - change[14]]) / 2
    np.testing.assert_allclose(control, [-9.8 * 1.2 / 73.2, 9.8 * 2.2 / 74.4], rtol=1e-5)
