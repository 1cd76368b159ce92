"""Sign and size of every force and moment of the core, one at a time, from the equations by hand."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import floating

from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import derivative

Array = npt.NDArray[np.float64]
X, Y, Z, PHI, PSI, THETA = range(6, 12)
ANYWHERE = (3e-5, -2e-5, 1e-5, 2e-4, -3e-4, 0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def rates(
    p: PlantParams, coil: dict[int, float] | None = None, segment: tuple[float, ...] = (0.0,) * 4, **state: float
) -> Array:
    """Rates of the machine at the centre, except for the given currents and states."""
    s, i = np.zeros(14), np.zeros(10)
    names = ["x", "y", "z", "phi", "psi", "theta", "vx", "vy", "vz", "dphi", "dpsi", "spin", "height", "rise"]
    for name, value in state.items():
        s[names.index(name)] = value
    for k, value in (coil or {}).items():
        i[k] = value
    return derivative(p, s, i, np.array(segment))


def test_nothing_acts_on_a_floating_machine() -> None:
    out = derivative(floating(), np.array(ANYWHERE), np.zeros(10), np.zeros(4))
    np.testing.assert_array_equal(out, np.zeros(14))


def test_gravity_pulls_down_and_along_a_tilt() -> None:
    out = rates(floating(gravity=9.81, tilt=3e-3))
    assert out[X] == pytest.approx(9.81 * math.sin(3e-3), rel=1e-14)
    assert out[Y] == pytest.approx(-9.81 * math.cos(3e-3), rel=1e-14)


@pytest.mark.parametrize("bearing", [0, 1])
@pytest.mark.parametrize("pull", [1, -1])
def test_radial_coils(bearing: int, pull: int) -> None:
    """A p coil pulls toward its positive axis; T (6.6d, e): +F_x turns psi by zeta, +F_y turns phi by -zeta."""
    p = floating()
    first = 4 * bearing + (pull < 0)
    force = pull * p.beta[bearing] * 4.0**2 / p.gap[bearing] ** 2
    x, y = rates(p, {first: 4.0}), rates(p, {first + 2: 4.0})
    turned = p.z_amb[bearing] * force / p.inertia
    np.testing.assert_allclose(x[6:12], [force / p.mass, 0, 0, 0, turned, 0], rtol=1e-13)
    np.testing.assert_allclose(y[6:12], [0, force / p.mass, 0, -turned, 0, 0], rtol=1e-13)


def test_axial_coils() -> None:
    p = floating()
    force = p.beta_z * 2.0**2 / p.gap_z**2
    assert rates(p, {8: 2.0})[Z] == pytest.approx(force / p.mass, rel=1e-13)
    assert rates(p, {9: 2.0})[Z] == pytest.approx(-force / p.mass, rel=1e-13)


def test_bearing_displacement_follows_the_tilted_shaft() -> None:
    """T (6.7): a shaft turned by phi stands lower at positive zeta; the lower magnet is then nearer and pulls more."""
    p = floating()
    out = rates(p, {6: 3.0, 7: 3.0}, phi=1e-3)
    xi = -p.z_amb[1] * 1e-3
    force = p.beta[1] * 9 * (1 / (p.gap[1] - xi) ** 2 - 1 / (p.gap[1] + xi) ** 2)
    assert out[Y] == pytest.approx(force / p.mass, rel=1e-12)
    assert out[Y] < 0


def test_hysteresis_takes_from_one_coil_and_gives_to_the_other() -> None:
    p = floating()
    coil = np.zeros(10)
    coil[2:4] = 3.0
    out = derivative(p, np.zeros(14), coil, np.zeros(4), play=np.array([0.0, 0.1, 0.0, 0.0]))
    assert out[Y] * p.mass == pytest.approx(p.beta[0] * (2.9**2 - 3.1**2) / p.gap[0] ** 2, rel=1e-12)


def test_magnetic_offset_and_runout() -> None:
    """Offset moves the journal toward the positive magnet; runout turns with the shaft, cosine in x and sine in y."""
    p = floating(offset_y=(20e-6, 0.0), runout=(0.0, 5e-6, *(0.0,) * 6), runout_phase=(0.0, 0.3, *(0.0,) * 6))
    coil = {0: 3.0, 1: 3.0, 2: 3.0, 3: 3.0}
    out = rates(p, coil, theta=0.5)
    xi, eta = 5e-6 * math.cos(1.3), 20e-6 + 5e-6 * math.sin(1.3)

    def force(e: float) -> float:
        return p.beta[0] * 9 * (1 / (p.gap[0] - e) ** 2 - 1 / (p.gap[0] + e) ** 2)

    assert out[X] * p.mass == pytest.approx(force(xi), rel=1e-9)
    assert out[Y] * p.mass == pytest.approx(force(eta), rel=1e-9)


def test_motor_forces_and_torque() -> None:
    """T (6.5): i_y = (i1 - i3)/2 lifts, i_x = (i4 - i2)/2 pushes along x, the mean of all four turns."""
    p = floating()
    lever = p.z_motor / p.inertia
    up = rates(p, segment=(1.0, 0.0, -1.0, 0.0))
    np.testing.assert_allclose(up[[X, Y, PHI, THETA]], [0, p.alpha_d / p.mass, -lever * p.alpha_d, 0], rtol=1e-13)
    side = rates(p, segment=(0.0, -1.0, 0.0, 1.0))
    np.testing.assert_allclose(side[[X, Y, PSI, THETA]], [p.alpha_d / p.mass, 0, lever * p.alpha_d, 0], rtol=1e-13)
    turn = rates(p, segment=(2.0,) * 4)
    np.testing.assert_allclose(turn[[X, Y, THETA]], [0, 0, 2 * p.alpha_tau / p.polar_inertia], rtol=1e-13, atol=1e-13)


def test_commutation_angle_couples_the_axes() -> None:
    p = floating(gamma_zero=0.01)
    q = math.sin(8 * (0.03 - 0.01))
    out = derivative(p, np.zeros(14), np.zeros(10), np.array([1.0, 0.0, -1.0, 0.0]), gamma=0.03)
    assert out[X] * p.mass == pytest.approx(-p.alpha_c * q, rel=1e-12)
    assert out[Y] * p.mass == pytest.approx(p.alpha_d * math.sqrt(1 - q * q), rel=1e-12)


def test_motor_stiffness_is_negative() -> None:
    p = floating(alpha_x=2e5, motor_x=1e-6)
    out = rates(p, x=2e-5, y=-3e-5)
    np.testing.assert_allclose(out[[X, Y]] * p.mass, [2e5 * 2.1e-5, -2e5 * 3e-5], rtol=1e-12)


def test_gyroscopic_moments() -> None:
    p = floating()
    k = p.polar_inertia / p.inertia
    assert rates(p, spin=50.0, dpsi=0.2)[PHI] == pytest.approx(-k * 50 * 0.2, rel=1e-13)
    assert rates(p, spin=50.0, dphi=0.2)[PSI] == pytest.approx(k * 50 * 0.2, rel=1e-13)


def test_unbalance_points_outward_and_turns_with_the_shaft() -> None:
    p = floating(eccentricity=2e-6, eccentricity_phase=0.7)
    out = rates(p, spin=60.0, theta=0.4)
    np.testing.assert_allclose(out[[X, Y]], 2e-6 * 3600 * np.array([math.cos(1.1), math.sin(1.1)]), rtol=1e-12)


def test_drag_and_detent() -> None:
    assert rates(floating(viscous=0.08, drag_share=0.0), spin=10.0)[THETA] * 0.033 == pytest.approx(-0.8, rel=1e-12)
    assert rates(floating(coulomb=0.05), spin=30.0)[THETA] * 0.033 == pytest.approx(-0.05, rel=1e-5)
    assert rates(floating(coulomb=0.05), spin=-30.0)[THETA] * 0.033 == pytest.approx(0.05, rel=1e-5)
    held = rates(floating(detent=0.01, detent_phase=0.4), theta=0.02)
    assert held[THETA] * 0.033 == pytest.approx(-0.01 * math.sin(16 * 0.02 + 0.4), rel=1e-12)


def test_touchdown_pushes_inward_and_rubs_against_the_spin() -> None:
    p = floating()
    deep = 1e-5
    out = rates(p, y=-(p.clearance + deep), spin=50.0)
    push = p.ring_stiffness * deep  # on each ring; the surface at the bottom moves toward +x
    assert out[Y] * p.mass == pytest.approx(2 * push, rel=1e-9)
    assert out[X] * p.mass == pytest.approx(-2 * p.ring_friction * push, rel=1e-9)
    assert out[THETA] * p.polar_inertia == pytest.approx(-2 * p.ring_friction * push * p.ring_radius, rel=1e-9)
    leaving = rates(p, y=-(p.clearance + deep), vy=1.0)
    assert leaving[Y] == 0  # a ring never pulls


def test_strap_pulls_the_hook_down_and_never_pushes() -> None:
    p = floating(tilt=2e-3)

    def hung(height: float) -> Array:
        s = np.zeros(14)
        s[12] = height
        return derivative(p, s, np.zeros(10), np.zeros(4), hung_mass=2.0, weight=19.6)

    taut, slack = hung(-1e-4), hung(1e-4)
    tension = p.strap_stiffness * 1e-4
    np.testing.assert_allclose(
        taut[[X, Y, PHI, PSI]],
        [tension * math.sin(2e-3) / p.mass, -tension * math.cos(2e-3) / p.mass,
         p.z_hook * tension * math.cos(2e-3) / p.inertia, p.z_hook * tension * math.sin(2e-3) / p.inertia],
        rtol=1e-12,
    )  # fmt: skip
    assert taut[13] == pytest.approx((tension - 19.6) / 2, rel=1e-12)
    np.testing.assert_array_equal(slack[[X, Y, PHI, PSI]], 0)
    assert slack[13] == pytest.approx(-9.8, rel=1e-12)
