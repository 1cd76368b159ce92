"""Units: one closed table to SI, unit suffixes of keys, and how numbers are shown.

Inside Levbench everything is SI. Other units exist in rig, spec and plan files (as a `unit` or as the suffix of a key) and
in reports. An unknown unit is an error, never a guess.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from decimal import ROUND_HALF_EVEN, Decimal
from typing import Any, Final, NamedTuple


class Unit(NamedTuple):
    """`SI value = factor * value + offset`; `dimension` holds the exponents of (m, kg, s, A, K, rad)."""

    symbol: str
    si: str
    factor: float
    offset: float
    dimension: tuple[int, int, int, int, int, int]


class Suffix(NamedTuple):
    """A key split at its unit: `max_speed_rpm` is ("max_speed", 2 pi/60, "rad/s", 0.0, "rad_s")."""

    stem: str
    factor: float
    unit: str
    offset: float
    si_suffix: str


_TURN: Final = 2.0 * math.pi
_ONE = (0, 0, 0, 0, 0, 0)
_M = (1, 0, 0, 0, 0, 0)
_KG = (0, 1, 0, 0, 0, 0)
_S = (0, 0, 1, 0, 0, 0)
_A = (0, 0, 0, 1, 0, 0)
_K = (0, 0, 0, 0, 1, 0)
_RAD = (0, 0, 0, 0, 0, 1)
_PER_S = (0, 0, -1, 0, 0, 0)
_RAD_S = (0, 0, -1, 0, 0, 1)
_N = (1, 1, -2, 0, 0, 0)
_V = (2, 1, -3, -1, 0, 0)
_N_M = (0, 1, -2, 0, 0, 0)
_TORQUE = (2, 1, -2, 0, 0, 0)
_DAMPING = (2, 1, -1, 0, 0, -1)

_ROWS: Final[tuple[Unit, ...]] = (
    Unit("1", "1", 1.0, 0.0, _ONE),
    Unit("", "1", 1.0, 0.0, _ONE),
    Unit("%", "1", 1e-2, 0.0, _ONE),
    Unit("m", "m", 1.0, 0.0, _M),
    Unit("mm", "m", 1e-3, 0.0, _M),
    Unit("um", "m", 1e-6, 0.0, _M),
    Unit("µm", "m", 1e-6, 0.0, _M),  # U+00B5 micro sign
    Unit("μm", "m", 1e-6, 0.0, _M),  # U+03BC Greek mu
    Unit("nm", "m", 1e-9, 0.0, _M),
    Unit("kg", "kg", 1.0, 0.0, _KG),
    Unit("g", "kg", 1e-3, 0.0, _KG),
    Unit("mg", "kg", 1e-6, 0.0, _KG),
    Unit("s", "s", 1.0, 0.0, _S),
    Unit("ms", "s", 1e-3, 0.0, _S),
    Unit("us", "s", 1e-6, 0.0, _S),
    Unit("ns", "s", 1e-9, 0.0, _S),
    Unit("Hz", "Hz", 1.0, 0.0, _PER_S),
    Unit("kHz", "Hz", 1e3, 0.0, _PER_S),
    Unit("A", "A", 1.0, 0.0, _A),
    Unit("mA", "A", 1e-3, 0.0, _A),
    Unit("A/s", "A/s", 1.0, 0.0, (0, 0, -1, 1, 0, 0)),
    Unit("V", "V", 1.0, 0.0, _V),
    Unit("mV", "V", 1e-3, 0.0, _V),
    Unit("K", "K", 1.0, 0.0, _K),
    Unit("degC", "K", 1.0, 273.15, _K),
    Unit("rad", "rad", 1.0, 0.0, _RAD),
    Unit("mrad", "rad", 1e-3, 0.0, _RAD),
    Unit("deg", "rad", _TURN / 360.0, 0.0, _RAD),
    Unit("rad/s", "rad/s", 1.0, 0.0, _RAD_S),
    Unit("deg/s", "rad/s", _TURN / 360.0, 0.0, _RAD_S),
    Unit("r/min", "rad/s", _TURN / 60.0, 0.0, _RAD_S),
    Unit("rpm", "rad/s", _TURN / 60.0, 0.0, _RAD_S),
    Unit("m/s", "m/s", 1.0, 0.0, (1, 0, -1, 0, 0, 0)),
    Unit("m/s^2", "m/s^2", 1.0, 0.0, (1, 0, -2, 0, 0, 0)),
    Unit("N", "N", 1.0, 0.0, _N),
    Unit("mN", "N", 1e-3, 0.0, _N),
    Unit("N/A", "N/A", 1.0, 0.0, (1, 1, -2, -1, 0, 0)),
    Unit("N/A^2", "N/A^2", 1.0, 0.0, (1, 1, -2, -2, 0, 0)),
    Unit("N m^2/A^2", "N m^2/A^2", 1.0, 0.0, (3, 1, -2, -2, 0, 0)),
    Unit("N/m", "N/m", 1.0, 0.0, _N_M),
    Unit("N/mm", "N/m", 1e3, 0.0, _N_M),
    Unit("N s/m", "N s/m", 1.0, 0.0, (0, 1, -1, 0, 0, 0)),
    Unit("N m", "N m", 1.0, 0.0, _TORQUE),
    Unit("mN m", "N m", 1e-3, 0.0, _TORQUE),
    Unit("N m/A", "N m/A", 1.0, 0.0, (2, 1, -2, -1, 0, 0)),
    Unit("N m s/rad", "N m s/rad", 1.0, 0.0, _DAMPING),
    Unit("A/m", "A/m", 1.0, 0.0, (-1, 0, 0, 1, 0, 0)),
    Unit("A s/m", "A s/m", 1.0, 0.0, (-1, 0, 1, 1, 0, 0)),
    Unit("A/(m s)", "A/(m s)", 1.0, 0.0, (-1, 0, -1, 1, 0, 0)),
    Unit("A/rad", "A/rad", 1.0, 0.0, (0, 0, 0, 1, 0, -1)),
    Unit("A s/rad", "A s/rad", 1.0, 0.0, (0, 0, 1, 1, 0, -1)),
    Unit("A/(rad s)", "A/(rad s)", 1.0, 0.0, (0, 0, -1, 1, 0, -1)),
    Unit("kg/m^3", "kg/m^3", 1.0, 0.0, (-3, 1, 0, 0, 0, 0)),
    Unit("kg m^2", "kg m^2", 1.0, 0.0, (2, 1, 0, 0, 0, 0)),
    Unit("Pa", "Pa", 1.0, 0.0, (-1, 1, -2, 0, 0, 0)),
    Unit("hPa", "Pa", 1e2, 0.0, (-1, 1, -2, 0, 0, 0)),
)
UNITS: Final[Mapping[str, Unit]] = {row.symbol: row for row in _ROWS}
"""Every unit that a file may name."""

_SUFFIXES: Final[Mapping[str, str]] = {
    "m": "m",
    "mm": "mm",
    "um": "um",
    "nm": "nm",
    "kg": "kg",
    "g": "g",
    "mg": "mg",
    "s": "s",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "Hz": "Hz",
    "hz": "Hz",
    "kHz": "kHz",
    "A": "A",
    "mA": "mA",
    "V": "V",
    "K": "K",
    "degC": "degC",
    "rad": "rad",
    "mrad": "mrad",
    "deg": "deg",
    "rad_s": "rad/s",
    "deg_s": "deg/s",
    "rpm": "rpm",
    "N": "N",
    "Nm": "N m",
    "percent": "%",
}
_SI_SUFFIX: Final[Mapping[str, str]] = {
    "m": "m",
    "kg": "kg",
    "s": "s",
    "Hz": "Hz",
    "A": "A",
    "V": "V",
    "K": "K",
    "rad": "rad",
    "rad/s": "rad_s",
    "N": "N",
    "N m": "Nm",
    "1": "",
}


def unit(symbol: str) -> Unit:
    """The unit of that symbol.

    Raises:
        ValueError: the unit is not in the table; the text names the known ones.
    """
    try:
        return UNITS[symbol]
    except KeyError:
        known = ", ".join(sorted(name for name in UNITS if name and name.isascii()))
        raise ValueError(f"unknown unit {symbol!r}; known units: {known}") from None


def to_si(value: float, symbol: str) -> float:
    """`value` in that unit, in SI (raises ValueError for an unknown unit)."""
    row = unit(symbol)
    return value * row.factor + row.offset


def same_dimension(first: str, second: str) -> bool:
    """Whether both units measure the same kind of quantity; angles are not plain numbers here."""
    return unit(first).dimension == unit(second).dimension


def split_suffix(key: str) -> Suffix | None:
    """Split a key at its unit suffix, the longest that fits; None when it has none."""
    parts = key.split("_")
    for count in (2, 1):
        ending = "_".join(parts[-count:])
        if len(parts) > count and ending in _SUFFIXES:
            row = UNITS[_SUFFIXES[ending]]
            return Suffix("_".join(parts[:-count]), row.factor, row.si, row.offset, _SI_SUFFIX[row.si])
    return None


def si_entry(key: str, value: Any, allowed: Collection[str]) -> tuple[str, Any]:
    """The SI key and value of one entry: `settle_ms=600` is ("settle_s", 0.6) when `settle_s` is allowed.

    A key that is allowed as it stands, or that fits none of the allowed ones, comes back as it is. Lists convert
    element by element.
    """
    split = None if key in allowed else split_suffix(key)
    if split is None:
        return key, value
    spelt = f"{split.stem}_{split.si_suffix}"
    if spelt in allowed:
        return spelt, _scaled(value, split)
    return (split.stem, _scaled(value, split)) if split.stem in allowed else (key, value)


def si_table(table: Mapping[str, Any], allowed: Collection[str]) -> dict[str, Any]:
    """`si_entry` on a whole table.

    Raises:
        ValueError: two keys give the same setting (`settle_s` and `settle_ms`).
    """
    result: dict[str, Any] = {}
    for key, value in table.items():
        name, converted = si_entry(key, value, allowed)
        if name in result:
            raise ValueError(f"{key!r} sets {name!r}, which is already set by another key")
        result[name] = converted
    return result


def _scaled(value: Any, suffix: Suffix) -> Any:
    if isinstance(value, list | tuple):
        return [_scaled(item, suffix) for item in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return value * suffix.factor + suffix.offset


_PREFIXES: Final = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_SUPERSCRIPT: Final = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def pretty_unit(symbol: str) -> str:
    """A unit as it is printed: `kg/m^3` is kg/m³, `A s/m` is A·s/m, `um` is µm, `1` is empty."""
    named = {"1": "", "um": "µm", "μm": "µm", "us": "µs", "degC": "°C", "deg": "°", "rpm": "r/min"}
    if symbol in named:
        return named[symbol]
    pieces = symbol.split("^")
    text = pieces[0]
    for piece in pieces[1:]:
        digits = len(piece) - len(piece.lstrip("-0123456789"))
        text += piece[:digits].translate(_SUPERSCRIPT) + piece[digits:]
    return text.replace(" ", "·")


def rounded(value: float, uncertainty: float) -> tuple[str, str]:
    """Value and uncertainty as text: the uncertainty to two significant digits, the value to the same place.

    Both come back as plain decimals, the value as given (to 6 digits) when the uncertainty is zero or not finite.
    """
    if not (math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0.0):
        return f"{value:.6g}", f"{uncertainty:.2g}"
    exact = Decimal(repr(float(uncertainty)))
    place = exact.adjusted() - 1
    short = exact.quantize(Decimal((0, (1,), place)), rounding=ROUND_HALF_EVEN)
    if short.adjusted() - 1 != place:  # 0.0996 rounds up to 0.10, which already has its two digits
        place = short.adjusted() - 1
        short = short.quantize(Decimal((0, (1,), place)))
    shown = Decimal(repr(float(value))).quantize(Decimal((0, (1,), place)), rounding=ROUND_HALF_EVEN)
    return f"{shown:f}", f"{short:f}"


def with_uncertainty(value: float, uncertainty: float, symbol: str) -> str:
    """For example `73.21 ± 0.35 N/A`."""
    number, spread = rounded(value, uncertainty)
    return f"{number} ± {spread} {pretty_unit(symbol)}".rstrip()


def engineering(value: float, symbol: str, digits: int = 4) -> str:
    """A value with an engineering prefix where the unit takes one: 2.5e-05 m is `25 µm`.

    Composite units, numbers without unit and kilograms keep their unit.
    """
    if symbol not in ("m", "s", "A", "V", "N", "Hz", "rad", "Pa") or value == 0.0 or not math.isfinite(value):
        return f"{value:.{digits}g} {pretty_unit(symbol)}".rstrip()
    power = min(9, max(-12, 3 * math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))) / 3)))
    if symbol == "rad" and power > 0:
        power = 0
    return f"{value / 10.0**power:.{digits}g} {_PREFIXES[power]}{symbol}"
