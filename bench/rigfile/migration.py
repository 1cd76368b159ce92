"""Rig files of schema 1 as schema 2 has them: what their closed list of names meant is written out.

Schema 1 knew two machines by the names of their numbers and channels. Numbers stay where they are, so that each keeps its
identity (`geometry/amb_span`); the tables of the machine refer to them. What schema 1 did not say is left out.
"""

from __future__ import annotations

from typing import Any

from bench.rigfile.former_plans import plans_of_schema_1
from bench.rigfile.people import typed_laboratory

Content = dict[str, Any]
ENDS = {"inboard": "i", "outboard": "o"}
SPANS = {
    "com_to_inboard_amb": ("centre_of_mass", "bearings/inboard"),
    "motor_to_outboard_amb": ("motors/motor", "bearings/outboard"),
}
"""Lengths of schema 1 that are stated beside the places that follow from others."""


def to_schema_2(data: Content) -> Content:
    """The content of a rig file of schema 1 with the tables of its machine; those that it has already are its own."""
    g, m, channels = (_table(data, name) for name in ("geometry", "machine", "channels"))
    made: Content = {"shaft": _shaft(m)}
    made["bearings"] = _bearings(g, m, {**_table(_table(data, "capture"), "channels"), **channels})
    made["probes"] = _probes(g, channels)
    made["mark"] = {key: key for key in ("angle", "speed", "pulses") if key in channels}
    made["rings"] = _rings(g)
    made["balancing"] = _balancing(g, m)
    made["coupling"] = _coupling(g, m)
    made["hooks"] = _hooks(g)
    made["levers"] = {side: {"length": f"geometry/lever_{side}", "side": sign}
                      for side, sign in (("left", 1), ("right", -1)) if f"lever_{side}" in g}  # fmt: skip
    made["motors"] = _motors(g, m, channels)
    placed = {
        f"{table}/{name}" for table in ("bearings", "motors") for name, part in made[table].items() if "at" in part
    }
    made["spans"] = {f"geometry/{name}": pair for name, pair in SPANS.items()
                     if name in g and placed.issuperset(p for p in pair if "/" in p)}  # fmt: skip
    people = (
        {"laboratory": typed_laboratory(_table(data, "laboratory"))} if isinstance(data.get("laboratory"), dict) else {}
    )
    return {**{name: table for name, table in made.items() if table}, **data, **people, **plans_of_schema_1(data)}


def _table(data: Content, name: str) -> Content:
    found = data.get(name)
    return found if isinstance(found, dict) else {}


def _shaft(m: Content) -> Content:
    kept = ("mass", "polar_inertia", "transverse_inertia", "runout")
    return {"near_end": "inboard", "far_end": "outboard", **{key: f"machine/{key}" for key in kept if key in m}}


def _letters(channels: Content) -> tuple[str, str, str]:
    """The radial axes and the axial one: y, z and x on the AMB stand, y, x and z on the servomotor."""
    stand = any(name in channels for name in ("pos_zi", "pos_zo", "i_zi_p", "i_zo_p"))
    return ("y", "z", "x") if stand else ("y", "x", "z")


def _bearings(g: Content, m: Content, channels: Content) -> Content:
    """Two radial ones; the axial one where its coils are read."""
    first, second, axial = _letters(channels)
    out: Content = {}
    for end, letter in ENDS.items():
        axes = {f"{a}{letter}": {**_direction(end, a, first, second, m), **_coils(f"{a}{letter}", channels)}
                for a in (first, second) if f"i_{a}{letter}_p" in channels}  # fmt: skip
        if axes and f"com_to_{end}_amb" in g:
            out[end] = {"kind": "radial", "at": _at_bearing(end, g), "axes": axes, **_refer("gap", "geometry/amb_gap", g),
                        **_refer("asymmetry", "machine/amb_asymmetry", m),
                        **({"voltage": f"u_{letter}"} if f"u_{letter}" in channels else {})}  # fmt: skip
    if f"i_{axial}_p" in channels:
        out["axial"] = {"kind": "axial", "axes": {axial: _coils(axial, channels)},
                        **_refer("gap", "geometry/axial_gap", g),
                        **({"voltage": f"u_{axial}"} if f"u_{axial}" in channels else {})}  # fmt: skip
    return out


def _at_bearing(end: str, g: Content) -> Any:
    """The outboard plane by the centre of mass, the inboard one by the span between them, which is certified."""
    if end == "inboard" and "amb_span" in g and "com_to_outboard_amb" in g:
        return {"from": "bearings/outboard", "by": "-geometry/amb_span"}
    return f"{'-' if end == 'inboard' else ''}geometry/com_to_{end}_amb"


def _direction(end: str, axis: str, first: str, second: str, m: Content) -> Content:
    """Both axes of a plane are one part, turned from the vertical as a whole."""
    if axis == second:
        return {"direction": {"of": f"bearings/{end}/{first}{ENDS[end]}", "plus_deg": 90 if second == "z" else -90}}
    if "radial_axes" in m:
        return {"direction": "-machine/radial_axes"}
    lean = -45 if second == "z" else 0
    return {"direction": {"value": lean, "unit": "deg", "half_width": 0, "distribution": "rectangular",
                          "source": "schema 1", "id": "machine/radial_axes"}} if end == "inboard" else {
        "direction": {"of": f"bearings/inboard/{first}i", "plus_deg": 0}}  # fmt: skip


def _coils(axis: str, channels: Content) -> Content:
    found = {key: tuple(f"{kind}_{axis}_{side}" for side in "pn") for key, kind in (("coils", "i"), ("voltages", "u"))}
    return {key: pair for key, pair in found.items() if all(name in channels for name in pair)}


def _probes(g: Content, channels: Content) -> Content:
    first, second, axial = _letters(channels)
    out: Content = {}
    for end, letter in ENDS.items():
        place = f"{'-' if end == 'inboard' else ''}geometry/com_to_{end}_sensor"
        for a in (first, second):
            if f"pos_{a}{letter}" in channels and f"com_to_{end}_sensor" in g:
                of = {"of": f"bearings/{end}/{a}{letter}", "plus_deg": 0}
                turned = {"direction": of} if f"i_{a}{letter}_p" in channels and f"com_to_{end}_amb" in g else {}
                out[f"{a}{letter}"] = {"channel": f"pos_{a}{letter}", "at": place, **turned}
    if f"pos_{axial}" in channels:
        out[axial] = {"channel": f"pos_{axial}"}
    return out


def _rings(g: Content) -> Content:
    if "clearance" not in g:
        return {}
    return {end: {"clearance": "geometry/clearance"} for end in ENDS if f"com_to_{end}_amb" in g}


def _balancing(g: Content, m: Content) -> Content:
    if "balance_radius" not in g:
        return {}
    known = {**_refer("weight_mass", "machine/weight_mass", m), **_refer("weight_angle", "machine/weight_angle", m)}
    return {end: {"at": f"{'-' if end == 'inboard' else ''}geometry/com_to_{end}_balance",
                  "radius": "geometry/balance_radius", **known} for end in ENDS if f"com_to_{end}_balance" in g}  # fmt: skip


def _coupling(g: Content, m: Content) -> Content:
    if "com_to_coupling" not in g:
        return {}
    return {"at": "-geometry/com_to_coupling", **_refer("stiffness", "geometry/coupling_stiffness", g),
            **_refer("offset", "machine/coupling_offset", m)}  # fmt: skip


def _hooks(g: Content) -> Content:
    if "hook_to_outboard" not in g or "com_to_outboard_amb" not in g:
        return {}
    return {"hook": {"at": {"from": "bearings/outboard", "by": "geometry/hook_to_outboard"}}}


def _motors(g: Content, m: Content, channels: Content) -> Content:
    if "com_to_motor" not in g:
        return {}
    currents = [name for name in (f"i_m{n}" for n in range(1, 13)) if name in channels]
    return {"motor": {"kind": "self-bearing", "at": "geometry/com_to_motor", "currents": currents,
                      "gives": ["torque", "radial force"], **_refer("stiffness", "geometry/motor_stiffness", g),
                      **_refer("pole_pairs", "machine/pole_pairs", m)}}  # fmt: skip


def _refer(key: str, identity: str, numbers: Content) -> Content:
    return {key: identity} if identity.partition("/")[2] in numbers else {}
