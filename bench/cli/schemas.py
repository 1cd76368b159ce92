"""`bench schema`: JSON schemas of the files that people write, for editors. They help to type; `bench check` judges.

Made from the models that read the files. What each key is comes from `bench/keys.toml`, of a plan from its `settings.toml`.
Rig files may be based on another one, so that of them no key is required.
"""

from __future__ import annotations

import difflib
import json
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bench import catalogue, units
from bench.cli.loading import load_procedure
from bench.errors import BenchError, ConfigError
from bench.plan import BenchPlan
from bench.procedure.described import settings_of

Schema = dict[str, Any]
DIALECT = "https://json-schema.org/draft/2020-12/schema"
FILES = ("rig", "spec", "campaign")
PLAN = "plan-"
WHOLE = ("Toleranced", "Certificate")  # tables that replace a base's as a whole: what they need, they need in each file
OURS = ("toml_text", "dbc_text", "path", "written_in")  # of a rig file that was read, not of the file


def kinds() -> list[str]:
    """What there is a schema of: rig files, specs, campaigns, and the plan of each procedure."""
    return [*FILES, *(PLAN + entry.name for entry in catalogue.procedures())]


def schema_command(kind: str, into: Path | None) -> int:
    """Write one schema on standard output, or all into a folder.

    Raises:
        ConfigError: there is no such schema, or a file where the folder would be.
        BenchError: the folder cannot be written.
    """
    if kind and into is None:
        sys.stdout.write(text_of(kind))
        return 0
    folder = into or Path("schemas")
    if folder.exists() and not folder.is_dir():
        raise ConfigError(
            f"--into {folder}: found a file; expected a folder, or a name that is free. Next: give another"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in [kind] if kind else kinds():
            (folder / f"{name}.schema.json").write_text(text_of(name), encoding="utf-8")
    except OSError as error:
        raise BenchError(
            f"{folder}: cannot be written: {error.strerror or error}. Next: give another --into"
        ) from error
    sys.stderr.write(f"first line of a rig file beside it: #:schema {folder.name}/rig.schema.json\n")
    sys.stdout.write(f"{folder}\n")
    return 0


def text_of(kind: str) -> str:
    """A schema as it is written.

    Raises:
        ConfigError: there is none of that kind.
    """
    return json.dumps({"$schema": DIALECT, **schema_of(kind)}, indent=1, ensure_ascii=False) + "\n"


def schema_of(kind: str) -> Schema:
    """The schema of a kind of file.

    Raises:
        ConfigError: there is none of that kind.
    """
    if kind == "rig":
        return _of_rig()
    if kind == "spec":
        return _of_spec()
    if kind == "campaign":
        from bench.campaign.file import Campaign

        return _described(Campaign.model_json_schema())
    if kind.startswith(PLAN):
        return _of_plan(load_procedure(kind.removeprefix(PLAN)).plan)
    known = kinds()
    near = difflib.get_close_matches(kind, known, 3) or [*FILES, f"{PLAN}PROCEDURE"]
    raise ConfigError(
        f"found no schema {kind!r}; expected one of {', '.join(near)} (of {len(known)}). Next: `bench schema` writes all"
    )


def _of_rig() -> Schema:
    from bench.rigfile import RigFile

    schema = RigFile.model_json_schema()
    for name in OURS:
        schema["properties"].pop(name)
    schema["properties"] |= {"based_on": {"type": "string"}, "without": {"type": "array", "items": {"type": "string"}}}
    schema["required"] = ["schema", "name"]
    for name, table in schema["$defs"].items():
        if name not in WHOLE:
            table.pop("required", None)
    return _described(schema)


def _of_spec() -> Schema:
    from bench.record.specs import LIMIT_MODEL

    limit = LIMIT_MODEL.model_json_schema()
    defs = {**limit.pop("$defs"), "Limit": limit}
    by_name = {"type": "object", "additionalProperties": {"$ref": "#/$defs/Limit"}}
    procedures = {entry.name: {**by_name, "description": entry.about} for entry in catalogue.PROCEDURES}
    limits = {"type": "object", "properties": procedures, "additionalProperties": by_name}
    properties = {"schema": {"type": "integer"}, "limits": limits}
    return _described({"title": "Spec", "type": "object", "properties": properties, "required": ["schema"],
                       "additionalProperties": False, "$defs": defs})  # fmt: skip


def _of_plan(plan: type[BenchPlan]) -> Schema:
    """With each setting in the other units that its name may end with, too."""
    schema = _described(plan.model_json_schema())
    words = settings_of(plan)
    properties: Schema = {"schema": {"const": 1, "description": "of plan files"}}
    for name, value in schema["properties"].items():
        properties[name] = {**value, "description": words[name]} if name in words else value
        properties |= {key: _loose(value, f"{name} in {unit}") for key, unit in _in_other_units(name)}
    return {**schema, "title": "Plan", "properties": properties, "required": ["schema"]}


def _in_other_units(name: str) -> Iterator[tuple[str, str]]:
    """The names that a setting may have with another unit of its kind at their ends, and that unit."""
    try:
        base, _, si = units.split_suffix(name)
    except ConfigError:
        return
    for suffix, symbol in units.SUFFIXES.items():
        known = units.unit(symbol)
        if known.si == si and not known.offset and f"{base}_{suffix}" != name:
            yield f"{base}_{suffix}", symbol


def _loose(value: Schema, description: str) -> Schema:
    """Without bounds and default, which are of the SI unit."""
    drop = ("default", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "description")
    kept = {k: v for k, v in value.items() if k not in drop}
    if "items" in kept:
        kept["items"] = _loose(kept["items"], "")
    if kept.get("type") == "integer":
        kept["type"] = "number"
    return {**kept, "description": description} if description else kept


def _described(schema: Schema) -> Schema:
    """With what each key is, and without what TOML has not: null, and titles that only repeat a key."""
    words: Mapping[str, Mapping[str, str]] = tomllib.loads(_keys())
    tables = {schema.get("title", ""): schema, **schema.get("$defs", {})}
    for name, table in tables.items():
        known = words.get(name, {})
        for key, value in table.get("properties", {}).items():
            plain = _plain(value)
            table["properties"][key] = {**plain, "description": known[key]} if key in known else plain
    return schema


def _keys() -> str:
    return (Path(__file__).resolve().parents[1] / "keys.toml").read_text(encoding="utf-8")


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if not isinstance(value, dict):
        return value
    default = value.get("default", 0)
    dropped = ("title", "default") if default is None or isinstance(default, dict) else ("title",)
    kept = {k: _plain(v) for k, v in value.items() if k not in dropped}
    some = [v for v in kept.get("anyOf", []) if v != {"type": "null"}]
    if "anyOf" in kept and len(some) == 1:
        kept = {**some[0], **{k: v for k, v in kept.items() if k != "anyOf"}}
    elif some:
        kept["anyOf"] = some
    return kept
