"""Names of quantities that had their place in them, for a rig file that does not say what it calls them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Content = dict[str, Any]
ENDS = ("inboard", "outboard")
BY_BEARING = {f"{kind}_{end[0]}": f"{kind}@{end}" for kind in ("K", "K2", "Kw", "F0", "hanger") for end in ENDS}
OF_MOTOR = {"peak_outboard": "peak@outboard", "peak_motor": "peak@motor"}
AXES = ("yi", "zi", "yo", "zo")
BY_AXIS = {f"{kind}_{axis}": f"{kind}@{axis}" for kind in ("beta", "offset") for axis in AXES}
MOTIONS = ("error_peak", "error_rms", "amplitude_ratio", "phase_lag")
BY_COORDINATE = {
    **{f"{kind}_{c}": f"{kind}@{c}" for kind in MOTIONS for c in "yz"},
    **{f"tilt_{c}": f"tilt@{c}" for c in ("psi", "theta")},
}


def with_aliases(data: Content) -> Content:
    """The content of a rig file of schema 2; where it has no table `aliases` and its parts are called as those of the
    servomotor or of the AMB stand, one with the names that results had then."""
    return data if "aliases" in data else {**data, "aliases": dict(_aliases(data))}


def _aliases(data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    found = data.get("bearings")
    bearings = found if isinstance(found, dict) else {}
    axes = {axis for b in bearings.values() if isinstance(b, dict) for axis in b.get("axes", ())}
    if axes >= {*AXES}:
        yield from BY_AXIS.items()
        yield from BY_COORDINATE.items()
    elif bearings.keys() >= {*ENDS}:
        yield from BY_BEARING.items()
        yield from OF_MOTOR.items() if "motor" in data.get("motors", ()) else ()
