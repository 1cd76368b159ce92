"""Drawing figures: equal bytes, own ids, honest decimation, clear errors."""

from __future__ import annotations

import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas
from report_samples import HOSTILE, figures

from bench.errors import BenchError
from bench.figures import Figure, Series
from reports import figures as drawing
from reports.figures import BARS, MAX_LINE_POINTS, draw, envelope


def one(series: Series, **changes: object) -> Figure:
    return dataclasses.replace(Figure("key", "t", "c", "x / s", "y / m", (series,)), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("figure", figures()[:4], ids=lambda f: f.key)
def test_equal_figures_give_equal_svg_with_ids_of_their_own(figure: Figure) -> None:
    svg = draw(figure).svg
    assert svg == draw(figure).svg
    ids = re.findall(r'\bid="([^"]*)"', svg)
    assert ids
    assert all(i.startswith(f"{figure.key}-") for i in ids)
    assert set(re.findall(r"url\(#([^)]*)\)", svg)) | set(re.findall(r'href="#([^"]*)"', svg)) <= set(ids)
    assert not re.search(r"\d{4}-\d\d-\d\dT", svg)


@pytest.mark.parametrize(("u", "said", "caption"), [
    (None, "c.", "c."), ([0.0, 0.0], "c.", "c."), ([np.nan, np.nan], "c.", "c."), ([0.0, 0.1], "c.", f"c. {BARS}"),
    ([0.1, 0.1], "With its 95 % interval.", "With its 95 % interval."), ([0.1, 0.1], "With bars (95 %).", "With bars (95 %)."),
])  # fmt: skip
def test_a_caption_says_what_error_bars_are_where_there_are_some(
    u: list[float] | None, said: str, caption: str
) -> None:
    series = Series("", np.arange(2.0), np.arange(2.0), "points", None if u is None else np.array(u))
    assert draw(one(series, caption=said)).caption == caption
    above = one(Series("", np.arange(2.0), np.arange(2.0)), caption=said, below=one(series))
    assert draw(above).caption == caption


def test_a_hostile_label_is_a_drawing_and_not_markup() -> None:
    x = np.arange(3.0)
    svg = draw(one(Series(HOSTILE, x, x), x_label=HOSTILE, y_label="$\\frac{1$", lines=((HOSTILE, 1.0),))).svg
    ET.fromstring(svg)
    assert "<script" not in svg


def test_the_envelope_keeps_every_extreme() -> None:
    x = np.arange(100_000.0)
    y = np.sin(x / 500)
    y[54_321] = 7.0
    y[12_345] = -9.0
    small_x, small_y = envelope(x, y, MAX_LINE_POINTS)
    assert small_x.size <= MAX_LINE_POINTS
    assert np.all(np.diff(small_x) > 0)
    assert {7.0, -9.0} <= set(small_y.tolist())
    assert np.array_equal(small_y, y[small_x.astype(int)])


def test_a_long_line_gives_a_small_drawing() -> None:
    t = np.arange(60_000) / 1000
    assert len(draw(one(Series("noise", t, np.random.default_rng(0).normal(size=t.size)))).svg) < 120_000


def test_points_that_are_not_finite_and_empty_series_are_drawn_around() -> None:
    broken = np.array([1.0, np.nan, np.inf, 2.0])
    assert draw(one(Series("a", np.arange(4.0), broken, "both", broken))).svg
    assert draw(one(Series("a", np.array([]), np.array([])), kind="polar")).svg


def test_unequal_lengths_are_named() -> None:
    with pytest.raises(BenchError, match=r"'key', series 'a'.*'x': 3.*'y': 4"):
        draw(one(Series("a", np.arange(3.0), np.arange(4.0))))


def test_an_amplitude_over_its_lag_begins_at_zero_and_angles_have_quarter_turns() -> None:
    x = np.linspace(0.0, 10.0, 50)
    lag = Figure("lag", "", "", "speed (r/min)", "phase lag (°)", (Series("y", x, 27 * x),), downward=True)
    made = Figure("pair", "t", "c", "speed (r/min)", "amplitude (µm 0-pk)", (Series("y", x, 5 + x),), below=lag)
    upper, lower = Canvas().subplots(2)
    drawing._panel(upper, made)
    drawing._panel(lower, lag)
    assert upper.get_ylim()[0] == 0
    assert set(np.abs(np.diff(lower.get_yticks()))) == {90.0}


def test_a_lower_panel_that_shows_something_else_has_its_own_legend() -> None:
    """Legends are groups of their own in the drawing; one is for both where the panels show the same."""
    x = np.linspace(0.0, 10.0, 50)

    def two(*labels: str) -> Figure:
        return Figure("pair", "t", "c", "x", "y", tuple(Series(name, x, x + k) for k, name in enumerate(labels)))

    legends = [
        draw(dataclasses.replace(two("a", "b"), below=two(*below))).svg.count('id="pair-legend_')
        for below in (("a", "b"), ("c", "d"))
    ]
    assert legends == [1, 2]


def test_a_plane_with_a_closer_view_is_one_drawing_with_equal_bytes() -> None:
    turn = np.linspace(0, 2 * np.pi, 60)
    some = (
        Series("ring", 100 * np.cos(turn), 100 * np.sin(turn), "guide"),
        Series("orbit", np.cos(turn), np.sin(turn)),
    )
    made = Figure("o", "t", "c", "x (µm)", "y (µm)", some, "plane", closer=(0.0, 0.0, 1.25))
    assert draw(made).svg == draw(made).svg
    assert draw(made).svg.count("axes_") > draw(dataclasses.replace(made, closer=None)).svg.count("axes_")


def test_a_logarithmic_axis_has_equal_steps_for_equal_ratios_and_names_stand_for_numbers() -> None:
    series = Series("a", np.array([1.0, 2.0, 3.0]), np.array([0.01, 0.1, 1.0]))
    axes = Canvas().subplots()
    drawing._panel(axes, one(series, log_y=True, ticks=(("force row", 1.0), ("both", 3.0))))
    pixels = axes.transData.transform([(1.0, 0.01), (1.0, 0.1), (1.0, 1.0)])[:, 1]
    assert pixels[1] - pixels[0] == pytest.approx(pixels[2] - pixels[1])
    assert [t.get_text() for t in axes.get_xticklabels()] == ["force row", "both"]


def test_a_logarithmic_axis_of_a_decade_has_plain_numbers() -> None:
    """Minor numbers were drawn as the text of their mathematics, one over the other."""
    x = np.array([0.2, 2.0])
    svg = draw(one(Series("a", x, x), log_x=True, log_y=True)).svg
    assert "mathdefault" not in svg
    assert "<!-- 0.5 -->" in svg


def test_two_curves_differ_in_grey_and_a_fit_looks_like_its_points() -> None:
    x = np.arange(5.0)
    assert draw(one(Series("a", x, x))).svg.count("stroke-dasharray") == 0
    two = dataclasses.replace(one(Series("a", x, x)), series=(Series("a", x, x), Series("b", x, -x)))
    assert "stroke-dasharray" in draw(two).svg
    fitted = (Series("3 A", x, x, "points"), Series("3 A, fit", x, x), Series("4 A", x, -x, "points"))
    svg = draw(dataclasses.replace(two, series=fitted)).svg
    assert "<!-- 4 A -->" in svg
    assert "fit -->" not in svg


def test_symbols_of_labels_are_set_and_dollars_stay() -> None:
    x = np.arange(3.0)
    svg = draw(one(Series("a", x, x), x_label="D_max in $")).svg
    assert "D_max" not in svg
    assert "\\$" in svg
