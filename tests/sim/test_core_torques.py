"""What turns, brakes and weighs down the shaft besides the motor: drag of the bearings, brake, lever, ring."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import floating, levitated, quiet

from sim_backend.core import LEVITATE, DriveLaw
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import Plant, derivative

Array = npt.NDArray[np.float64]
X, Y, PHI, THETA = 6, 7, 9, 11
RELEASED = ControlParams(kp_theta=0.0, kd_theta=0.0, ki_theta=0.0)


def rates(
    p: PlantParams, coil: Array, lever: tuple[float, float, float, float] = (0, 0, 0, 0), **state: float
) -> Array:
    """Rates of the machine at the centre, at `theta` and `spin`."""
    s = np.zeros(14)
    s[5], s[11] = state.get("theta", 0.0), state.get("spin", 0.0)
    return derivative(p, s, coil, np.zeros(4), lever=lever)


@pytest.mark.parametrize(
    ("currents", "factor"),
    [
        ((3, 3, 3, 3, 3, 3, 3, 3), 1.0),
        ((4, 4, 4, 4, 4, 4, 4, 4), 1 - 0.6 + 0.6 * 16 / 9),
        ((0, 0, 0, 0, 0, 0, 0, 0), 1 - 0.6),
        ((3, 3, 3, 3, 0, 0, 0, 0), 1 - 0.6 + 0.6 / 2),  # outboard AMB off: the motor carries
        ((5, 1, 4, 2, 3.5, 2.5, 2, 4), 1.0),  # control currents change no sum
    ],
)
def test_drag_goes_with_the_square_of_the_bearings_currents(currents: tuple[float, ...], factor: float) -> None:
    p = dataclasses.replace(floating(viscous=0.08, drag_share=0.6), beta=(0.0, 0.0))
    out = rates(p, np.array([*currents, 2.0, 2.0]), spin=-20.0)
    assert out[THETA] * p.polar_inertia == pytest.approx(0.08 * 20 * factor, rel=1e-12)


def test_asymmetry_is_of_the_x_axis() -> None:
    p = floating(asymmetry=(0.03, -0.02))
    for b, a in enumerate((0.03, -0.02)):
        x, y = np.zeros(10), np.zeros(10)
        x[4 * b], y[4 * b + 2] = 4.0, 4.0
        assert rates(p, x)[X] / rates(p, y)[Y] == pytest.approx(1 + a, rel=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.2])
def test_lever_torque_and_weight(angle: float) -> None:
    """A weight on the left (-x) end turns forward: (-l cos a)(-W) = +W l cos a; and it pulls the shaft down at its plane."""
    p = floating(tilt=2e-3)
    out = rates(p, np.zeros(10), (9.8, 9.8 * 0.23, 0.0, 0.0), theta=angle)
    assert out[THETA] * p.polar_inertia == pytest.approx(9.8 * 0.23 * math.cos(angle), rel=1e-12)
    assert out[Y] * p.mass == pytest.approx(-9.8 * math.cos(2e-3), rel=1e-12)
    assert out[X] * p.mass == pytest.approx(9.8 * math.sin(2e-3), rel=1e-12)
    assert out[PHI] * p.inertia == pytest.approx(p.z_lever * 9.8 * math.cos(2e-3), rel=1e-12)


def test_what_is_mounted_adds_to_the_polar_inertia() -> None:
    p = floating()
    alone, more = (rates(p, np.zeros(10), (1.0, 0.2, 0.0, inertia)) for inertia in (0.0, 0.02))
    assert alone[THETA] / more[THETA] == pytest.approx((p.polar_inertia + 0.02) / p.polar_inertia, rel=1e-12)


def test_hung_masses_show_in_the_torque_current() -> None:
    """T 6.6.4 with g: i = -W l / alpha_tau for the left end and +W l / alpha_tau for the right one."""
    plant = levitated(quiet(detent=0.0, beta_2=0.0))
    currents = []
    for mass, weight, arm in ((2.0, 19.6, 0.23), (0.0, 0.0, 0.23), (2.0, 19.6, -0.2295)):
        plant.lever(mass, weight, arm, 0.3)
        plant.run(30000)
        currents.append(plant.run(2000)[:, 17:21].mean())
    assert plant.trips == 0
    np.testing.assert_allclose(currents, np.array([-0.23, 0, 0.2295]) * 19.6 / 2.87, atol=3e-3)


def test_the_lever_slips_with_its_torque() -> None:
    """da/dt = k W l cos a, so a = 2 atan(tanh(k W l t / 2)); it is set level again when a mass is hung."""
    plant = levitated(quiet(lever_slip=0.02, detent=0.0))
    expected = 2 * math.atan(math.tanh(0.02 * 9.8 * 0.23 / 2))
    for arm in (0.23, -0.23):
        plant.lever(1.0, 9.8, arm, 0.0)
        plant.run(10000)
        assert plant.slip == pytest.approx(math.copysign(expected, arm), rel=2e-2)


@pytest.mark.parametrize(("ring", "brake"), [(0.0, 0.0), (0.02, 0.0), (0.0, 0.1)])
def test_a_run_down_has_the_inertia_and_the_friction(ring: float, brake: float) -> None:
    """J dw/dt = -B w - T_c - brake, over 0.4 s from about 30 rad/s."""
    p = quiet(brake=brake, detent=0.0)
    plant = Plant(p, control=RELEASED)
    plant.set_state(np.array([*(0.0,) * 11, 30.0, 0.0, 0.0]))
    plant.mode = LEVITATE
    plant.mount(ring)
    plant.run(2000)
    start = plant.shaft_speed
    plant.run(4000)
    inertia, dry = p.polar_inertia + ring, p.coulomb + brake
    decay = math.exp(-p.viscous * 0.4 / inertia)
    assert plant.shaft_speed == pytest.approx(start * decay - dry / p.viscous * (1 - decay), rel=5e-4)


def test_a_drive_that_drives_does_not_brake() -> None:
    torques = []
    for brake in (0.0, 0.5):
        plant = Plant(quiet(brake=brake), control=RELEASED)
        plant.mode = LEVITATE
        plant.drive(DriveLaw(20.0, 8.0, 40.0), 20.0)
        plant.run(15000)
        torques.append(plant.drive_torque)
    assert torques[0] == pytest.approx(torques[1], rel=1e-9)
