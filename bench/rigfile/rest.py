"""A rig file that breaks the types, as far as it can be read: what is at fault is left out, what must be there is stood in for,
so that everything else that is wrong is told at once."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from bench.errors import Problem
from bench.inputfile import parse_toml
from bench.rigfile.model import RigFile
from bench.rigfile.text import RigText, migrated

_SURE = {"half_width": 0, "distribution": "rectangular", "source": "stands in"}
STAND_INS: Mapping[str, Any] = {
    "name": "rig", "title": "", "uut": {"model": "", "serial": ""}, "links": {}, "devices": {}, "channels": {},
    "parameters": {}, "geometry": {}, "sensors": {},
    "site": {"place": "", "latitude_deg": 0.0, "elevation_m": 0.0, "gravity": {"value": 9.81, "unit": "m/s^2", **_SURE},
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
    """The rig file without what the problems are about; None where that cannot be told apart from the rest."""
    data = migrated(parse_toml(text.toml), str(text.path))
    cuts: tuple[Callable[[Content], Content], ...] = (
        lambda d: _without(d, [p.key.split(".") for p in problems]),
        lambda d: _without(d, [p.key.split(".")[:2] for p in problems if p.expected != "no such key"]),
    )
    left = copy.deepcopy(data)
    for cut in cuts:
        left = _filled(cut(left))
        try:
            return RigFile.model_validate(
                {**left, "toml_text": text.toml, "dbc_text": text.dbc, "path": str(text.path)}
            )
        except ValidationError:
            continue
    return None


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
        table.pop(path[-1], None)
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
