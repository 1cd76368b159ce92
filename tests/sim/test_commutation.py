"""Segment currents as complex numbers in the stator's frame: the lag of commutation, its compensation, forces by hand."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from sim_plants import quiet

from sim_backend.core import LEVITATE, DriveLaw
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import Plant, derivative

M, TICK_S, SPEED = 8.0, 1e-4, 63.0
LAG_S = 1.5 * TICK_S + 1 / (2 * math.pi * 2000)
"""A sample is one tick old when its currents are asked for, a half more on the mean while they are held; and the amplifier."""


def boundary(speed: float) -> complex:
    """Segment current in the rotor's frame at a tick, over its reference, in steady rotation: S_ref of the tick before is held
    while S goes the share 1 - k of the way, S_(n+1) = S_ref,(n-1) (1 - k) + k S_n, and both turn by M w T a tick."""
    turn, k = cmath.exp(1j * M * speed * TICK_S), math.exp(-2 * math.pi * 2000 * TICK_S)
    return (1 - k) / turn / (turn - k)


def mean(speed: float) -> complex:
    """The same on the mean over a tick, by the integral of the current between two ticks in the turning frame."""
    rate, t = 2 * math.pi * 2000, np.linspace(0, TICK_S, 2001)
    held = cmath.exp(-1j * M * speed * TICK_S)
    s = (held + (boundary(speed) - held) * np.exp(-rate * t)) * np.exp(-1j * M * speed * t)
    return complex(np.trapezoid(s, t) / TICK_S)


def turning(speed: float, **control: float) -> Plant:
    """A quiet machine that a drive turns, with 1 A open loop upwards in segments 1 and 3 after 1 s."""
    released = ControlParams(i_y=1.0, i_ramp=5.0, kp_theta=0.0, kd_theta=0.0, ki_theta=0.0, **control)
    plant = Plant(quiet(encoder_counts=0.0), control=released)
    state = np.zeros(14)
    state[11] = speed
    plant.set_state(state)
    plant.mode = LEVITATE
    plant.drive(DriveLaw(1e3, 1e3, 1e6), speed)
    plant.run(10000)
    return plant


def in_the_rotor(plant: Plant) -> complex:
    """Current of segment 1 as the rotor sees it."""
    state = plant.state()
    return complex(state["segment"][0] * cmath.exp(-1j * M * state["s"][5]))


def test_the_lag_is_m_w_times_one_and_a_half_ticks_and_the_amplifier() -> None:
    """0.116 rad at 63 rad/s (by hand: 8 * 63 * (150 us + 79.6 us))."""
    assert pytest.approx(0.1157, abs=1e-4) == M * SPEED * LAG_S
    assert -cmath.phase(mean(SPEED)) == pytest.approx(M * SPEED * LAG_S, rel=1e-3)
    plant = turning(SPEED)
    assert in_the_rotor(plant) == pytest.approx(boundary(plant.shaft_speed), rel=1e-5)


def test_without_rotation_there_is_no_lag() -> None:
    assert in_the_rotor(turning(0.0)) == pytest.approx(1.0, abs=1e-7)


def test_compensation_takes_the_lag_away() -> None:
    plant = turning(SPEED, lag_compensation=1.0)
    ahead = cmath.exp(1j * M * SPEED * LAG_S)
    assert in_the_rotor(plant) == pytest.approx(ahead * boundary(SPEED), rel=1e-4)
    assert abs(cmath.phase(ahead * mean(SPEED))) < 2e-4


@pytest.mark.parametrize("speed", [-40.0, 63.0])
def test_sensors_tell_what_turns_the_rotor(speed: float) -> None:
    """The part along the field at the angle of now: cos of the lag, whichever way it turns."""
    rows = turning(speed).run(1000)
    assert rows[:, 17].mean() == pytest.approx(boundary(speed).real, rel=1e-4)


def test_forces_of_currents_of_any_phase() -> None:
    """q 1, 2, 3, -4 and d 0.5, -1, 2, 1 A, by hand: F_x = a_d (q4 - q2)/2 - a_c (d1 - d3)/2 + (a_6/4)(|s1|^2 - |s3|^2), F_y =
    a_d (q1 - q3)/2 + a_c (d4 - d2)/2 + (a_6/4)(|s2|^2 - |s4|^2), torque a_tau times the mean of q; at every angle alike."""
    clean = {
        "alpha_d": 12.0,
        "alpha_c": 14.0,
        "alpha_6": 0.04,
        "alpha_x": 0.0,
        "alpha_4": 0.0,
        "beta_2": 0.0,
        "detent": 0.0,
    }
    p = quiet(gravity=0.0, **clean)
    currents = np.array([1 + 0.5j, 2 - 1j, 3 + 2j, -4 + 1j])
    for angle in (0.0, 0.3, 2.0):
        s = np.zeros(14)
        s[5] = angle
        with_current, without = (derivative(p, s, np.zeros(10), i) for i in (currents, np.zeros(4)))
        force = p.mass * (with_current - without)[6:8]
        expected = [12 * -3 - 14 * -0.75 + 0.01 * (1.25 - 13), 12 * -1 + 14 * 1 + 0.01 * (5 - 17)]
        np.testing.assert_allclose(force, expected, rtol=1e-9)
        assert p.polar_inertia * (with_current - without)[11] == pytest.approx(p.alpha_tau * 0.5, rel=1e-9)


@pytest.mark.parametrize("pole_pairs", [1.0, 5.0, 8.0, 12.0])
def test_any_number_of_pole_pairs(pole_pairs: float) -> None:
    """The frame turns by M theta, by squaring: a current along the field is along it at every angle."""
    p = PlantParams(pole_pairs=pole_pairs, detent=0.0, beta_4=0.0)
    s = np.zeros(14)
    s[5] = 1.234
    torques = [derivative(p, s, np.zeros(10), i)[11] for i in (np.ones(4), np.zeros(4))]
    assert p.polar_inertia * (torques[0] - torques[1]) == pytest.approx(p.alpha_tau, rel=1e-12)
