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
        raise TomlError(f"not TOML: {error}") from error
    except RecursionError:
        raise TomlError(_too_deep(_deepest_line(text))) from None
    _look_down(data)
    return data


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
