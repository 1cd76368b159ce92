"""One machine described in other ways: a rig file, rewritten so that it means the same shaft, bearings, probes and weights."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

Table = dict[str, Any]
PLACED = ("bearings", "probes", "rings", "balancing", "hooks", "levers", "motors")


def written(rig: str, folder: Path, change: Callable[[Table], None]) -> str:
    """A rig file with exact places and angles, changed, beside its DBC in a folder: what is drawn is drawn as before."""
    path = Path(rig)
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    _exact(table)
    change(table)
    folder.mkdir(exist_ok=True)
    for dbc in path.parent.glob("*.dbc"):
        (folder / dbc.name).write_bytes(dbc.read_bytes())
    (folder / path.name).write_text(
        "".join(f"{key} = {_toml(value)}\n" for key, value in table.items()), encoding="utf-8"
    )
    return str(folder / path.name)


def as_it_is(table: Table) -> None:
    """The same, with exact places and angles."""


def from_another_mark(degrees: float) -> Callable[[Table], None]:
    """Directions count from a mark that stands so many degrees further back."""

    def change(table: Table) -> None:
        for holder, key in _directions(table):
            _add(holder, key, degrees)
        if not _stands(table):
            table["shaft"]["zero_at"] = "a mark"
            table["shaft"]["up"] = _angle(degrees)

    return change


def from_the_other_end(table: Table) -> None:
    """What was near is far: places turn their sign, and what turned one way turns the other."""
    shaft = table["shaft"]
    shaft["near_end"], shaft["far_end"] = shaft["far_end"], shaft["near_end"]
    shaft["sense"] = -shaft.get("sense", 1)
    for key in ("centre_of_mass", "tilt", "up"):
        if key in shaft:
            shaft[key] = _negative(shaft[key])
    shaft["ends"] = [_negative(end) for end in reversed(shaft.get("ends", []))] or shaft.pop("ends", None)
    for name in PLACED:
        for part in table.get(name, {}).values():
            if "at" in part:
                part["at"] = _negative(part["at"])
    for holder, key in _directions(table, fixed=True):
        holder[key] = _negative(holder[key])
    for bearing in table["bearings"].values():
        if bearing["kind"] == "axial":
            _turned_round(next(iter(bearing["axes"].values())))
    for probe in table["probes"].values():
        if "direction" not in probe:
            probe["sign"] = -probe.get("sign", 1)


def with_a_bearing_turned(name: str) -> Callable[[Table], None]:
    """The axes of a bearing in the other order, the first of them half a turn round; its probes as they were, but that the one
    beside that axis counts backwards along it."""

    def change(table: Table) -> None:
        bearing = table["bearings"][name]
        one, other = bearing["axes"]
        first = bearing["axes"][one]
        turned = f"bearings/{name}/{one}"
        for probe in table["probes"].values():
            if probe.get("direction", {}).get("of") == turned:
                probe["sign"] = -1
        for holder, key in _directions(table, fixed=True):
            if holder[key].get("of") == turned and holder is bearing["axes"][other]:
                holder[key] = {"of": turned, "plus_deg": holder[key]["plus_deg"] - 180}
        _add(first, "direction", 180.0)
        _turned_round(first)
        bearing["axes"] = {other: bearing["axes"][other], one: first}

    return change


def _turned_round(axis: Table) -> None:
    """Its other side is the positive one."""
    for key in ("coils", "voltages"):
        if key in axis:
            axis[key] = axis[key][::-1]


def _stands(table: Table) -> bool:
    tilt = table["shaft"].get("tilt", {"value": 0.0})
    return abs(abs(tilt["value"]) - 90) < 1e-9


def _directions(table: Table, *, fixed: bool = False) -> list[tuple[Table, str]]:
    """Where directions stand, those that count from another part's too where `fixed`."""
    holders = [a for b in table["bearings"].values() for a in b["axes"].values()]
    holders += [*table["probes"].values(), *table.get("motors", {}).values(), table.get("mark", {})]
    found = [(h, "direction") for h in holders if "direction" in h]
    found += [(h, "pull") for h in table.get("hooks", {}).values() if "pull" in h]
    return [(h, key) for h, key in found if fixed or "of" not in h[key]]


def _exact(table: Table) -> None:
    shaft = table["shaft"]
    numbers = [h[key] for h, key in _directions(table)] + [
        shaft[k] for k in ("centre_of_mass", "tilt", "up") if k in shaft
    ]
    numbers += [part["at"] for name in PLACED for part in table.get(name, {}).values() if "at" in part]
    numbers += list(shaft.get("ends", []))
    for number in [n.get("by", n) for n in numbers if not isinstance(n, str)]:
        if not isinstance(number, str):
            number["half_width"] = 0
    for probe in table["probes"].values():
        table["sensors"][probe["channel"]]["offset"]["half_width"] = 0
    table["simulation"] |= {
        "magnetic_offset": 0,
        "runout_2": 0,
        "runout_4": 0,
    }  # even orders look otherwise from behind


def _angle(degrees: float) -> Table:
    return {"value": degrees, "unit": "deg", "half_width": 0, "distribution": "rectangular", "source": "by definition"}


def _add(holder: Table, key: str, degrees: float) -> None:
    assert holder[key]["unit"] == "deg"
    holder[key] = {**holder[key], "value": math.remainder(holder[key]["value"] + degrees, 360.0)}


def _negative(stated: Any) -> Any:
    if isinstance(stated, str):
        return stated.removeprefix("-") if stated.startswith("-") else f"-{stated}"
    if "of" in stated:
        return {**stated, "plus_deg": -stated["plus_deg"]}
    if "from" in stated:
        return {**stated, "by": _negative(stated["by"])}
    return {**stated, "value": -stated["value"]}


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(f'"{k}" = {_toml(v)}' for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(value, str) else repr(value)
