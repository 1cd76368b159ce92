"""In which units people are told numbers that are SI inside: results, certificates, settings of plans, labels of steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bench import units

Below = tuple[tuple[str, float], ...]
"""Units in order, each for sizes in SI below its number."""
RESULTS: Mapping[str, Below] = {
    "kg m": (("g mm", math.inf),), "m/(kg m)": (("um/(g mm)", math.inf),), "m": (("um", 1e-3), ("mm", 0.05)),
    "rad/s": (("r/min", math.inf),), "s": (("us", 3e-5), ("ms", 0.1)), "rad": (("urad", 3e-4), ("deg", math.inf)),
}  # fmt: skip
"""As the field states them. Of angles, tilts of a shaft are small ones and phases are not."""
CERTIFICATES: Mapping[str, Below] = {
    "m": (("um", 1e-4), ("mm", 1.0)), "kg": (("mg", 1e-4), ("g", 1e-2)), "rad": (("deg", math.inf),),
}  # fmt: skip
CHANNELS: Mapping[str, Below] = {
    "m": (("um", 1e-3), ("mm", math.inf)), "rad/s": (("r/min", math.inf),), "rad": (("deg", math.inf),),
    "K": (("degC", math.inf),),
}  # fmt: skip
SETTINGS: tuple[tuple[str, str, Below], ...] = (
    ("_rad_s", "rad/s", (("_rpm", math.inf),)), ("_rad", "rad", (("_mrad", 0.02), ("_deg", math.inf))),
    ("_m", "m", (("_um", 1e-3),)), ("_kg", "kg", (("_g", 1e-2),)), ("_A", "A", (("_mA", 0.1),)),
)  # fmt: skip
"""Ends of their names, SI and told: a plan takes either."""
LABELS = (
    ("_rad_s2", math.pi / 30, " r/min/s"), ("_rad_s", math.pi / 30, " r/min"), ("_rad", math.pi / 180, "°"),
    ("_kg", 1e-3, " g"), ("_m", 1e-6, " µm"), ("_A", 1.0, " A"), ("_hz", 1.0, " Hz"), ("_s", 1.0, " s"),
)  # fmt: skip
"""Ends of their names, SI; what one of the unit that is told is in SI, and the unit."""
TILTS = ("psi", "theta")  # set points of angles among those of a shaft
WAYS = {1: "loading", -1: "unloading"}  # of the label `branch`


def of_result(si: str, size: float) -> tuple[str, float]:
    """Symbol of the unit in which a result of about `size` is told, and what one of it is in SI."""
    return _chosen(si, abs(size), RESULTS)


def of_certificate(si: str, size: float) -> tuple[str, float]:
    """Symbol of the unit in which a number of about `size` is written in a certificate, and what one of it is in SI."""
    return _chosen(si, size, CERTIFICATES) if size > 0 else (si, 1.0)


def of_channel(si: str, size: float) -> tuple[str, float, float]:
    """Symbol of the unit in which a channel of about `size` is shown live, what one of it is in SI, and SI of its zero."""
    symbol, _ = _chosen(si, size, CHANNELS)
    told = units.unit(symbol)
    return symbol, told.factor, told.offset


def _chosen(si: str, size: float, table: Mapping[str, Below]) -> tuple[str, float]:
    symbol = next((symbol for symbol, below in table.get(si, ()) if size < below), None)
    return (si, 1.0) if symbol is None else (symbol, units.unit(symbol).factor)


def of_setting(key: str, values: Sequence[float]) -> tuple[str, list[float]]:
    """A setting's name with the unit in which such numbers are usually given, and its numbers in it."""
    for end, si, told in SETTINGS:
        if key.endswith(end) and not key.endswith("_kg_m"):
            size = max(abs(v) for v in values)
            suffix = next((other for other, below in told if size < below), "")
            if suffix:
                one = units.unit(units.SUFFIXES[suffix[1:]]).factor / units.unit(si).factor
                return key.removesuffix(end) + suffix, [float(f"{v / one:.12g}") for v in values]
            break
    return key, list(values)


def of_labels(labels: Mapping[str, Any]) -> str:
    """A step's labels for people: speeds in r/min, motion in µm, angles in degrees; what has no value is left out. A set
    point's `name` with its `value`, SI, is one."""
    if labels.keys() == {"name", "value"} and isinstance(labels["value"], float):
        unit = "µrad" if any(t in str(labels["name"]) for t in TILTS) else "µm"
        return f"{labels['name']} {_number(1e6 * labels['value'])} {unit}"
    return ", ".join(text for name, value in labels.items() if (text := _label(name, value)))


def _label(name: str, value: Any) -> str:
    if name == "branch" and value in WAYS:
        return WAYS[value]
    if name == "load":
        return str(value) or "no load"
    if isinstance(value, bool):
        return name if value else ""
    if isinstance(value, float):
        for end, one, unit in LABELS:
            if name.endswith(end):
                return f"{name.removesuffix(end)} {_number(value / one)}{unit}"
        return f"{name} {_number(value)}"
    return "" if value == "" else f"{name} {value}"


def _number(value: float) -> str:
    """Four digits, all of a large number, no negative zero."""
    return f"{value + 0.0:.4g}" if abs(value) < 1e4 - 0.5 else f"{value:.0f}"
