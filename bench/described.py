"""A step's labels in words: speeds in r/min, motion in µm, angles in degrees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

# Ends of the names of labels, SI; the unit in which they are told, and what one of it is in SI.
TOLD = (
    ("_rad_s2", math.pi / 30, " r/min/s"), ("_rad_s", math.pi / 30, " r/min"), ("_rad", math.pi / 180, "°"),
    ("_kg", 1e-3, " g"), ("_m", 1e-6, " µm"), ("_A", 1.0, " A"), ("_hz", 1.0, " Hz"), ("_s", 1.0, " s"),
)  # fmt: skip
WAYS = {1: "loading", -1: "unloading"}  # of the label `branch`


def described(labels: Mapping[str, Any]) -> str:
    """A step's labels for people; what has no value is left out."""
    return ", ".join(text for name, value in labels.items() if (text := _label(name, value)))


def _label(name: str, value: Any) -> str:
    if name == "branch" and value in WAYS:
        return WAYS[value]
    if name == "load":
        return str(value) or "no load"
    if isinstance(value, bool):
        return name if value else ""
    if isinstance(value, float):
        for end, one, unit in TOLD:
            if name.endswith(end):
                return f"{name.removesuffix(end)} {_number(value / one)}{unit}"
        return f"{name} {_number(value)}"
    return "" if value == "" else f"{name} {value}"


def _number(value: float) -> str:
    """Four digits, all of a large number, no negative zero."""
    return f"{value + 0.0:.4g}" if abs(value) < 1e4 - 0.5 else f"{value:.0f}"
