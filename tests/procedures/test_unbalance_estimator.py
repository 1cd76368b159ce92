"""The runout by forces and D_max: on made slow rolls, currents and orbits whose right answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.procedure import Measured
from bench.record.records import measurement
from bench.uncertainty import Estimate, Influence, interval
from procedures.synchronous import d_max as unbalance_d_max
from procedures.synchronous import runout
from procedures.synchronous.unexplained import UNEXPLAINED
from procedures.unbalance import procedure as unbalance


def test_runout_by_forces_is_exact_on_its_own_model() -> None:
    """A made-up slow roll: shaft and currents that balance, and a runout on top of it."""
    stand = runout.Stand(
        np.full(4, 6.95e-7), np.full(4, 1.15e-4), np.ones(4), np.zeros(4), np.ones(8), np.zeros(8), np.full(4, 5.25e-4), 1200.0,
        0.98, 5.84e-3, 1.71e-4, 0.097, 0.081, 0.078, 0.1, 0.097, 0.081, 0.155,
        runout.arms(0.097, 0.081), runout.arms(0.078, 0.1),
    )  # fmt: skip
    means = np.array([0, 0, 0, 0, 1.2, 0.8, 1.2, 0.8, 1.1, 0.9, 1.1, 0.9])
    true, u = np.array([2e-6, -2e-6j, 1e-6j, 1e-6]), np.array([3e-6, 2e-6 * np.exp(1j)])
    made = []
    for speed in (31.4, 1000.0):
        i = np.array([0.01, 0.02j, -0.01, 0.005 + 0.001j])
        vectors = np.concatenate([np.zeros(4), np.stack([i, -i], axis=1).ravel()])
        turning = runout.Turning(speed, means, vectors)
        at = runout.shaft_motion(stand, turning, 1.0, u) + true
        made.append(runout.Turning(speed, means, np.concatenate([at, vectors[4:]])))
    found = runout.find_runout(stand, {1.0: made[0]}, made[1])
    assert np.abs(found.runout[1.0] - true).max() < 1e-11
    assert np.abs(found.shaft[1.0] - made[0].vectors[:4] + true).max() < 1e-11
    assert np.abs(found.unbalance - u).max() < 1e-10
    assert found.misfit < 1e-6
    swapped = made[1].vectors.copy()
    swapped[:4] = swapped[[2, 3, 0, 1]]
    assert runout.unbalances(stand, runout.Turning(1000.0, means, swapped), found.runout[1.0])[1] > UNEXPLAINED


def test_orders_mix_in_forces_that_are_not_linear() -> None:
    """Orders 1 and 2 of one coil's current: i^2 makes 2 i1* i2 of them at order 1, beside its slope."""
    stand = runout.Stand(
        np.full(4, 6.95e-7), np.zeros(4), np.ones(4), np.zeros(4), np.ones(8), np.zeros(8), np.full(4, 5.25e-4), 1200.0,
        0.98, 5.84e-3, 1.71e-4, 0.097, 0.081, 0.078, 0.1, 0.097, 0.081, 0.155,
        runout.arms(0.097, 0.081), runout.arms(0.078, 0.1),
    )  # fmt: skip
    means, first, second = np.zeros(12), np.zeros(12, complex), np.zeros(12, complex)
    means[4], first[4], second[4] = 1.5, 0.05, 0.02j
    slow = {1.0: runout.Turning(31.4, means, first), 2.0: runout.Turning(31.4, means, second)}
    found = runout.forces_beyond_slopes(stand, slow, {n: np.zeros(4, complex) for n in slow})
    scale = 6.95e-7 / 5.25e-4**2
    assert found[1.0][0] == pytest.approx(scale * 0.05 * 0.02j)
    assert found[2.0][0] == pytest.approx(scale * 0.05**2 / 2)
    assert np.abs(found[1.0][1:]).max() < 1e-15


def test_d_max_is_greater_wherever_the_centre_may_be() -> None:
    """A circle of 5 um about a place known to 5 um (rectangular): the value is the mean over it, inside the interval."""
    means = [Estimate.of(0.0, Influence(a, a, 5e-6 / math.sqrt(3), "m", "B", "rectangular")) for a in "yz"]
    orbit = [Estimate.exact(x, "m") for x in (5e-6, 0.0, 0.0, -5e-6)]
    e = unbalance_d_max.farthest(means, {1.0: orbit}, "a place")
    generator = np.random.default_rng(2)
    true = 5e-6 + np.hypot(*generator.uniform(-5e-6, 5e-6, (2, 20000)))
    assert e.value == pytest.approx(true.mean(), rel=5e-3)
    found = interval(e)
    assert found.low == pytest.approx(np.quantile(true, 0.025), rel=0.02)
    assert found.high == pytest.approx(np.quantile(true, 0.975), rel=0.02)


def test_both_zeros_of_a_plane_carry_d_max_alike() -> None:
    """About the centre of a circle neither axis has a slope and both have the same share; each alone would make more."""
    means = [Estimate.of(0.0, Influence(a, a, 5e-6 / math.sqrt(3), "m", "B", "rectangular")) for a in "yz"]
    orbit = [Estimate.exact(x, "m") for x in (5e-6, 0.0, 0.0, -5e-6)]
    e = unbalance_d_max.farthest(means, {1.0: orbit}, "a place")
    off = np.random.default_rng(3).uniform(-5e-6, 5e-6, (2, 400, 400))
    off[0], off[1] = off[0, :, :1], off[1, :1, :]  # every z with every y
    true = np.hypot(*off)
    shares = [true.mean(axis=k).var() / true.var() for k in (1, 0)]
    stated = measurement(Measured(unbalance.D_MAX, e), None)
    found = {b.influence: (b.contribution / (stated.standard_uncertainty or 0)) ** 2 for b in stated.budget}
    assert [found["y"], found["z"]] == pytest.approx(shares, abs=0.02)


def test_d_max_between_the_grid_s_places_is_that_of_the_orbit() -> None:
    """An ellipse of 10 by 4 um about places within 5 um, against the distance itself."""
    generator = np.random.default_rng(1)
    placed = [generator.uniform(-5e-6, 5e-6, 400) for _ in range(2)]
    orbit = [np.array([x]) for x in (10e-6, 0.0, 0.0, -4e-6)]
    found = unbalance_d_max._interpolated(placed, orbit, [1.0])
    turn = np.linspace(0, 2 * math.pi, 2000)
    true = np.hypot(placed[0][:, None] + 10e-6 * np.cos(turn), placed[1][:, None] + 4e-6 * np.sin(turn)).max(axis=1)
    assert np.abs(found - true).max() < 0.03e-6
