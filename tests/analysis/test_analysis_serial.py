"""Scatter of means of batches that follow each other, against series whose covariance is known."""

from __future__ import annotations

import numpy as np
import pytest

from bench.analysis.serial import inflation, variances

BLOCKS = 4000


def moved(m: int, alike: float, seed: int = 0) -> tuple[np.ndarray, float]:
    """Moves (b, m, 1) of batches each `alike` to the one before, mean and trend taken out as `synchronous` does, and the true
    variance of their sum."""
    rng = np.random.default_rng([seed, m])
    new = rng.standard_normal((BLOCKS, m, 2)).view(np.complex128)[..., 0]
    x = new.copy()
    for j in range(1, m):
        x[:, j] = alike * x[:, j - 1] + np.sqrt(1 - alike**2) * new[:, j]
    ramp = np.linspace(-1, 1, m)
    off = x - x.mean(axis=1, keepdims=True)
    off -= ramp * ((off @ ramp) / (ramp @ ramp))[:, None]
    covariances = alike ** np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
    return (off * np.sqrt(m / (m - 2)))[..., None], 2 * float(covariances.sum())


@pytest.mark.parametrize("m", [4, 6, 9, 16])
def test_of_independent_batches_both_are_the_variance(m: int) -> None:
    moves, true = moved(m, 0.0)
    alone, whole = variances(moves)
    scatter = whole.std() / np.sqrt(BLOCKS)
    assert alone.mean() == pytest.approx(true, rel=0.05)
    assert abs(whole.mean() - true) < 4 * scatter
    four = (v.reshape(-1, 4) for v in (alone, whole))
    assert inflation(*four).mean() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("m", "least"), [(9, 0.75), (16, 0.85)])
def test_what_rings_on_is_seen(m: int, least: float) -> None:
    """Each batch 0.4 like the one before: of its own scatter alone a block's mean would have 0.4 of its variance."""
    moves, true = moved(m, 0.4)
    alone, whole = variances(moves)
    assert alone.mean() < 0.5 * true
    assert least * true < whole.mean() < 1.05 * true


def test_channels_count_together_and_chance_has_a_floor() -> None:
    alone = np.ones((30, 2))
    assert inflation(alone, np.full((30, 2), -3.0)) == pytest.approx(np.full(30, 0.5))
    whole = np.column_stack([np.full(30, 1.0), np.full(30, 3.0)])
    assert inflation(alone, whole) == pytest.approx(np.full(30, 2.0))
    assert inflation(alone[:4], whole[:4]).shape == (4,)
