"""Names of quantities that had their place in them, for rig files of schema 1: what `[aliases]` says today."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

BY_BEARING = {f"{kind}_{end[0]}": (kind, end) for kind in ("K", "K2", "Kw", "F0") for end in ("inboard", "outboard")}
BY_AXIS = ("beta", "offset")
BY_COORDINATE = {
    **{f"{kind}_{c}": (kind, c) for kind in ("error_peak", "error_rms", "amplitude_ratio", "phase_lag") for c in "yz"},
    **{f"tilt_{c}": ("tilt", c) for c in ("psi", "theta")},
}


def aliases_of_schema_1(machine: Mapping[str, Any]) -> dict[str, str]:
    """By the tables of a machine of schema 1: of the servomotor where its bearings are on both sides of a motor, of the stand
    where it has none."""
    return dict(_aliases(machine))


def _aliases(machine: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    bearings = {
        n: b for n, b in machine.get("bearings", {}).items() if isinstance(b, dict) and b.get("kind") == "radial"
    }
    if machine.get("motors"):
        yield from ((name, f"{kind}@{end}") for name, (kind, end) in BY_BEARING.items() if end in bearings)
        yield from (("peak_outboard", "peak@outboard"), ("peak_motor", "peak@motor"))
        return
    axes = [axis for b in bearings.values() for axis in b.get("axes", ())]
    yield from ((f"{kind}_{axis}", f"{kind}@{axis}") for kind in BY_AXIS for axis in axes)
    yield from ((name, f"{kind}@{c}") for name, (kind, c) in BY_COORDINATE.items()) if axes else ()
