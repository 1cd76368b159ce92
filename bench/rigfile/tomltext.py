"""The TOML of a rig file: read from its file, parsed, and written anew where several files were laid over each other."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from bench.errors import ConfigError
from bench.inputfile import TomlError, decoded, parse_toml, read_regular

MOST_TOML: Final = 1 << 20
"""Bytes of a rig file."""
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(path: Path) -> str:
    """The text of a rig file.

    Raises:
        ConfigError: it cannot be read, is no regular file, is too large, or is not UTF-8.
    """
    try:
        return decoded(read_regular(path, MOST_TOML), "utf-8")
    except OSError as error:
        raise ConfigError(f"rig file {path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"rig file {path}: byte {error.start} is not UTF-8; expected TOML, which is UTF-8") from error


def parse_text(text: str, path: str) -> dict[str, Any]:
    """TOML of a rig file.

    Raises:
        ConfigError: it is not.
    """
    try:
        return copy.deepcopy(_parsed(text))
    except TomlError as error:
        raise ConfigError(f"rig file {path}: {error}") from error


@lru_cache(maxsize=8)
def _parsed(text: str) -> dict[str, Any]:
    """A file is looked at before it is read as a rig file; to copy what it says takes far less than to parse it again."""
    return parse_toml(text)


def to_toml(data: Mapping[str, Any]) -> str:
    """A TOML document of the data, as the parser has it; the order of keys within each table is kept."""
    values = {k: v for k, v in data.items() if not isinstance(v, dict)}
    lines = [f"{_key(k)} = {_value(v)}" for k, v in values.items()]
    for name, table in data.items():
        if isinstance(table, dict):
            lines += _table(_key(name), table)
    return "\n".join(lines) + "\n"


def _table(header: str, table: Mapping[str, Any]) -> Iterator[str]:
    """A table under its header. Of the tables in it, those at its end have headers of their own from the first deep one on:
    an inline one stands in one line, and no value may follow a header."""
    items = list(table.items())
    values = [n for n, (_, v) in enumerate(items) if not isinstance(v, dict)]
    after = values[-1] + 1 if values else 0
    deep = [n for n in range(after, len(items)) if any(isinstance(v, dict) for v in items[n][1].values())]
    first = deep[0] if deep else len(items)
    yield from ("", f"[{header}]")
    yield from (f"{_key(k)} = {_value(v)}" for k, v in items[:first])
    for name, within in items[first:]:
        yield from _table(f"{header}.{_key(name)}", within)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        inside = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    return repr(value) if isinstance(value, int | float) else str(value.isoformat())  # else a date, a time, or both


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    """JSON's escapes are TOML's too; the delete character, which TOML forbids, JSON leaves as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
