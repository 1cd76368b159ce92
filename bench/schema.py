"""What our files are held against: the schema number of JSON files, and what a refused value should have been."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict

from bench.errors import ConfigError

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
"""Of what we write ourselves: no unknown key, no number for a text."""

NAME = r"^[^\W\d_][\w-]*$"
"""What parts of a machine and the like may be called in a rig file."""


def require_schema(text: str, name: str, kind: str, schema: int, oldest: int | None = None) -> None:
    """See that `text` is JSON without NaN and of this schema, or from the `oldest` that is read on; `name` and `kind` (such as
    "record") stand in the messages.

    Raises:
        ConfigError: it is not, or was written by a newer Levbench.
    """
    try:
        content = json.loads(text)
        json.dumps(content, allow_nan=False)  # json.loads takes NaN, Infinity and 1e999
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{name}: not a {kind}: {error}; expected JSON without NaN or Infinity") from error
    found = content.get("schema") if isinstance(content, dict) else None
    if type(found) is not int:
        raise ConfigError(f"{name}: not a {kind}: found no schema number; expected schema = {schema}")
    if not (oldest or schema) <= found <= schema:
        newer = " It was written by a newer Levbench. Next: update this one" if found > schema else ""
        raise ConfigError(f"{name}: schema: found {found}; expected {schema}.{newer}")


def expected_of(error: Mapping[str, Any]) -> str:
    """What one of pydantic's errors (an entry of `ValidationError.errors()`) expects, in our words."""
    count = error.get("ctx", {})
    match error["type"]:
        case "missing":
            return "a value"
        case "extra_forbidden":
            return "no such key"
        case "too_short":
            return f"at least {_counted(count['min_length'], 'entry', 'entries')}"
        case "too_long":
            return f"at most {_counted(count['max_length'], 'entry', 'entries')}"
        case "model_type":
            return "a table, as in { key = 1 }"
        case "tuple_type":
            return "a list, as in [1, 2]"
        case "string_too_short":
            return f"at least {_counted(count['min_length'], 'character', 'characters')}"
        case "string_pattern_mismatch" if count["pattern"] == NAME:
            return "a name: a letter, then letters, digits, _ or -"
    return str(error["msg"]).removeprefix("Input should be ").removeprefix("Value error, ").removeprefix("expected ")


def _counted(number: int, one: str, more: str) -> str:
    return f"{number} {one if number == 1 else more}"
