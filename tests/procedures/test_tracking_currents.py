"""Which of several coils carries most."""

from __future__ import annotations

import math

import numpy as np
import pytest

from procedures.tracking.currents import likely


def test_one_beyond_doubt_is_the_one() -> None:
    assert likely([1.0, 0.9, 0.5], [0.003] * 3) == [1.0, 0.0, 0.0]


def test_coils_that_read_alike_are_equally_likely() -> None:
    assert likely([0.0] * 4, [0.003] * 4) == pytest.approx([0.25] * 4)


def test_of_two_it_is_the_probability_that_their_difference_is_above_zero() -> None:
    gap, u = 0.004, (0.003, 0.002)
    above = (1 + math.erf(gap / math.hypot(*u) / math.sqrt(2))) / 2
    assert likely([0.5 + gap, 0.5], u) == pytest.approx([above, 1 - above], abs=1e-6)


def test_of_three_it_is_what_draws_say() -> None:
    values, us = np.array([1.0, 0.998, 0.997]), np.array([0.003, 0.004, 0.002])
    drawn = np.random.default_rng(1).normal(values, us, (400_000, 3)).argmax(axis=1)
    assert likely(values.tolist(), us.tolist()) == pytest.approx(np.bincount(drawn) / drawn.size, abs=4e-3)
