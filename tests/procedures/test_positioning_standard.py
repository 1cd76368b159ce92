"""Figures of ISO 230-2 and targets: against a published test, by hand, and what must not change them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from procedures.positioning import standard
from procedures.positioning.standard import DOWN, FIGURES, UP, by_target, figures
from procedures.positioning.targets import cycle, fewest, on_counts, targets

# Of a linear axis, by ecmc's motion test (paulscherrerinstitute/ecmccfg, examples/test/fat_sat/report.md), deviations in nm.
UPWARDS = [
    [-81.02, -102.02, -87.02, -92.02, -100.02], [-87.02, -97.02, -97.02, -95.02, -82.02],
    [-72.02, -90.02, -88.02, -87.02, -87.02],
    [-102.02, -86.02, -86.02, -93.02, -78.02], [-100.02, -112.02, -129.02, -109.02, -97.02],
]  # fmt: skip
DOWNWARDS = [
    [-99.02, -94.02, -82.02, -91.02, -94.02], [-103.02, -104.02, -95.02, -111.02, -93.02],
    [-86.02, -102.02, -91.02, -76.02, -99.02],
    [-72.02, -92.02, -95.02, -103.02, -81.02], [-104.02, -126.02, -130.02, -141.02, -107.02],
]  # fmt: skip
PUBLISHED = np.array([UPWARDS, DOWNWARDS])


def named(x: np.ndarray) -> dict[str, float]:
    return dict(zip(FIGURES, figures(x).tolist(), strict=True))


def test_figures_of_each_target_are_those_of_a_published_report() -> None:
    t = by_target(PUBLISHED)
    assert t.mean[UP] == pytest.approx([-92.42, -91.62, -84.82, -89.02, -109.42], abs=0.01)
    assert t.mean[DOWN] == pytest.approx([-92.02, -101.22, -90.82, -88.62, -121.62], abs=0.01)
    assert t.s[UP] == pytest.approx([8.79, 6.77, 7.26, 9.0, 12.58], abs=0.01)
    assert t.s[DOWN] == pytest.approx([6.28, 7.29, 10.43, 12.18, 15.73], abs=0.01)
    assert t.reversal == pytest.approx([-0.4, 9.6, 6.0, -0.4, 12.2], abs=0.01)
    assert t.repeatability == pytest.approx([35.17, 37.72, 41.70, 48.71, 68.82], abs=0.02)


def test_figures_of_the_axis() -> None:
    """Its report takes R, E and A of both ways as one of the one-way figures; these are the standard's, by hand."""
    found = named(PUBLISHED)
    assert (found["R_up"], found["R_down"]) == pytest.approx((50.33, 62.90), abs=0.01)
    assert (found["E_up"], found["E_down"], found["M"]) == pytest.approx((24.6, 30.8 + 2.2, 27.7), abs=0.01)
    assert (found["A_up"], found["A_down"]) == pytest.approx((64.28, 88.81), abs=0.02)
    assert (found["B"], found["B_mean"]) == pytest.approx((12.2, 5.4), abs=0.01)
    assert found["R"] == pytest.approx(68.82, abs=0.02)
    assert found["E"] == pytest.approx(121.62 - 84.82, abs=0.01)
    assert found["A"] == pytest.approx(121.62 + 2 * 15.73 - (88.62 - 2 * 12.18), abs=0.05)


def test_by_hand() -> None:
    """Two targets, two approaches: s = |difference|/sqrt(2)."""
    x = np.array([[[0.0, 2.0], [5.0, 5.0]], [[-1.0, -1.0], [3.0, 7.0]]])
    found, root = named(x), math.sqrt(2)
    assert found["R_up"] == pytest.approx(4 * root)
    assert found["R_down"] == pytest.approx(8 * root)
    assert found["R"] == pytest.approx(8 * root)  # 4 sqrt(2) + 0 at the second target is less
    assert (found["B"], found["B_mean"], found["M"]) == pytest.approx((2.0, 1.0, 5.0))
    assert found["A"] == pytest.approx(max(5 + 4 * root, 1 + 2 * root) - min(1 - 2 * root, 5 - 4 * root))


def test_a_common_zero_changes_nothing_and_a_mirror_exchanges_the_ways() -> None:
    r = np.random.default_rng(1)
    x = r.normal(size=(2, 6, 5)) + np.array([0.5, -0.5])[:, None, None]
    assert figures(x + 17.0) == pytest.approx(figures(x), abs=1e-12)
    mirrored = named(-x[::-1, ::-1])
    here = named(x)
    assert mirrored["A_up"] == pytest.approx(here["A_down"])
    assert mirrored["B_mean"] == pytest.approx(here["B_mean"])
    assert (mirrored["A"], mirrored["R"], mirrored["M"]) == pytest.approx((here["A"], here["R"], here["M"]))


def test_many_at_once_are_each_by_itself() -> None:
    x = np.random.default_rng(2).normal(size=(7, 2, 5, 5))
    assert figures(x) == pytest.approx(np.array([figures(one) for one in x]))
    assert standard.figures(x).shape == (7, 12)


@pytest.mark.parametrize(("unit", "travel", "count"), [
    ("m", 0.02, 5), ("m", 1.0, 5), ("m", 1.5, 8), ("m", 2.0, 10), ("rad", math.radians(30), 3), ("rad", math.radians(90), 3),
    ("rad", math.radians(120), 5), ("rad", math.radians(180), 5), ("rad", math.radians(360), 8),
])  # fmt: skip
def test_how_many_targets(unit: str, travel: float, count: int) -> None:
    assert fewest(unit, travel) == count


@pytest.mark.parametrize("draw", range(20))
def test_targets_are_off_counts_and_off_squares(draw: int) -> None:
    pitch = math.radians(0.144)
    at = targets(0.0, 2 * math.pi, 8, pitch, draw, turns=True)
    parts = np.sort(at / pitch % 1)
    assert parts == pytest.approx((np.arange(8) + 0.5) / 8, abs=1e-6)
    off = (at + math.pi / 4) % (math.pi / 2) - math.pi / 4
    assert np.abs(off).min() > math.radians(1.8)
    assert (np.diff(at) > math.radians(15)).all()
    assert 0 < at[0] < at[-1] < 2 * math.pi
    assert np.ptp(np.diff(at)) > math.radians(1)  # not evenly spaced
    assert on_counts(at, pitch) == 0


def test_targets_on_counts_are_seen() -> None:
    assert on_counts([0.0, 1e-3, 2e-3, 2.0005e-3], 1e-6) == 3
    assert on_counts([0.0, 1e-3], 0.0) == 0


def test_the_cycle_goes_up_and_down_and_again() -> None:
    order = [(a.target, a.way, a.repeat) for a in cycle([0.0, 1.0, 2.0], 2)]
    once = [(0, 1), (1, 1), (2, 1), (2, -1), (1, -1), (0, -1)]
    assert order == [(*t, r) for r in (0, 1) for t in once]
