"""Force-to-current inversions, current loop, notch, observer gains: each against an independent form, and the errata."""

from __future__ import annotations

import math

import numpy as np
import pytest
from amb_plants import RPM, levitated, quiet
from scipy.integrate import solve_ivp

from sim_backend.machines.amb5dof import reference_law
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import cac, ccs, follow, observer_gains
from sim_backend.machines.amb5dof.reference import amb_force
from sim_backend.machines.amb5dof.reference_loop import Law, simulate
from sim_backend.machines.amb5dof.reference_observer import place, poles, transition

BETA, GAP, BIAS, ETA = 6.95e-7, 5.25e-4, 1.0, 0.1


@pytest.mark.parametrize("xi", [-3e-4, -1.15e-4, -1e-6, 1e-6, 1.15e-4, 3e-4])
def test_constant_current_sum_gives_the_force(xi: float) -> None:
    low, high = -4 * BETA * BIAS**2 / (GAP + xi) ** 2, 4 * BETA * BIAS**2 / (GAP - xi) ** 2
    for force in np.linspace(0.99 * low, 0.99 * high, 9):
        di = ccs(force, BETA, GAP, xi, BIAS)
        assert amb_force(BETA, GAP, xi, BIAS + di, BIAS - di) == pytest.approx(force, rel=1e-11, abs=1e-11)
        assert di == pytest.approx(reference_law.ccs(force, BETA, GAP, xi, BIAS), abs=1e-9)
    assert (ccs(2 * low, BETA, GAP, xi, BIAS), ccs(2 * high, BETA, GAP, xi, BIAS)) == (-BIAS, BIAS)


def test_the_printed_inversion_loses_digits_near_the_centre_and_this_one_does_not() -> None:
    force, xi, exact = 3.0, 1e-19, 3.0 * GAP**2 / (4 * BETA * BIAS)
    root = math.sqrt(force * xi * GAP / BETA + BIAS**2)
    literal = (-BETA * (xi**2 + GAP**2) * BIAS - BETA * (xi**2 - GAP**2) * root) / (2 * xi * BETA * GAP)
    assert abs(literal / exact - 1) > 1e-3
    assert ccs(force, BETA, GAP, xi, BIAS) == pytest.approx(exact, rel=1e-9)
    assert ccs(force, BETA, GAP, 0.0, BIAS) == pytest.approx(exact, rel=1e-14)


def test_the_printed_bound_of_the_force_is_outside_what_can_be_inverted() -> None:
    xi = 2e-4
    printed = -4 * BETA * BIAS**2 / (GAP - xi) ** 2
    assert printed * xi * GAP / BETA + BIAS**2 < 0
    inside = -4 * BETA * BIAS**2 / (GAP + xi) ** 2
    assert inside * xi * GAP / BETA + BIAS**2 == pytest.approx(((GAP - xi) / (GAP + xi)) ** 2)
    assert ccs(printed, BETA, GAP, xi, BIAS) == -BIAS


@pytest.mark.parametrize("force", [-20.0, -0.1001, -0.0999, -0.05, 0.0, 0.05, 0.0999, 0.1001, 20.0])
def test_almost_complementary_currents_give_the_force(force: float) -> None:
    for xi in (-1e-4, 0.0, 1.15e-4):
        pair = cac(force, BETA, GAP, xi, ETA)
        assert amb_force(BETA, GAP, xi, *pair) == pytest.approx(force, rel=1e-12, abs=1e-12)
        assert pair == pytest.approx(reference_law.cac(force, BETA, GAP, xi, ETA), abs=1e-7)
        if abs(force) > ETA:
            assert min(pair) == 0


def test_almost_complementary_function_is_smooth_where_its_pieces_meet() -> None:
    """The contact conditions under T (2.23): value, slope and curvature at +eta."""
    root, h = (GAP - 0.0) / math.sqrt(BETA), 1e-4
    y = [cac(ETA + k * h, BETA, GAP, 0.0, ETA)[0] / root for k in (-2, -1, 0, 1, 2)]
    assert y[2] == pytest.approx(math.sqrt(ETA))
    assert (y[3] - y[1]) / (2 * h) == pytest.approx(1 / (2 * math.sqrt(ETA)), rel=1e-4)
    assert (y[1] - 2 * y[2] + y[3]) / h**2 == pytest.approx(-1 / (4 * ETA**1.5), rel=2e-2)


@pytest.mark.parametrize(("current", "reference"), [(0.2, 1.5), (2.5, 0.0), (1.0, 1.01), (0.0, 3.0), (2.9, 2.7)])
@pytest.mark.parametrize("time", [5e-5, 1e-3, 5e-3])
def test_current_under_a_voltage_limit(current: float, reference: float, time: float) -> None:
    p = AmbParams(u_max=12.0)
    lw = p.inductance * p.amplifier_rate

    def rate(_: float, i: list[float]) -> list[float]:
        u = np.clip(lw * (reference - i[0]) + p.resistance * i[0], -p.u_max, p.u_max)
        return [(u - p.resistance * i[0]) / p.inductance]

    found = solve_ivp(rate, (0, time), [current], "RK45", rtol=1e-9, atol=1e-12, max_step=2e-6).y[0, -1]
    assert follow(p, current, reference, time) == pytest.approx(found, abs=3e-7)
    assert follow(p, follow(p, current, reference, time / 3), reference, 2 * time / 3) == pytest.approx(found, abs=3e-7)


@pytest.mark.parametrize("rpm", [0, 2000, 6000, 14000])
def test_observer_poles_are_where_they_are_put(rpm: float) -> None:
    c, omega = AmbControl(), rpm * RPM
    n = 5 if rpm else 3
    gain = observer_gains(c, omega)
    np.testing.assert_allclose(gain[:n], place(c, omega)[:n], rtol=1e-4)
    step = transition(omega)
    error = (np.eye(5) - np.outer(gain, [1, 0, 0, 1, 0])) @ step
    found = np.linalg.eigvals(error[:n, :n])
    for pole in poles(c, omega)[:n]:
        assert np.abs(found - pole).min() < 1e-6


class Exchanged(Law):
    """The PID's wiring as T 2.4.3 prints it: y from V, z from W."""

    def __call__(self, position: object, omega: float) -> np.ndarray:
        w13, v13, w24, v24, x = position  # type: ignore[misc]
        return super().__call__([v13, w13, v24, w24, x], omega)


def test_the_printed_wiring_of_the_pid_loses_the_shaft(monkeypatch: pytest.MonkeyPatch) -> None:
    start = [0.0, 1e-6, -1e-6, *(0.0,) * 17]
    held = simulate(quiet(), AmbControl(law=0), start, 300).s
    monkeypatch.setattr("sim_backend.machines.amb5dof.reference_loop.Law", Exchanged)
    lost = simulate(quiet(), AmbControl(law=0), start, 300).s
    assert np.hypot(*held[150:, 1:3].T).max() < 3e-5
    assert np.hypot(*lost[150:, 1:3].T).min() > 9e-5


def test_a_notch_is_needed_where_the_shaft_bends() -> None:
    """PID at rest on a bending shaft: the 1240 Hz mode swings up without its notch (T 2.6.1)."""
    notches = {"notch1_hz": 650.0, "notch1_q": 2.0, "notch2_hz": 1240.0, "notch2_q": 2.0}
    spread = []
    for control in ({}, notches):
        plant = levitated(0, control=control, mode_on=(1.0, 1.0))
        plant.run(5000)
        spread.append(plant.run(2000, 1)[1][:, :4].std(axis=0).max())
    assert spread[0] > 5e-6
    assert spread[1] < 8e-7
