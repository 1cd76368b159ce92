"""Run-downs of two turns with a torque that goes round with the rotor: no different from friction, but for where they begin."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.rigfile import load_rig
from procedures.servomotor.conventions import conventions
from procedures.spindown import estimates, fit, waves
from procedures.spindown.requires import coils
from procedures.spindown.steps import SHORT_LAGS, SMALLEST_SAMPLES, RunDown

J, B, C, COUNT = 0.033, 8.0, 1.2, 2 * math.pi / 4096  # rad/s^2 of friction, 40 mN m
WAVE = 0.12  # rad/s^2: 4 mN m


def made(direction: int, place: float, wave: float = WAVE) -> RunDown:
    """From 45 rad/s at a place of the turn, as an encoder shows it."""
    t = np.arange(0, 0.34, 1e-3)

    def rates(_: float, y: Sequence[float]) -> list[float]:
        return [y[1], -B * y[1] - C + direction * wave * math.cos(place + direction * y[0])]

    turned = solve_ivp(rates, (0, t[-1]), [0.0, 45.0], t_eval=t, rtol=1e-10, atol=1e-12).y[0]
    told = direction * np.floor((place + direction * turned) / COUNT + 0.5) * COUNT
    angle = told - told[0]
    coast = fit.of_angle(t, angle, SHORT_LAGS, SMALLEST_SAMPLES)
    names = coils(conventions(load_rig("tsbs12")))
    return RunDown(3.0, direction, 0, False, t, np.gradient(angle, t), angle, None, coast, dict.fromkeys(names, 3.0),
                   np.zeros(4), 0, 340, 0, direction * told)  # fmt: skip


def runs(places: Sequence[float], wave: float = WAVE) -> list[RunDown]:
    return [made(d, place, wave) for place in places for d in (1, -1)]


def friction(found: Sequence[RunDown]) -> tuple[float, float]:
    """Of both directions, rad/s^2, with its standard uncertainty."""
    r = estimates.rates(found, lambda run: run.of_angle)
    return float(r.values[1]), math.sqrt(float(r.covariance[1, 1]))


def test_half_a_turn_later_it_acts_the_other_way() -> None:
    one, other = (friction(runs([place, place]))[0] - C for place in (1.3, 1.3 + math.pi))
    assert abs(one) > 0.05
    assert other == pytest.approx(-one, abs=0.02)


def test_places_spread_over_a_turn_free_the_friction_of_it() -> None:
    for places in ((0.3, 0.3 + math.pi), tuple(2.0 + 2 * math.pi * k / 3 for k in range(3))):
        c, u = friction(waves.freed(runs(places)))
        assert abs(c - C) < min(3 * u, 0.03), places
        assert u < 0.04


def test_without_a_wave_nothing_is_lost() -> None:
    c, u = friction(waves.freed(runs((1.0, 1.0 + math.pi), wave=0.0)))
    assert abs(c - C) < 3 * u < 0.09


def test_where_all_begin_alike_nothing_is_taken_off_and_it_is_said() -> None:
    """Nothing tells the wave from friction then."""
    alike, apart = runs((0.3, 0.3)), runs((0.3, 0.3 + math.pi))
    assert [(f.code, f.concerns) for f in waves.of_places(alike)] == [("places-alike", ("T_c",))]
    assert (list(waves.of_places(apart)), waves.spread(alike), waves.spread(apart)) == ([], False, True)
    assert waves.spread(runs((0.1, 2.0, 4.4)))


def test_what_a_push_does_by_hand() -> None:
    """A constant push from rest without drag: t^2/2; with drag b it ends at push/b of speed."""
    t = np.arange(0, 2.0, 1e-3)
    assert waves.driven(t, np.ones(len(t)), 0.0)[-1] == pytest.approx(t[-1] ** 2 / 2, rel=1e-6)
    moved = waves.driven(t, np.ones(len(t)), 8.0)
    assert (moved[-1] - moved[-11]) / 0.01 == pytest.approx(1 / 8, rel=1e-4)
