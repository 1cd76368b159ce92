"""The unit table against definitions, and suffixes against the units they mean."""

from __future__ import annotations

import math

import pytest

from bench.errors import ConfigError
from bench.units import SUFFIXES, UNITS, split_suffix, to_si, unit


@pytest.mark.parametrize(
    ("value", "symbol", "si", "si_unit"),
    [
        (150.0, "mm", 0.150, "m"),
        (2.5, "um", 2.5e-6, "m"),
        (2.5, "µm", 2.5e-6, "m"),
        (50.0, "mg", 50e-6, "kg"),
        (242.6, "N/mm", 242.6e3, "N/m"),
        (20.0, "degC", 293.15, "K"),
        (-273.15, "degC", 0.0, "K"),
        (60.0, "r/min", 2 * math.pi, "rad/s"),
        (180.0, "deg", math.pi, "rad"),
        (30.0, "A/mm", 30000.0, "A/m"),
        (15.0, "%", 0.15, "1"),
        (2.65, "mH", 2.65e-3, "H"),
        (3.0, "g mm", 3e-6, "kg m"),
        (7.0, "", 7.0, "1"),
        (3000.0, "1/min", 100 * math.pi, "rad/s"),
        (3000.0, "U/min", 100 * math.pi, "rad/s"),
        (3000.0, "min-1", 100 * math.pi, "rad/s"),
        (360.0, "°/s", 2 * math.pi, "rad/s"),
        (90.0, "°", math.pi / 2, "rad"),
        (100.0, "gon", math.pi / 2, "rad"),
        (1.0, "mil", 25.4e-6, "m"),
        (40.0, "nm", 4e-8, "m"),
        (5.0, "μm", 5e-6, "m"),  # the Greek letter
        (7.0, "mm/s", 7e-3, "m/s"),
        (250.0, "mNm", 0.25, "N m"),
        (1.5, "kN", 1500.0, "N"),
        (80.0, "mT", 0.08, "T"),
        (0.4, "Ω", 0.4, "Ohm"),
        (2.0, "kW", 2000.0, "W"),
    ],
)
def test_a_value_becomes_si(value: float, symbol: str, si: float, si_unit: str) -> None:
    assert to_si(value, symbol) == pytest.approx(si, rel=1e-14, abs=1e-13)
    assert unit(symbol).si == si_unit


def test_every_unit_leads_to_one_that_is_si_itself() -> None:
    for symbol, found in UNITS.items():
        si = UNITS[found.si]
        assert (si.si, si.factor, si.offset) == (found.si, 1.0, 0.0), symbol
        assert found.factor > 0, symbol


def test_an_unknown_unit_names_itself_and_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"unknown unit 'furlong'; expected one of 1, %, m, mm"):
        to_si(1.0, "furlong")


@pytest.mark.parametrize("symbol", ["grad", "Grad"])
def test_a_unit_that_means_two_is_refused_with_what_to_write(symbol: str) -> None:
    with pytest.raises(
        ConfigError, match=f"unknown unit '{symbol}'; expected a unit that means one thing: write deg or gon"
    ):
        unit(symbol)


@pytest.mark.parametrize(
    ("key", "base", "factor", "si"),
    [
        ("max_speed_rpm", "max_speed", 2 * math.pi / 60, "rad/s"),
        ("max_speed_rad_s", "max_speed", 1.0, "rad/s"),
        ("settling_s", "settling", 1.0, "s"),
        ("settling_ms", "settling", 1e-3, "s"),
        ("step_um", "step", 1e-6, "m"),
        ("limit_mA", "limit", 1e-3, "A"),
        ("tolerance_percent", "tolerance", 1e-2, "1"),
    ],
)
def test_a_suffix_is_split_off_a_key(key: str, base: str, factor: float, si: str) -> None:
    found = split_suffix(key)
    assert (found[0], found[2]) == (base, si)
    assert found[1] == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("key", ["speed", "_mm", "speed_knots", "mm"])
def test_a_key_without_a_unit_is_refused(key: str) -> None:
    with pytest.raises(ConfigError, match="no unit suffix"):
        split_suffix(key)


def test_a_suffix_with_an_offset_is_refused_because_a_factor_cannot_say_it() -> None:
    with pytest.raises(ConfigError, match="give it in K"):
        split_suffix("winding_degC")


def test_every_suffix_means_a_unit_of_the_table() -> None:
    assert set(SUFFIXES.values()) <= UNITS.keys()
