"""A shipped rig as another laboratory would write it: every channel and parameter under another name."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.rigfile.tomltext import to_toml

RIGS = Path(__file__).resolve().parent.parent / "rigs"
KEPT = ("state", "fault")  # the bench watches these two by its own names
KEPT_KEYS = ("loop", "unit", "source")  # strings that may be spelled like a channel and are none
BY_CHANNEL = ("coils", "bridges", "still")  # tables of [capabilities] whose keys are channels
Names = Mapping[str, str]


def named_otherwise(rig: str, folder: Path) -> str:
    """The rig file in a folder, beside the rig's DBC: channels are called `k1`, `k2`, ..., parameters `p1`, `p2`, ...; what is
    said to a command line, and the bits of the messages, are as they were."""
    table = tomllib.loads((RIGS / f"{rig}.toml").read_text(encoding="utf-8"))
    captured = table["capture"]["channels"]
    channels = {n: f"k{k}" for k, n in enumerate(dict.fromkeys((*table["channels"], *captured)), 1) if n not in KEPT}
    parameters = {n: f"p{k}" for k, n in enumerate(table["parameters"], 1)}
    inside = {channels[n]: n for n in captured if n not in table["channels"]}
    if "commandline" in table:
        _spoken(table["commandline"], channels, parameters, captured)
    for holder, names in ((table, channels), (table["capture"], channels)):
        holder["channels"] = _keys(holder["channels"], names)
    table |= {"sensors": _keys(table["sensors"], channels), "parameters": _keys(table["parameters"], parameters)}
    table["mark"] = {"speed": channels["speed"]}
    table["capabilities"] = _values(table["capabilities"], channels, {**parameters, **channels})
    table["envelope"] = _values(table["envelope"], channels, channels)
    for kind in ("motors", "probes", "encoders"):
        for part in table.get(kind, {}).values():
            part |= {key: _values(part[key], channels, channels) for key in ("channel", "currents") if key in part}
    table["simulation"]["readings"] = inside
    (folder / f"{rig}.dbc").write_bytes((RIGS / f"{rig}.dbc").read_bytes())
    path = folder / f"{rig}.toml"
    path.write_text(to_toml(table), encoding="utf-8")
    return str(path)


def _keys(table: Mapping[str, Any], names: Names) -> dict[str, Any]:
    return {names.get(key, key): value for key, value in table.items()}


def _values(value: Any, channels: Names, names: Names) -> Any:
    """With each string that is a name called otherwise, and each key of a number, which is a parameter's, and of BY_CHANNEL."""
    if isinstance(value, str):
        return names.get(value, value)
    if isinstance(value, list):
        return [_values(v, channels, names) for v in value]
    if not isinstance(value, dict):
        return value
    out = {}
    for key, v in value.items():
        numbers = isinstance(v, dict) and v and all(isinstance(x, int | float) for x in v.values())
        by_channel = isinstance(v, dict) and key in BY_CHANNEL
        inner = _keys(v, channels if by_channel else names) if numbers or by_channel else v
        out[key] = v if key in KEPT_KEYS else _values(inner, channels, names)
    return out


def _spoken(line: dict[str, Any], channels: Names, parameters: Names, captured: Mapping[str, Any]) -> None:
    """Said to the firmware as it was."""

    def said(text: Any) -> Any:
        return (
            re.sub(r"\{([\w.]+)\}", lambda m: f"{{{parameters.get(m[1], m[1])}}}", text)
            if isinstance(text, str)
            else text
        )

    own = line["spoken"]
    line["spoken"] = {
        new: {key: said(text) for key, text in own[name].items()} if name in own
        else {"set": f"set {name} {{value}}", "get": f"get {name}"}
        for name, new in parameters.items()
    }  # fmt: skip
    line["capture"]["called"] = {channels[name]: name for name in captured}
