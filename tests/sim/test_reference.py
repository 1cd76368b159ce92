"""The C core against the Python reference, the reference against scipy, and the order of the integrator."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import quiet

from sim_backend import reference
from sim_backend.core import LEVITATE, Plant, derivative
from sim_backend.core.params import ControlParams, PlantParams
from sim_backend.reference_loop import Hanging, Interval, Trace, dop853, runge_kutta, simulate

Array = npt.NDArray[np.float64]
TICKS = 1200
START = (3e-6, 0.0, 4e-6, 0.0, 1e-5, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 38.0, 0.0, 0.0)
HANGINGS = (Hanging(300, 3.25, 31.9, 0.03), Hanging(900, 1.25, 12.2, 0.01))
CONTROL = ControlParams(speed_ref=40.0, i_x=-0.2, i_y=0.3, gamma=0.02, ref_yi=5e-6, ref_z=-3e-6)


def blemished() -> PlantParams:
    """A quiet machine with every error that the loop can have."""
    rng = np.random.default_rng(4)
    return quiet(
        current_gain=tuple(1 + 0.003 * rng.uniform(-1, 1, 10)),
        current_offset=tuple(0.004 * rng.uniform(-1, 1, 10)),
        current_drift=tuple(0.01 * rng.uniform(-1, 1, 10)),
        position_gain=tuple(1 + 0.01 * rng.uniform(-1, 1, 5)),
        position_offset=tuple(1e-5 * rng.uniform(-1, 1, 5)),
        segment_gain=(1.01, 0.99, 1.0, 1.02),
        gamma_zero=0.005,
    )


def run_core(p: PlantParams, c: ControlParams, ticks: int) -> Trace:
    """What `simulate` does, by the core, tick by tick."""
    plant = Plant(p, control=c)
    plant.set_state(np.array(START))
    plant.mode = LEVITATE
    states, currents = [np.array(START)], [np.zeros(14)]
    for tick in range(ticks):
        for h in HANGINGS:
            if h.tick == tick:
                plant.load(h.mass_kg, h.weight_N, h.ramp_s)
        plant.run(1)
        now = plant.state()
        states.append(now["s"])
        currents.append(np.concatenate([now["coil"], now["segment"]]))
    assert plant.trips == 0
    return Trace(np.array(states), np.array(currents))


def error(a: Array, b: Array) -> float:
    """Largest over the columns of max |a - b| / max |b|."""
    return float((np.abs(a - b).max(axis=0) / np.abs(b).max(axis=0)).max())


@pytest.mark.parametrize("spread", [1.0, 12.0], ids=["free", "in contact"])
def test_right_hand_side_equals_the_core(spread: float) -> None:
    rng = np.random.default_rng(2)
    scale = np.array([3e-5, 3e-5, 3e-5, 2e-4, 2e-4, 3, 0.02, 0.02, 0.02, 0.3, 0.3, 30, 1e-4, 0.01])
    p, touched = blemished(), 0
    for _ in range(200):
        s = scale * rng.normal(size=14) * np.where(np.arange(14) < 5, spread, 1)
        coil, segment, play = rng.uniform(0, 8, 10), rng.uniform(-5, 5, 4), rng.uniform(-1e-3, 1e-3, 4)
        found = derivative(p, s, coil, segment, play=play, gamma=0.03, hung_mass=2.0, weight=19.0)
        expected = reference.derivative(p, s, reference.Loads(coil, segment, play, 0.03, 2.0, 19.0))
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9)
        ends = [(s[0] + z * s[4], s[1] - z * s[3]) for z in p.z_sensor]
        touched += any(np.hypot(*end) > p.clearance for end in ends)
    assert touched > 150 if spread > 1 else touched < 20


def test_core_equals_the_reference_in_closed_loop() -> None:
    """0.12 s: start-up, rotation at 40 rad/s, motor currents, weights handed over and taken off."""
    p = blemished()
    core, python = run_core(p, CONTROL, TICKS), simulate(p, CONTROL, START, TICKS, hangings=HANGINGS)
    assert np.abs(core.s[:, 1]).max() > 1e-5  # something happened
    assert error(core.s, python.s) < 1e-6
    assert error(core.currents, python.currents) < 1e-6


@pytest.mark.parametrize("change", [{"hysteresis": 0.0}, {"alpha_d": 12.2}, {"polar_inertia": 0.0331}])
def test_the_comparison_sees_a_small_difference(change: dict[str, float]) -> None:
    p = blemished()
    core = run_core(p, CONTROL, 400)
    other = simulate(dataclasses.replace(p, **change), CONTROL, START, 400, hangings=HANGINGS)
    assert error(core.s, other.s) > 1e-6


def solution(p: PlantParams, substeps: int, ticks: int) -> Array:
    """States of the reference with `substeps` Runge-Kutta steps per tick."""

    def advance(interval: Interval, s: Sequence[float]) -> list[float]:
        return runge_kutta(interval, s, substeps)

    return simulate(p, CONTROL, START, ticks, hangings=HANGINGS, advance=advance).s


def test_reference_against_dop853_and_order_of_convergence() -> None:
    """Four steps per tick are within 1e-6 of DOP853 in every signal, two in every position; halving gains 2^4.

    The fastest process is the 1 kHz amplifier: at one step per tick the error is 2e-5 in position.
    """
    p, ticks = blemished(), 600
    exact = simulate(p, CONTROL, START, ticks, hangings=HANGINGS, advance=dop853).s
    solutions = {n: solution(p, n, ticks) for n in (1, 2, 4)}
    assert error(solutions[4], exact) < 1e-6
    assert error(solutions[2][:, :6], exact[:, :6]) < 2e-6
    for n in (1, 2):
        ratio = error(solutions[n], exact) / error(solutions[2 * n], exact)
        assert np.log2(ratio) == pytest.approx(4, abs=0.25)


def test_core_converges_with_its_substeps_to_the_reference() -> None:
    """Eight steps per tick in the core against four in the reference: the steps taken are really smaller."""
    p = blemished()
    plant = Plant(p, control=CONTROL, substeps=8)
    plant.set_state(np.array(START))
    plant.mode = LEVITATE
    plant.run(200)
    coarse, fine = solution(p, 2, 200)[-1], solution(p, 8, 200)[-1]
    found = plant.state()["s"]
    np.testing.assert_allclose(found[:12], fine[:12], rtol=1e-9, atol=1e-15)
    assert np.abs(found - coarse)[:3].max() > 1e-13
