"""Shaded bands leave nothing of a curve out, upwards or downwards."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure as Canvas

from bench.figures import Figure, Series
from reports import figurekinds

T = np.linspace(0, 1, 50)


def limits(y: np.ndarray, *bands: tuple[str, float, float]) -> tuple[float, float]:
    axes = Canvas().subplots()
    figurekinds.bands(axes, Figure("", "", "", "t", "y", (Series("", T, y),), bands=bands))
    return axes.get_ylim()


def test_a_curve_below_the_bands_is_shown_whole() -> None:
    low, high = limits(np.sin(2 * np.pi * T), ("one count", -0.1, 0.1))
    assert low < -1 < 1 < high


def test_an_axis_begins_where_the_best_band_does() -> None:
    assert limits(1 + T, ("good", 0.0, 3.0), ("bad", 3.0, 4.0))[0] == 0
