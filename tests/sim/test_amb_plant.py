"""The AMB stand's physics: equilibrium, signs, gyroscopics, energy, bending, drive, sensors, pulses and defects."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from amb_plants import COLUMN, RPM, Array, levitated, quiet, spun, synchronous

from sim_backend.core import TRIPS, DriveLaw
from sim_backend.machines.amb5dof.params import AmbParams, unbalance
from sim_backend.machines.amb5dof.plant import CHANNELS, TRACE, AmbPlant, derivative
from sim_backend.machines.amb5dof.reference import amb_force

NONE = np.zeros(10)


def floating(**changes: object) -> AmbParams:
    """Nothing acts on the shaft but what a test switches on."""
    free = {
        "gravity_y": 0.0,
        "gravity_z": 0.0,
        "coupling": 0.0,
        "unbalance": (0.0, 0.0),
        "viscous": 0.0,
        "coulomb": 0.0,
    }
    return quiet(**free | changes)


def at(**values: float) -> Array:
    names = ("x", "y", "z", "psi", "theta", "phi", "vx", "vy", "vz", "psi_dot", "theta_dot", "omega")
    return np.array([*(values.get(name, 0.0) for name in names), *(0.0,) * 8])


def test_gravity_pulls_against_the_positive_coils() -> None:
    p = AmbParams()
    fall = derivative(dataclasses.replace(p, unbalance=(0.0, 0.0)), at(), NONE)[6:9]
    np.testing.assert_allclose(fall, [0, -9.81 / math.sqrt(2), -9.81 / math.sqrt(2)])
    upper = np.tile([1.0, 0.0], 5)
    assert (derivative(p, at(), upper)[6:9] > fall).all()


def test_coil_currents_and_offsets_hold_the_shaft_in_equilibrium() -> None:
    """T (2.5) with the coupling, by the printed force law alone; the offset's side is that which helps the upper coils."""
    plant = levitated(1, position_noise=0.0, current_noise=0.0)
    plant.run(30000)
    state, p = plant.state(), plant.params
    _, y, z, psi, theta = state["s"][:5]
    gaps = (y - p.l_ia * theta, z + p.l_ia * psi, y + p.l_oa * theta, z - p.l_oa * psi)
    force = [amb_force(p.beta[k], p.gap, gaps[k] + p.offset[k], *state["coil"][2 * k : 2 * k + 2]) for k in range(4)]
    m_i, m_o = (p.mass * arm / (p.l_ia + p.l_oa) for arm in (p.l_oa, p.l_ia))
    np.testing.assert_allclose(force, [-m_i * p.gravity_y] * 2 + [-m_o * p.gravity_y] * 2, rtol=2e-3)
    assert amb_force(p.beta[0], p.gap, p.offset[0], 1.0, 1.0) > 0


def test_coupling_pulls_the_inboard_end_back() -> None:
    p = floating(coupling=1200.0)
    pulled = derivative(p, at(theta=1e-4, psi=2e-4), NONE)
    lever = np.array([p.l_c, p.l_c]) * 1200 * p.l_c * np.array([1e-4, 2e-4])
    np.testing.assert_allclose(pulled[[10, 9]], -lever / p.inertia)
    np.testing.assert_allclose(pulled[7:9], np.array([1e-4, -2e-4]) * 1200 * p.l_c / p.mass)


def test_a_coupling_out_of_line_pulls_with_a_constant_force_at_its_plane() -> None:
    aside = np.array([4e-5, -3e-5])
    p = floating(coupling=1200.0, coupling_offset=tuple(aside))
    pulled = derivative(p, at(), NONE)
    np.testing.assert_allclose(pulled[7:9], 1200 * aside / p.mass)
    np.testing.assert_allclose(pulled[[10, 9]], np.array([-1, 1]) * 1200 * p.l_c * aside / p.inertia)
    relaxed = derivative(p, at(theta=-aside[0] / p.l_c, psi=aside[1] / p.l_c), NONE)
    np.testing.assert_allclose(relaxed[7:11], 0, atol=1e-12)


def test_a_free_spinning_shaft_nutates_forwards() -> None:
    """w = theta - j psi is how the shaft's end moves in y + j z: w'' = j (J_x/J) omega w', with the spin."""
    p, omega = floating(), 14000 * RPM
    plant = AmbPlant(p)
    plant.set_state(at(theta_dot=1e-3, omega=omega))
    plant.run(1000)
    s = plant.state()["s"]
    turned = (s[10] - 1j * s[9]) / 1e-3
    assert turned == pytest.approx(np.exp(1j * p.polar_inertia / p.inertia * omega * 0.1), abs=1e-6)


def test_energy_of_a_bending_free_shaft_is_kept() -> None:
    p = floating(coupling=1200.0, mode_on=(1.0, 1.0), mode_damping=(0.0, 0.0))
    plant, s = AmbPlant(p, substeps=20), at(y=1e-5, psi=1e-4, vz=1e-4, theta_dot=5e-3, omega=900.0)
    s[12:16] = [2e-6, -1e-6, 5e-7, 1e-6]

    def energy(s: Array) -> float:
        ends = [s[1] - p.l_c * s[4] + s[12] + s[14], s[2] + p.l_c * s[3] + s[13] + s[15]]
        rate = np.repeat(2 * np.pi * np.array(p.mode_hz), 2)
        bent = np.repeat(p.mode_mass, 2) * ((rate * s[12:16]) ** 2 + s[16:20] ** 2)
        moving = p.mass * (s[6:9] ** 2).sum() + p.inertia * (s[9:11] ** 2).sum()
        return float((moving + bent.sum() + p.coupling * np.square(ends).sum()) / 2)

    plant.set_state(s)
    before = energy(s)
    for _ in range(5):
        plant.run(200)
        assert energy(plant.state()["s"]) == pytest.approx(before, rel=2e-6)


def test_a_mode_rings_at_its_frequency_and_dies_at_its_rate() -> None:
    p = floating(mode_on=(0.0, 1.0), mode_damping=(0.0, 5e-3))
    s = at()
    s[14] = 1e-6
    plant = AmbPlant(p, substeps=10)
    plant.set_state(s)
    wave = plant.run(2000, 1)[1][:, 0]
    w = 2 * math.pi * 1240 * np.sqrt(1 - 25e-6) * np.arange(2000) * 1e-4
    expected = p.shape_sensor[2] * 1e-6 * np.exp(-5e-3 * 2 * math.pi * 1240 * np.arange(2000) * 1e-4) * np.cos(w)
    np.testing.assert_allclose(wave, expected, atol=6e-9)


def test_drive_and_drag() -> None:
    plant = AmbPlant(floating(viscous=8e-6, coulomb=2e-3))
    plant.drive(DriveLaw(0.02, 0.05, 200.0), 300.0)
    plant.run(20000)
    lag = (8e-6 * 300 + 2e-3) / 0.02
    assert plant.shaft_speed == pytest.approx(300 - lag, abs=0.05)
    assert plant.drive_torque == pytest.approx(8e-6 * plant.shaft_speed + 2e-3, rel=1e-3)
    plant.drive(None)
    plant.run(10000)
    lost = 2e-3 / 8e-6
    assert plant.shaft_speed == pytest.approx((300 - lag + lost) * math.exp(-8e-6 / 1.71e-4) - lost, abs=0.05)


def test_pulses_tell_turns_and_their_times() -> None:
    """Under constant acceleration: each pulse within 1 us of its time; mark at -pulse_angle."""
    plant = AmbPlant(floating(pulse_angle=1.0))
    plant.set_state(at(omega=400.0))
    plant.drive(DriveLaw(1e9, 0.02, 1e9), 1e6)
    rate = 0.02 / plant.params.polar_inertia
    trace = plant.run(3000, 1)[1]
    new = np.flatnonzero(np.diff(trace[:, TRACE.index("pulses")])) + 1
    times = new * 1e-4 - trace[new, TRACE.index("pulse_age")]
    angles = 2 * math.pi * np.arange(1, len(new) + 1) - 1.0
    np.testing.assert_allclose(times, (np.sqrt(400**2 + 2 * rate * angles) - 400) / rate, atol=1e-6)
    assert trace[-1, TRACE.index("speed")] == pytest.approx(400 + rate * 0.3, rel=0.01)
    plant.drive(None)
    plant.set_state(at())
    plant.run(1000)
    assert 0 < plant.speed <= 2 * math.pi / 0.1  # no pulse for 0.1 s: less than a turn in that time
    plant.run(5000)
    assert plant.speed == 0


@pytest.mark.parametrize(
    ("defect", "per_turn"), [({}, 1.0), ({"pulse_missing": 4.0}, 0.75), ({"pulse_doubled": 3.0}, 2.0)]
)
def test_missing_and_double_pulses(defect: dict[str, float], per_turn: float) -> None:
    plant = AmbPlant(floating(trip_speed=1e9, **defect))
    plant.set_state(at(omega=2 * math.pi * 100))
    rows = plant.run(10000)
    assert rows[-1, COLUMN["pulses"]] == pytest.approx(100 * per_turn, abs=1.5)


def test_no_pulse_from_a_shaft_that_trembles_at_the_mark() -> None:
    plant = AmbPlant(floating(pulse_angle=-0.6))
    plant.set_state(at(phi=0.0, omega=10.0))
    plant.run(1000)
    for sign in (-1, 1) * 5:
        s = plant.state()["s"]
        s[11] = sign * 10.0
        plant.set_state(s)
        rows = plant.run(700)
    assert rows[-1, COLUMN["pulses"]] == 1
    assert plant.speed == 0


def test_sensors_gain_offset_polarity_range_exchange_and_runout() -> None:
    s = at(y=2e-5, z=-3e-5, theta=1e-4, phi=0.3)
    base = AmbPlant(floating())
    base.set_state(s)
    planes = base.run(1, 1)[1][0, :4]
    np.testing.assert_allclose(planes, [2e-5 - 7.8e-6, -3e-5, 2e-5 + 1e-5, -3e-5], rtol=1e-12)
    amplitude = (0.0,) * 9 + (2e-6,) + (0.0,) * 6
    changed = AmbPlant(
        floating(
            exchange_planes=1.0, position_sign=(1.0, -1.0, 1.0, 1.0, 1.0), position_gain=(2.0, 1.0, 1.0, 1.0, 1.0),
            position_offset=(0.0, 0.0, 0.0, 1e-6, 0.0), position_range=5e-5, runout=amplitude, runout_phase=(0.2,) * 16,
        )
    )  # fmt: skip
    changed.set_state(s)
    read = changed.run(1, 1)[1][0, :4]
    np.testing.assert_allclose(read, [5e-5, 3e-5, 1.22e-5 + 2e-6 * math.cos(0.8), -2.9e-5], rtol=1e-9)
    flags = [int(plant.run(9)[0, COLUMN["flags"]]) for plant in (base, changed)]
    assert flags[1] & 32
    assert not flags[0] & 32
    noisy = AmbPlant(AmbParams(gravity_y=0.0, gravity_z=0.0, coupling=0.0), 3).run(4000, 1)[1]
    np.testing.assert_allclose(noisy[:, :5].std(axis=0), 3e-7, rtol=0.05)
    np.testing.assert_allclose(noisy[:, 5:15].std(axis=0), 2e-3, rtol=0.05)


def test_same_seed_same_readings_and_another_differs() -> None:
    a, b, c = (AmbPlant(seed=seed).run(200) for seed in (5, 5, 6))
    assert (a == b).all()
    assert (a[:, 0] != c[:, 0]).any()


def test_a_run_in_parts_is_the_same_run() -> None:
    whole, parts = (spun(levitated(1, control={"observer": 1.0, "compensate": 3.0}), 6000) for _ in range(2))
    rows = np.concatenate([parts.run(n) for n in (1, 7, 995, 3, 994)])
    assert (whole.run(2000) == rows).all()


def test_weights_add_to_the_unbalance_and_take_it_away() -> None:
    plant = spun(levitated(1, e=5e-6), 6000)
    before = synchronous(plant.run(3000, 1)[1], slice(0, 4))
    p = plant.params
    for b in (0, 1):
        plant.weights(b, p.unbalance[b], p.unbalance_phase[b] + math.pi)
    plant.run(5000)
    after = synchronous(plant.run(3000, 1)[1], slice(0, 4))
    assert np.abs(before).min() > 4e-6
    assert np.abs(after).max() < 5e-8
    plant.without_weights(0)
    plant.without_weights(1)
    plant.run(5000)
    np.testing.assert_allclose(synchronous(plant.run(3000, 1)[1], slice(0, 4)), before, atol=5e-8)


def test_a_loose_weight_slips_once_above_its_speed() -> None:
    plant = levitated(1, e=0.0, loose_speed=800.0, loose_shift=1.0)
    plant.weights(0, 3e-6, 0.2)
    speeds = (6000, 9000, 6000)
    vectors = [synchronous(spun(plant, rpm, 0.8).run(3000, 1)[1], [0])[0] for rpm in speeds]
    assert abs(vectors[2]) == pytest.approx(abs(vectors[0]), rel=0.02)
    assert np.angle(vectors[2] / vectors[0]) == pytest.approx(1.0, abs=0.02)


def test_trips() -> None:
    fast = spun(levitated(1), 15600)
    assert TRIPS[fast.trips] == "OVERSPEED"
    for rpm in (0.0, 10000.0):
        lost = spun(levitated(0), rpm)
        lost.set("kp", 0.0)
        lost.run(5000)
        assert TRIPS[lost.trips] == "LEVITATION_LOST"
        lost.clear_trips()
        assert lost.trips == 0


def test_trace_and_rows_say_the_same() -> None:
    plant = spun(levitated(2), 6000)
    plant.run(3)
    rows, trace = plant.run(1000, 1)
    assert rows.shape[1] == len(CHANNELS)
    assert trace.shape == (1000, len(TRACE))
    part = trace[7 : 7 + 990].reshape(99, 10, -1)
    np.testing.assert_allclose(part[:, :, :5].mean(axis=1), rows[1:, :5], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(part[:, :, 5:15].mean(axis=1), rows[1:, 7:17], rtol=1e-9)
    np.testing.assert_allclose(np.abs(part[:, :, 15:19]).max(axis=(1, 2)), rows[1:, COLUMN["u_i"]])
    np.testing.assert_allclose(part[:, -1, 28:32], rows[1:, [5, 6, 20, 21]])
    assert plant.run(95, 10)[1].shape[0] in (9, 10)


def test_unbalance_of_the_two_planes() -> None:
    assert sum(unbalance(10e-6)) == pytest.approx(0.98 * 10e-6)
