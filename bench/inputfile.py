"""Text files that somebody else may have written: regular files of a bounded size, and TOML of a bounded depth."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any, Final

DEPTH: Final = 32
"""Tables and lists within one another, and parts of a dotted key."""
_KEY: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY: Final = re.compile(rf"(?<![\w-]){_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{DEPTH}}}")
_SHOWN: Final = 40
_AT: Final = re.compile(r"at line (\d+), column (\d+)")
_OF_KEYS: Final = ("Expected ']'", "Expected '='", "Invalid initial character for a key", "Invalid statement")
"""How the parser's words begin where a key is at fault, or the header of a table."""


class TomlError(ValueError):
    """A text is not TOML, or is nested too deep; says so in words."""


def read_regular(path: Path, most: int) -> bytes:
    """The bytes of a regular file: a device or a pipe would never end, and nobody waits for one.

    Raises:
        OSError: it cannot be read, is no regular file, or has more than `most` bytes.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(0, "found no regular file; expected one")
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(0, f"found more than {most} bytes; expected a smaller file")
    return data


def decoded(data: bytes, encoding: str) -> str:
    """The text of a file's bytes, its lines ended as Python's are.

    Raises:
        UnicodeError: they are not of that encoding.
        LookupError: there is no such encoding.
    """
    return data.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")


def parse_toml(text: str) -> dict[str, Any]:
    """A TOML document nested no deeper than DEPTH: what reads it further may take each level by a call of its own.

    Raises:
        TomlError: it is none, or is nested deeper; the key at fault stands in the text.
    """
    if found := _DEEP_KEY.search(text):
        raise TomlError(_too_deep(found[0]))
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f"not TOML: {error}{_in_quotes(text, str(error))}") from error
    except RecursionError:
        raise TomlError(_too_deep(_deepest_line(text))) from None
    _look_down(data)
    return data


def _in_quotes(text: str, error: str) -> str:
    """What to do about a key with a letter that has none of its own in TOML: `arrière`; nothing of any other error."""
    at = _AT.search(error)
    if at is None or not error.startswith(_OF_KEYS):
        return ""
    line, column = text.split("\n")[int(at[1]) - 1], int(at[2]) - 1
    if column >= len(line) or line[column].isascii() or not line[column].isalnum():
        return ""
    begin = re.search(r"[\w-]*$", line[:column])
    end = re.match(r"[\w-]*", line[column:])
    assert begin is not None
    assert end is not None
    return f'; a name with other letters than A-Z, a-z, 0-9, _ and - is put in quotes: "{begin[0]}{end[0]}"'


def _too_deep(key: str) -> str:
    return f"{key[:_SHOWN]}{'...' if len(key) > _SHOWN else ''}: found more than {DEPTH} levels; expected fewer"


def _deepest_line(text: str) -> str:
    """The key whose line opens the most brackets."""
    line = max(text.splitlines(), key=lambda x: x.count("[") + x.count("{"))
    return line.partition("=")[0].strip()


def _look_down(data: dict[str, Any]) -> None:
    """Level by level, not by calls."""
    level: list[tuple[str, Any]] = list(data.items())
    for _ in range(DEPTH):
        within: list[tuple[str, Any]] = []
        for key, value in level:
            if isinstance(value, dict):
                within += [(f"{key}.{name}", x) for name, x in value.items()]
            elif isinstance(value, list):
                within += [(key, x) for x in value]
        level = within
    if level:
        raise TomlError(_too_deep(level[0][0]))
