"""The C core: against the reference, against formulas, signs, noise, determinism."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp

from sim_backend import core, reference
from sim_backend.core import Plant, derivative, normals
from sim_backend.core.params import PlantParams
from sim_backend.reference import Loads, Reference

QUIET = replace(
    PlantParams(), position_noise=0.0, current_noise=0.0, position_lsb=0.0, current_lsb=0.0, encoder_counts=0.0
)
SIGNALS = [0, 1, 2, 3, 4, 5]


def levitated(params: PlantParams, substeps: int = 2) -> tuple[Plant, Reference]:
    """Core and reference at the same place, a little off centre, both levitating from the next tick on."""
    plant, ref = Plant(params, 0, substeps=substeps), Reference(params, substeps=substeps)
    start = np.array([5e-6, -8e-6, 3e-6, 2e-5, -1e-5, 0.3, 0, 0, 0, 0, 0, 0, 0, 0], float)
    plant.set_state(start)
    plant.mode = core.READY
    plant.mode = core.LEVITATE
    plant.set("angle_ref", 0.35)
    ref.c = replace(ref.c, angle_ref=0.35)
    ref.s = start.copy()
    positions, angle = ref.readings()
    c = ref.c
    ref.previous = np.array([*(positions[:2] + c.share_i * (positions[2:4] - positions[:2])),
                             *(positions[:2] + c.share_o * (positions[2:4] - positions[:2])), positions[4]])  # fmt: skip
    ref.angle_previous = angle
    return plant, ref


def follow(plant: Plant, ref: Reference, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    ours = []
    for _ in range(ticks):
        plant.run(1)
        ours.append(plant.state()["s"])
    return np.array(ours), ref.advance(ticks)


def error(a: np.ndarray, b: np.ndarray) -> float:
    return float(max(np.abs(a[:, k] - b[:, k]).max() / np.abs(b[:, k]).max() for k in SIGNALS))


def test_core_follows_the_reference_through_a_load_and_a_turn() -> None:
    plant, ref = levitated(QUIET)
    first = follow(plant, ref, 300)
    plant.load(1.25, 12.0, 0.05)
    ref.loads.hung_mass, ref.weight_to, ref.weight_rate = 1.25, 12.0, 12.0 / 0.05
    ref.s[12] = ref.s[1] - QUIET.z_hook * ref.s[3]
    ref.s[13] = ref.s[7] - QUIET.z_hook * ref.s[9]
    second = follow(plant, ref, 700)
    assert error(*first) < 1e-6
    assert error(*second) < 1e-6


def test_reference_agrees_with_an_adaptive_integrator() -> None:
    _, ref = levitated(QUIET)
    _, exact = levitated(QUIET)

    def adaptive(self: Reference) -> None:
        done = solve_ivp(lambda t, s: reference.derivative(self.p, s, self.loads_at(t)), (0, reference.TICK_S), self.s,
                         method="DOP853", rtol=1e-12, atol=1e-18)  # fmt: skip
        self.s = done.y[:, -1]
        self.loads = self.loads_at(reference.TICK_S)

    exact.interval = adaptive.__get__(exact)  # type: ignore[method-assign]
    assert error(ref.advance(150), exact.advance(150)) < 1e-6


def test_order_of_convergence_is_four() -> None:
    def end(substeps: int) -> np.ndarray:
        plant, _ = levitated(QUIET, substeps)
        plant.run(300)
        return plant.state()["s"][:6]

    fine = end(16)
    coarse, middle = (np.abs(end(n) - fine).max() for n in (1, 2))
    assert np.log2(coarse / middle) == pytest.approx(4, abs=0.5)


def test_derivative_equals_the_reference_at_random_states() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        scale = [2e-4, 2e-4, 1e-4, 5e-4, 5e-4, 6, 0.05, 0.05, 0.05, 0.5, 0.5, 60, 3e-4, 0.05]
        s = rng.normal(0, scale)
        coil, segment, play = rng.uniform(0, 6, 10), rng.uniform(-5, 5, 4), rng.uniform(-1e-3, 1e-3, 4)
        gamma, mass, weight = rng.uniform(-0.1, 0.1), rng.choice([0.0, 2.0]), 20.0
        want = reference.derivative(QUIET, s, Loads(coil, segment, play, gamma, mass, weight))
        got = derivative(QUIET, s, coil, segment, play=play, gamma=gamma, hung_mass=mass, weight=weight)
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-9)


BARE = replace(QUIET, offset_x=(0.0, 0.0), offset_y=(0.0, 0.0), runout=(0.0,) * 8, motor_x=0.0, motor_y=0.0, tilt=0.0)


def rates(
    coil: dict[int, float] | None = None, segment: tuple[float, ...] = (0, 0, 0, 0), **state: float
) -> np.ndarray:
    names = ["x", "y", "z", "phi", "psi", "theta", "vx", "vy", "vz", "wphi", "wpsi", "spin"]
    s = np.zeros(14)
    for name, value in state.items():
        s[names.index(name)] = value
    current = np.zeros(10)
    for k, value in (coil or {}).items():
        current[k] = value
    return derivative(BARE, s, current, np.array(segment, float))


@pytest.mark.parametrize(
    ("coil", "component", "sign"),
    [(0, 6, 1), (1, 6, -1), (2, 7, 1), (3, 7, -1), (4, 6, 1), (6, 7, 1), (8, 8, 1), (9, 8, -1),
     (2, 9, 1), (6, 9, -1), (0, 10, -1), (4, 10, 1)],
)  # fmt: skip
def test_each_coil_pulls_its_way(coil: int, component: int, sign: int) -> None:
    """T (6.6): an upward inboard force raises phi, an outboard one lowers it; psi the other way round."""
    change = rates({coil: 3.0})[component] - rates()[component]
    assert np.sign(change) == sign


def test_motor_forces_and_torque_signs() -> None:
    still = rates()
    assert rates(segment=(1, 0, -1, 0))[7] > still[7]  # i_y lifts, T (6.5b)
    assert rates(segment=(0, -1, 0, 1))[6] > still[6]  # i_x pushes to +x, T (6.5a)
    assert rates(segment=(1, 1, 1, 1))[11] > 0  # T (6.5c)
    assert rates(y=1e-5)[7] > still[7]  # negative stiffness pulls on
    assert rates(spin=10)[11] < 0


def test_slope_and_curvature_of_an_amb() -> None:
    """K = 2 b (A + B) and K2 = A - B of F = A ip^2 - B in^2 (T 2.4), by differences of the core's force."""
    beta, gap, xi, b = QUIET.beta[1], QUIET.gap[1], 40e-6, 3.0

    def force(i: float) -> float:
        return float(core._lib.tsbs_amb_force(beta, gap, xi, b + i, b - i))

    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    assert (force(1e-3) - force(-1e-3)) / 2e-3 == pytest.approx(2 * b * (near + far), rel=1e-9)
    assert (force(1) - 2 * force(0) + force(-1)) / 2 == pytest.approx(near - far, rel=1e-9)


def test_hung_weight_divides_by_the_spans() -> None:
    """T (6.11), corrected: -W d/s inboard, +W (1 + d/s) outboard, from the currents of the levitated plant."""
    p = replace(BARE, hysteresis=0.0, target=(0.0,) * 8)
    plant = Plant(p, 0)
    plant.mode = core.READY
    plant.run(100)
    plant.mode = core.LIFT
    plant.run(12_000)
    plant.mode = core.LEVITATE
    plant.load(0.25, 2.4, 0.3)
    plant.run(12_000)
    before = plant.run(2000).mean(axis=0)
    plant.load(2.25, 22.4, 0.3)
    plant.run(12_000)
    after = plant.run(2000).mean(axis=0)
    names = core.CHANNELS
    change = {
        b: ((after - before)[names.index(f"i_y{b}_p")] - (after - before)[names.index(f"i_y{b}_n")]) / 2 for b in "io"
    }
    d, s = p.z_hook - p.z_amb[1], p.z_amb[1] - p.z_amb[0]
    slope = [4 * p.beta[b] * 3 / p.gap[b] ** 2 for b in (0, 1)]
    assert change["i"] * slope[0] == pytest.approx(-20 * d / s, rel=2e-3)
    assert change["o"] * slope[1] == pytest.approx(20 * (1 + d / s), rel=2e-3)


def test_noise_is_normal_and_streams_differ() -> None:
    x, y = normals(1, 0, 400_000), normals(1, 1, 400_000)
    assert stats.kstest(x, "norm").pvalue > 1e-3
    assert abs(stats.kurtosis(x)) < 0.03
    assert (np.abs(x) > 3.5).mean() == pytest.approx(2 * stats.norm.sf(3.5), rel=0.2)
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.01
    np.testing.assert_array_equal(x[:10], normals(1, 0, 10))
    assert not np.array_equal(x[:10], normals(2, 0, 10))


def test_equal_seeds_give_equal_rows() -> None:
    def rows(seed: int) -> bytes:
        plant = Plant(seed=seed)
        plant.mode = core.READY
        return plant.run(2000).tobytes()

    assert rows(3) == rows(3)
    assert rows(3) != rows(4)


def test_running_in_parts_changes_nothing() -> None:
    def rows(part: int) -> np.ndarray:
        plant = Plant(seed=5)
        plant.mode = core.READY
        return np.concatenate([plant.run(part) for _ in range(1200 // part)])

    np.testing.assert_array_equal(rows(1200), rows(8))


def test_rotor_rests_on_the_rings_when_off() -> None:
    plant = Plant(QUIET, 0)
    plant.run(5000)
    s = plant.state()["s"]
    for z in QUIET.z_sensor:
        r = np.hypot(s[0] + z * s[4], s[1] - z * s[3])
        assert QUIET.clearance - 1e-6 < r < QUIET.clearance + 5e-5
