"""The schema number of our JSON files: read before anything else of them."""

from __future__ import annotations

import json

from bench.errors import ConfigError


def require_schema(text: str, name: str, kind: str, schema: int) -> None:
    """See that `text` is JSON without NaN and of this schema; `name` and `kind` (such as "record") stand in the messages.

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
    if found != schema:
        newer = " It was written by a newer Levbench." if found > schema else ""
        raise ConfigError(f"{name}: schema: found {found}; expected {schema}.{newer}")
