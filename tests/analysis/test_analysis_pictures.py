"""The figures of a turning machine: units, signs and directions as a reader of such plots expects them; each can be drawn."""

from __future__ import annotations

import re

import numpy as np
import pytest
from turning import FULL, Shaft

from bench.analysis import loop_pictures, pictures
from bench.analysis.orbits import ellipse
from bench.analysis.ordermap import order_map
from bench.analysis.peaks import Peak
from bench.analysis.responses import Response, loop
from bench.analysis.spectra import full, waterfall
from bench.analysis.vectors import Vectors
from bench.errors import BenchError
from bench.figures import Figure, Series
from reports.figures import draw

SPEED = np.linspace(100.0, 1000.0, 60)
RESONANT = 1e-5 * SPEED**2 / (500.0**2 - SPEED**2 + 2j * 0.05 * 500 * SPEED)


def series(figure: Figure, label: str) -> Series:
    return next(s for s in figure.series if s.label == label)


@pytest.fixture(scope="module")
def made() -> dict[str, Figure]:
    shaft = Shaft(100.0, 90.0)
    t = np.arange(0, 8, 2e-4)
    tacho, x = shaft.tacho(8.0), 1e-5 * np.cos(shaft.angle(t))
    curve = pictures.Curve("y", SPEED[::-1], RESONANT[::-1], np.full(60, 1e-6))
    orbit = ellipse(Vectors(np.array([2e-5 + 0j, -1e-5j]), 1e-16 * np.eye(4)))
    hz = np.geomspace(5, 500, 40)
    s = Response(hz, 1 + 1.5 / (1 + 1j * (hz / 60 - 60 / hz)), np.tile(1e-4 * np.eye(2), (40, 1, 1)), np.ones(40), 19.0)
    seen = (pictures.Orbit("o", x[:50], x[:50], orbit, (1e-6, 0.0)),)
    figures = (
        pictures.bode("bode", "t", [curve]),
        pictures.polar("polar", "t", [curve]),
        pictures.orbits("orbits", "t", seen, 1e-4, pictures.Outlook(45.0)),
        pictures.waterfall("waterfall", "t", waterfall(t, x, tacho, FULL, segment=1024, count=12), 300.0),
        pictures.order_map("map", "t", order_map(t, x, tacho, FULL, turns=8)),
        pictures.full_spectrum("full", "t", full(x, np.zeros_like(x), 5000.0), 500.0, 300.0),
        loop_pictures.sensitivity(
            "sensitivity", "t", [("y", s)], (3, 4, 5), Peak(2.5, 2.4, 2.6, 0.05, 60, 1, 2.6, 0.1)
        ),
        loop_pictures.nyquist("nyquist", "t", [("y", loop(s))], 3.0),
    )
    return {f.key: f for f in figures}


KEYS = ("bode", "polar", "orbits", "waterfall", "map", "full", "sensitivity", "nyquist")


@pytest.mark.parametrize("key", KEYS)
def test_each_is_drawn_with_equal_bytes_and_ids_of_its_own(made: dict[str, Figure], key: str) -> None:
    svg = draw(made[key]).svg
    assert svg == draw(made[key]).svg
    assert all(i.startswith(f"{key}-") for i in re.findall(r'\bid="([^"]*)"', svg))
    assert len(svg) < 400_000


def test_a_bode_pair_is_in_um_rpm_and_unwrapped_lag_downwards(made: dict[str, Figure]) -> None:
    upper, lower = made["bode"], made["bode"].below
    assert lower is not None
    assert (upper.y_label, lower.y_label, lower.x_label) == ("1x amplitude (µm 0-pk)", "phase lag (°)", "speed (r/min)")
    assert lower.downward
    assert series(upper, "y").x[0] == pytest.approx(100 * 30 / np.pi)
    assert series(upper, "y").y.max() == pytest.approx(1e6 * np.abs(RESONANT).max())
    lag = series(lower, "y").y
    assert lag[0] == pytest.approx(
        np.degrees(np.arctan2(0.1 * 0.2, 1 - 0.2**2)), abs=0.01
    )  # below its critical a rotor moves with its unbalance
    assert lag[-1] == pytest.approx(180, abs=10)  # above, half a turn late
    assert (np.diff(lag) > 0).all()


def test_a_polar_plot_names_the_speeds_and_turns_with_the_lag(made: dict[str, Figure]) -> None:
    names = [int(text) for text, _, _ in made["polar"].notes]
    assert len(names) >= 4
    assert names == sorted(names)
    assert np.all(np.diff(np.unwrap(series(made["polar"], "y").x)) > 0)
    assert made["polar"].kind == "vectors"


def test_an_orbit_stands_as_seen_along_the_shaft_with_a_gap_before_the_mark(made: dict[str, Figure]) -> None:
    curve, mark = series(made["orbits"], "o 1x"), series(made["orbits"], "mark")
    corner = 21e-6 * np.exp(1j * np.pi / 4) * 1e6  # mark at x = 20 + 1 um, probe x at 45 deg
    assert (mark.x[0], mark.y[0]) == pytest.approx((corner.real, corner.imag))
    assert (curve.x[0], curve.y[0]) == pytest.approx((corner.real, corner.imag))
    assert np.hypot(curve.x[-1] - mark.x[0], curve.y[-1] - mark.y[0]) > 2
    ring = series(made["orbits"], "clearance")
    assert np.hypot(ring.x, ring.y) == pytest.approx(100)


def test_a_waterfall_is_drawn_from_the_back_and_says_its_scale(made: dict[str, Figure]) -> None:
    ridges = [s for s in made["waterfall"].series if s.style == "ridge"]
    floors = [s.y[-1] for s in ridges]
    assert floors == sorted(floors, reverse=True)
    assert "The tallest line is" in made["waterfall"].caption
    assert [n[0] for n in made["waterfall"].notes] == ["1x", "2x"]


def test_zones_meet_at_their_boundaries(made: dict[str, Figure]) -> None:
    assert [(b[0], b[1]) for b in made["sensitivity"].bands] == [
        ("zone A", 0),
        ("zone B", 3),
        ("zone C", 4),
        ("zone D", 5),
    ]


def test_the_nyquist_circle_is_the_zones(made: dict[str, Figure]) -> None:
    circle = series(made["nyquist"], "|S| = 3")
    assert np.hypot(circle.x + 1, circle.y) == pytest.approx(1 / 3)


def test_a_second_panel_is_checked_too(made: dict[str, Figure]) -> None:
    bad = Figure("k", "t", "c", "x", "y", (Series("s", np.arange(3.0), np.arange(4.0)),))
    with pytest.raises(BenchError, match="series 's'"):
        draw(Figure("k", "t", "c", "x", "y", (), below=bad))


def test_a_small_orbit_is_shown_closer_and_a_large_one_is_not(made: dict[str, Figure]) -> None:
    closer = made["orbits"].closer
    assert closer is not None
    x, y, reach = closer
    curve = series(made["orbits"], "o 1x")
    assert np.abs(curve.x - x).max() < reach
    assert np.abs(curve.y - y).max() < reach < 40
    large = ellipse(Vectors(np.array([6e-5 + 0j, -5e-5j]), 1e-16 * np.eye(4)))
    assert pictures.orbits("k", "t", [pictures.Orbit("o", ellipse=large)], 1e-4).closer is None


def test_measured_speeds_are_marked_and_none_between_them() -> None:
    """Between two dwells nothing was measured: no speeds there, in neither plot."""
    rpm = np.array([2000.0, 4000.0, 9990.0])
    values = 1e-5 * np.array([1, 3 * np.exp(-1j), np.exp(-2.5j)])
    curve = pictures.Curve("y", rpm * np.pi / 30, values, np.full(3, 1e-7))
    polar, bode = pictures.polar("polar", "t", [curve]), pictures.bode("bode", "t", [curve])
    assert [text for text, _, _ in polar.notes] == ["2000", "4000", "9990"]
    assert series(polar, "speed in r/min").y == pytest.approx(1e6 * np.abs(values))
    assert bode.below is not None
    assert bode.series[0].style == bode.below.series[0].style == "both"
