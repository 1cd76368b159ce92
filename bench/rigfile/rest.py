"""A rig file that breaks the types, as far as it can be read: what is at fault is left out, what must be there is stood in for,
so that everything else that is wrong is told at once."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from bench.errors import Problem
from bench.inputfile import DEPTH, parse_toml
from bench.rigfile.elements import FORMS
from bench.rigfile.model import RigFile
from bench.rigfile.text import RigText, migrated

_SURE = {"half_width": 0, "distribution": "rectangular", "source": "stands in"}
STAND_INS: Mapping[str, Any] = {
    "name": "rig", "title": "", "uut": {"model": "", "serial": ""}, "links": {}, "devices": {}, "channels": {},
    "parameters": {}, "geometry": {}, "sensors": {},
    "site": {"place": "", "latitude_deg": 45.0, "elevation_m": 0.0, "gravity": {"value": 9.81, "unit": "m/s^2", **_SURE},
             "air_density": {"value": 1.2, "unit": "kg/m^3", **_SURE}},
    "mass_density": {"value": 8000, "unit": "kg/m^3", **_SURE}, "hanger": {"value": 1e-3, "unit": "kg", **_SURE},
    "hook_seat": {"value": 0, "unit": "m", **_SURE},
    "envelope": {"max_hung_kg": 1e9},
}  # fmt: skip
"""What must be there: values that no other check objects to."""
TABLES = ("uut", "site", "envelope")
"""Of these, the tables of which single entries may be at fault."""
Content = dict[str, Any]


def rest_of(text: RigText, problems: tuple[Problem, ...]) -> RigFile | None:
    """The rig file without what the problems are about, and without what cannot be without that; None where that cannot be told
    apart from the rest."""
    left: Content = copy.deepcopy(migrated(parse_toml(text.toml), str(text.path)))
    keys = [p.key.split(".") for p in problems]
    for _ in range(DEPTH):
        left = _filled(_without(left, keys))
        try:
            return RigFile.model_validate(
                {**left, "toml_text": text.toml, "dbc_text": text.dbc, "path": str(text.path)}
            )
        except ValidationError as error:
            keys = [_at_fault(e) for e in error.errors(include_url=False)]
    return None


def follows(p: Problem, problems: tuple[Problem, ...]) -> bool:
    """Whether a problem of the rest is one of those before, or may be there only because something was left out."""
    keys = [other.key for other in problems]
    entries = {_entry(other.key) for other in problems if other.expected != "no such key"}
    gravity = p.key.startswith("site.") and any(key.startswith("site.") for key in keys)  # judged by the latitude
    for_device = p.expected.startswith("a URL for") and any(e.endswith((".link", ".roles")) for e in entries)
    refers = p.found.strip("'").replace("/", ".") in entries  # to a number that was left out
    return p.key in keys or _entry(p.key) in entries or gravity or for_device or refers


def _entry(key: str) -> str:
    """What is read and understood as one: `channels.NAME`, `devices.NAME.link`, `devices.NAME.registers.NAME`."""
    parts = key.split(".")
    depth = 2 if parts[0] != "devices" else 4 if parts[2:3] == ["registers"] else 3
    return ".".join(parts[:depth])


def _at_fault(error: Mapping[str, Any]) -> list[str]:
    """Where to cut: at the key, or where one is missing at the table that lacks it."""
    path = [str(part) for part in error["loc"] if part not in FORMS]
    return path[:-1] if error["type"] == "missing" else path


def _without(data: Content, keys: list[list[str]]) -> Content:
    """Entries taken out; of a list, the whole list."""
    for path in keys:
        table: Any = data
        for key in path[:-1]:
            found = table.get(key)
            if not isinstance(found, dict):
                path = [*path[: path.index(key)], key]
                break
            table = found
        table.pop(path[-1] if path else "", None)
    return data


def _filled(data: Content) -> Content:
    for key, stand_in in STAND_INS.items():
        found = data.setdefault(key, copy.deepcopy(stand_in))
        if key in TABLES and isinstance(found, dict):
            for name, value in stand_in.items():
                found.setdefault(name, copy.deepcopy(value))
    link = next(iter(data["links"]), "")
    for device in data["devices"].values():
        device.setdefault("link", link)
        device.setdefault("roles", [])
    return data
