"""What a root of a square that noise adds to says by stretches of a record: no bias by it, and intervals that hold."""

from __future__ import annotations

import numpy as np
import pytest

from bench.uncertainty import coverage_factor
from procedures.derivative.fit import Places
from procedures.one_axis.bank import bank

STRETCHES, DRAWS = 8, 1500


@pytest.mark.parametrize(("hz", "noise", "adds"), [(7.3, 0.055, 0.1), (31.7, 0.008, 1.0), (113.0, 0.01, -0.1)])
def test_noise_in_the_places_neither_shifts_sidebands_nor_leaves_their_interval(
    hz: float, noise: float, adds: float
) -> None:
    """As much noise a place and stretch as records of the rig have, two thirds of the sidebands themselves at 31.7 Hz, alike in
    two neighbouring places (as estimates that share their positions are): that square would add more than u to them there."""
    h = bank(7, 120, "euler", 1e-4).responses(np.array([hz]))[:, 0]
    true, factor, random = (
        float(np.sqrt((np.abs(h - h.mean()) ** 2).mean())),
        coverage_factor(STRETCHES - 1),
        np.random.default_rng(4),
    )
    errors, us, raw = [], [], []
    for _ in range(DRAWS):
        e = random.normal(0.0, noise / np.sqrt(2), (2, STRETCHES, 60)) @ np.kron(np.eye(60), np.ones(2))
        found = Places(h + e[0] + 1j * e[1], 1e-4)
        value, u = found.sideband
        errors.append(value - true)
        us.append(u)
        mean = found.h.mean(axis=0)
        raw.append(float(np.sqrt((np.abs(mean - mean.mean()) ** 2).mean())) - true)
    inside = float(np.mean(np.abs(errors) <= factor * np.array(us)))
    assert 0.935 < inside < 0.975
    assert abs(np.mean(errors)) < 0.1 * np.mean(us)
    assert np.mean(raw) > adds * np.mean(us)
