"""Units: one closed table from the symbols of rig files, DBCs and key suffixes to SI, and how reports write them."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass

from bench.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Unit:
    """A symbol's SI unit and value_SI = value * factor + offset."""

    si: str
    factor: float = 1.0
    offset: float = 0.0


_TURN = 2 * math.pi / 60  # rad/s of 1 r/min

UNITS: dict[str, Unit] = {
    "1": Unit("1"), "": Unit("1"), "%": Unit("1", 1e-2),
    "m": Unit("m"), "mm": Unit("m", 1e-3), "um": Unit("m", 1e-6), "µm": Unit("m", 1e-6), "nm": Unit("m", 1e-9),
    "mil": Unit("m", 25.4e-6),
    "s": Unit("s"), "ms": Unit("s", 1e-3), "us": Unit("s", 1e-6), "µs": Unit("s", 1e-6),
    "Hz": Unit("Hz"), "kHz": Unit("Hz", 1e3),
    "1/s": Unit("1/s"), "1/s^2": Unit("1/s^2"), "1/s^3": Unit("1/s^3"), "1/(A s^2)": Unit("1/(A s^2)"),
    "m/s": Unit("m/s"), "mm/s": Unit("m/s", 1e-3), "um/s": Unit("m/s", 1e-6), "µm/s": Unit("m/s", 1e-6),
    "kg": Unit("kg"), "g": Unit("kg", 1e-3), "mg": Unit("kg", 1e-6),
    "N": Unit("N"), "kN": Unit("N", 1e3), "mN": Unit("N", 1e-3),
    "kg m": Unit("kg m"), "g mm": Unit("kg m", 1e-6), "m/(kg m)": Unit("m/(kg m)"), "um/(g mm)": Unit("m/(kg m)"),
    "N m^2/A^2": Unit("N m^2/A^2"), "N/(A m)": Unit("N/(A m)"),
    "H": Unit("H"), "mH": Unit("H", 1e-3), "T": Unit("T"), "mT": Unit("T", 1e-3),
    "Ohm": Unit("Ohm"), "Ω": Unit("Ohm"), "mOhm": Unit("Ohm", 1e-3), "mΩ": Unit("Ohm", 1e-3),
    "A": Unit("A"), "mA": Unit("A", 1e-3), "V": Unit("V"), "mV": Unit("V", 1e-3), "W": Unit("W"), "kW": Unit("W", 1e3),
    "K": Unit("K"), "degC": Unit("K", 1.0, 273.15), "°C": Unit("K", 1.0, 273.15),
    "rad": Unit("rad"), "mrad": Unit("rad", 1e-3), "urad": Unit("rad", 1e-6), "µrad": Unit("rad", 1e-6),
    "deg": Unit("rad", math.pi / 180), "°": Unit("rad", math.pi / 180), "gon": Unit("rad", math.pi / 200),
    "rad/s": Unit("rad/s"), "deg/s": Unit("rad/s", math.pi / 180), "°/s": Unit("rad/s", math.pi / 180),
    "r/min": Unit("rad/s", _TURN), "rpm": Unit("rad/s", _TURN), "1/min": Unit("rad/s", _TURN), "min-1": Unit("rad/s", _TURN),
    "U/min": Unit("rad/s", _TURN),
    "rad/s^2": Unit("rad/s^2"), "rad/s²": Unit("rad/s^2"), "m/s^2": Unit("m/s^2"), "m/s²": Unit("m/s^2"),
    "kg/m^3": Unit("kg/m^3"), "kg/m³": Unit("kg/m^3"), "kg m^2": Unit("kg m^2"), "kg m²": Unit("kg m^2"),
    "N/A": Unit("N/A"), "N/A^2": Unit("N/A^2"), "N/m": Unit("N/m"), "N/mm": Unit("N/m", 1e3),
    "A/m": Unit("A/m"), "A/mm": Unit("A/m", 1e3), "A s/m": Unit("A s/m"), "A/(m s)": Unit("A/(m s)"),
    "A/rad": Unit("A/rad"), "A s/rad": Unit("A s/rad"), "A/(rad s)": Unit("A/(rad s)"), "A/s": Unit("A/s"),
    "N m": Unit("N m"), "Nm": Unit("N m"), "mN m": Unit("N m", 1e-3), "mNm": Unit("N m", 1e-3),
    "N m/A": Unit("N m/A"), "N m s/rad": Unit("N m s/rad"), "N s/m": Unit("N s/m"), "N/(m s)": Unit("N/(m s)"),
    "N m/rad": Unit("N m/rad"), "N m/(rad s)": Unit("N m/(rad s)"),
    "m/N": Unit("m/N"), "um/N": Unit("m/N", 1e-6), "µm/N": Unit("m/N", 1e-6),
    "rad/(N m)": Unit("rad/(N m)"), "mrad/(N m)": Unit("rad/(N m)", 1e-3),
    "H/m": Unit("H/m"), "m/rad": Unit("m/rad"), "rad/m": Unit("rad/m"), "1/m": Unit("1/m"),
    "V/A": Unit("V/A"), "A/V": Unit("A/V"), "V/(A s)": Unit("V/(A s)"), "A/(V s)": Unit("A/(V s)"), "Wb": Unit("Wb"),
    "uH": Unit("H", 1e-6), "µH": Unit("H", 1e-6), "F": Unit("F"), "uF": Unit("F", 1e-6), "µF": Unit("F", 1e-6),
}  # fmt: skip
"""1/min and U/min are turns of a shaft, as controllers write its speed. Of the two letters that look alike, `µ` is the micro
sign, which cp1252 has; the Greek one is read as that."""

RPM = 30 / math.pi  # r/min of 1 rad/s

KNOWN = f"a known unit: one of {', '.join(symbol for symbol in UNITS if symbol)}"
"""What is expected where a unit is asked for."""

UNITS |= {symbol.replace("µ", "μ"): found for symbol, found in UNITS.items() if "µ" in symbol}

AMBIGUOUS = {"grad": "a unit that means one thing: write deg or gon (grad is a degree in German, a gon in English)"}
"""Symbols that mean two units, in small letters, and what is expected in their place."""

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
        raise ConfigError(
            f"unknown unit {symbol!r}; expected {expected(symbol).removeprefix('a known unit: ')}"
        ) from None


def expected(symbol: str) -> str:
    """What is expected in the place of a symbol that is no known unit: the list, and the nearest one."""
    if symbol.lower() in AMBIGUOUS:
        return AMBIGUOUS[symbol.lower()]
    close = difflib.get_close_matches(symbol, UNITS, 1)
    return KNOWN + (f". Did you mean {close[0]!r}?" if close else "")


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
