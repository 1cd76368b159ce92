"""Units: one closed table from the symbols of rig files, DBCs and key suffixes to SI, and how reports write them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Unit:
    """A symbol's SI unit and value_SI = value * factor + offset."""

    si: str
    factor: float = 1.0
    offset: float = 0.0


UNITS: dict[str, Unit] = {
    "1": Unit("1"), "": Unit("1"), "%": Unit("1", 1e-2),
    "m": Unit("m"), "mm": Unit("m", 1e-3), "um": Unit("m", 1e-6), "µm": Unit("m", 1e-6), "mil": Unit("m", 25.4e-6),
    "s": Unit("s"), "ms": Unit("s", 1e-3), "us": Unit("s", 1e-6), "Hz": Unit("Hz"), "kHz": Unit("Hz", 1e3),
    "1/s": Unit("1/s"), "1/s^2": Unit("1/s^2"), "1/s^3": Unit("1/s^3"), "m/s": Unit("m/s"), "N/(A m)": Unit("N/(A m)"),
    "kg": Unit("kg"), "g": Unit("kg", 1e-3), "mg": Unit("kg", 1e-6), "N": Unit("N"),
    "kg m": Unit("kg m"), "g mm": Unit("kg m", 1e-6), "m/(kg m)": Unit("m/(kg m)"), "um/(g mm)": Unit("m/(kg m)"),
    "N m^2/A^2": Unit("N m^2/A^2"),
    "H": Unit("H"), "mH": Unit("H", 1e-3), "Ohm": Unit("Ohm"),
    "A": Unit("A"), "mA": Unit("A", 1e-3), "V": Unit("V"), "mV": Unit("V", 1e-3),
    "K": Unit("K"), "degC": Unit("K", 1.0, 273.15), "°C": Unit("K", 1.0, 273.15),
    "rad": Unit("rad"), "mrad": Unit("rad", 1e-3), "urad": Unit("rad", 1e-6),
    "deg": Unit("rad", math.pi / 180),
    "rad/s": Unit("rad/s"), "r/min": Unit("rad/s", 2 * math.pi / 60),
    "rpm": Unit("rad/s", 2 * math.pi / 60), "rad/s^2": Unit("rad/s^2"),
    "m/s^2": Unit("m/s^2"), "kg/m^3": Unit("kg/m^3"), "kg m^2": Unit("kg m^2"),
    "N/A": Unit("N/A"), "N/A^2": Unit("N/A^2"), "N/m": Unit("N/m"), "N/mm": Unit("N/m", 1e3),
    "A/m": Unit("A/m"), "A/mm": Unit("A/m", 1e3), "A s/m": Unit("A s/m"), "A/(m s)": Unit("A/(m s)"),
    "A/rad": Unit("A/rad"), "A s/rad": Unit("A s/rad"), "A/(rad s)": Unit("A/(rad s)"), "A/s": Unit("A/s"),
    "N m": Unit("N m"), "N m/A": Unit("N m/A"), "N m s/rad": Unit("N m s/rad"), "N s/m": Unit("N s/m"),
}  # fmt: skip

RPM = 30 / math.pi  # r/min of 1 rad/s

KNOWN = f"a known unit: one of {', '.join(symbol for symbol in UNITS if symbol)}"
"""What is expected where a unit is asked for."""

SUFFIXES: dict[str, str] = {
    "m": "m", "mm": "mm", "um": "um", "s": "s", "ms": "ms", "us": "us", "Hz": "Hz", "kg": "kg", "g": "g", "N": "N",
    "A": "A", "mA": "mA", "V": "V", "K": "K", "degC": "degC", "rad": "rad", "mrad": "mrad", "deg": "deg",
    "rad_s": "rad/s", "rpm": "r/min", "percent": "%",
}  # fmt: skip
"""What may stand after the last underscores of a key, and the unit it means."""


def unit(symbol: str) -> Unit:
    """The table's entry.

    Raises:
        ConfigError: the unit is unknown; the message lists the known ones.
    """
    try:
        return UNITS[symbol]
    except KeyError:
        raise ConfigError(f"unknown unit {symbol!r}; expected {KNOWN.removeprefix('a known unit: ')}") from None


def to_si(value: float, symbol: str) -> float:
    """A value in the SI unit of its kind."""
    u = unit(symbol)
    return value * u.factor + u.offset


def split_suffix(key: str) -> tuple[str, float, str]:
    """`max_speed_rpm` is ("max_speed", 2 pi/60, "rad/s"): base name, factor to SI, SI unit.

    Raises:
        ConfigError: the key ends in no known suffix, or in one that a factor cannot convert (degC).
    """
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        base = key.removesuffix(f"_{suffix}")
        if base != key and base:
            found = UNITS[SUFFIXES[suffix]]
            if found.offset:
                raise ConfigError(f"{key}: {SUFFIXES[suffix]} has an offset; give it in {found.si}")
            return base, found.factor, found.si
    raise ConfigError(f"{key}: no unit suffix; expected one of {', '.join('_' + s for s in SUFFIXES)}")
