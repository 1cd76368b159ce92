"""The masses of a plan on a rig where nobody says otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.rigfile import RigFile


def by_weight(rig: RigFile) -> tuple[str, ...]:
    """Labels of the masses that may be hung, the lightest first; of two alike the first of the file."""
    hung = {label: m.value for label, m in rig.masses.items() if m.value <= rig.envelope.max_hung_kg}
    return tuple(sorted({kg: label for label, kg in reversed(hung.items())}.values(), key=hung.__getitem__))


def nth_lightest(rig: RigFile, **places: int) -> Mapping[str, Any]:
    """A mass for each of these settings, the so manieth by weight, from 0, or the heaviest where there are not so many."""
    labels = by_weight(rig)
    return {name: labels[min(k, len(labels) - 1)] for name, k in places.items()} if labels else {}
