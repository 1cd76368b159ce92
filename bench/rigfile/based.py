"""Rig files that are based on another one beside them: what a file says is laid over what its base says, key by key.

`without` takes keys of the base away first. A number with its tolerance (a table with `value`) is one value and replaces as
a whole: its width, its source and its unit belong to it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from bench.errors import ConfigError, Problem
from bench.rigfile.tomltext import MOST_TOML, parse_text, read_toml, to_toml

MOST_FILES: Final = 4
"""A file, its base, that one's base, and so on."""
OWN: Final = ("name", "title")
"""What each file says itself: calibrations, records and limits go by the name."""
Table = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Stated:
    """A value (no table) and the file that says it."""

    value: Any
    file: str


@dataclass(frozen=True)
class Merged:
    """A rig file laid over what it is based on, as one text. `files` are the file and its bases, `stated` has each value with
    its file, `problems` is what is wrong with how they are laid."""

    toml: str
    data: Table
    files: tuple[str, ...]
    stated: Table
    problems: tuple[Problem, ...] = ()

    def file_of(self, key: str) -> str:
        """The file in which a key stands, or what is nearest to it: of a table the last that says something in it."""
        found: Any = self.stated
        for part in key.split("."):
            if not isinstance(found, dict) or part not in found:
                break
            found = found[part]
        files = set(_files(found)) if found is not self.stated else set()
        return next((f for f in self.files if f in files), self.files[0])

    def attributed(self, problems: Iterable[Problem]) -> tuple[Problem, ...]:
        """The problems, each with the file in which its key stands. That of a plan has its table behind the file."""
        return tuple(self._attributed(p) for p in problems)

    def _attributed(self, p: Problem) -> Problem:
        table = p.file.removeprefix(self.files[0])
        if table and not (table != p.file and table.startswith(" [")):
            return p
        return replace(p, file=self.file_of(f"{table.strip(' []')}.{p.key}".strip(".")) + table)


def read_merged(path: Path) -> Merged:
    """A rig file with what it is based on. A file that is based on none keeps its text as it is.

    Raises:
        ConfigError: a file cannot be read or is not TOML; a base that is not beside its file, is based on the file itself, has
            another schema, or is one too many.
    """
    text = read_toml(path)
    data = parse_text(text, str(path))
    if "based_on" not in data:
        return Merged(text, data, (str(path),), {})
    files = [(path, data)]
    while "based_on" in files[-1][1]:
        files.append(_base(files))
    return _laid(files)


def over(base: Mapping[str, Any], own: Mapping[str, Any]) -> Table:
    """Two tables as one: tables in both are laid over each other, anything else of `own` replaces."""
    merged = dict(base)
    for key, value in own.items():
        below = base.get(key)
        if isinstance(value, dict) and isinstance(below, dict) and not (_one_value(value) or _one_value(below)):
            merged[key] = over(below, value)
        else:
            merged[key] = value
    return merged


def _one_value(table: Mapping[str, Any]) -> bool:
    """Whether a table is a number with its tolerance."""
    return not isinstance(table.get("value", {}), dict)


def _base(files: list[tuple[Path, Table]]) -> tuple[Path, Table]:
    path, data = files[-1]
    asked, place = data["based_on"], f"rig file {path}: based_on: found {data['based_on']!r}"
    if not isinstance(asked, str) or asked in ("", ".", "..") or "/" in asked or "\\" in asked or "\0" in asked:
        raise ConfigError(f'{place}; expected the name of a rig file beside this one, such as "tsbs12.toml"')
    base = path.with_name(asked)
    if base in (p for p, _ in files) or any(base.exists() and base.samefile(p) for p, _ in files):
        chain = " is based on ".join(p.name for p, _ in files)
        raise ConfigError(f"{place}, but {chain} already; expected a file that is not based on this one")
    if len(files) == MOST_FILES:
        raise ConfigError(f"{place}, one file more than {MOST_FILES}; expected fewer, each based on the next")
    if not base.exists():
        raise ConfigError(f"{place}, which is not there; expected a rig file beside this one ({base.parent})")
    below = parse_text(read_toml(base), str(base))
    if below.get("schema") != data.get("schema") or below.get("schema", 1) == 1:
        found = f"found {data.get('schema')!r} here and {below.get('schema')!r} in {base}"
        raise ConfigError(f"rig file {path}: schema: {found}; expected the same in both, 2 or newer")
    return base, below


def _laid(files: list[tuple[Path, Table]]) -> Merged:
    """Files from the derived one to the last base, as one."""
    problems: list[Problem] = []
    merged: Table = {}
    for path, data in reversed(files):
        own = {k: v for k, v in data.items() if k not in ("based_on", "without")}
        if merged:
            problems += _unnamed(str(path), own, merged)
        problems += _taken_away(str(path), data.get("without", []), merged)
        merged = over(merged, _stated(own, str(path)))
    data = _plain(merged)
    chain = ", then ".join(ascii(p.name) for p, _ in files[1:])
    text = f"# One text of several files: what the rig file says itself, over {chain}.\n\n{to_toml(data)}"
    path = files[0][0]
    if len(text.encode()) > MOST_TOML:
        raise ConfigError(f"rig file {path}: based_on: found more than {MOST_TOML} bytes together; expected fewer")
    return Merged(text, data, tuple(str(p) for p, _ in files), merged, tuple(problems))


def _unnamed(file: str, own: Mapping[str, Any], base: Mapping[str, Any]) -> Iterator[Problem]:
    for key in OWN:
        below = base.get(key)
        if key not in own or (isinstance(below, Stated) and own[key] == below.value):
            found = f"{own[key]!r}, as in its base" if key in own else "nothing"
            yield Problem(file, key, found, f"a {key} of its own: it is another rig than its base")


def _taken_away(file: str, keys: Any, base: Table) -> Iterator[Problem]:
    """Take keys out of the base, in place."""
    if not isinstance(keys, list) or not all(isinstance(k, str) for k in keys):
        yield Problem(file, "without", repr(keys), 'a list of keys of the base, such as ["masses", "channels.i_m3"]')
        return
    for key in keys:
        *above, last = _parts(key) or [""]
        table: Any = base
        for part in above:
            table = table.get(part) if isinstance(table, dict) else None
        if isinstance(table, dict) and last in table:
            del table[last]
        else:
            yield Problem(file, "without", repr(key), "a key of what it is based on, such as channels.i_m3")


def _parts(key: str) -> list[str]:
    """The parts of a dotted key, each bare or in quotes as in TOML; none where it is no such key."""
    try:
        found: Any = tomllib.loads(f"{key} = 0")
    except (tomllib.TOMLDecodeError, RecursionError):
        return []
    parts: list[str] = []
    while isinstance(found, dict) and len(found) == 1:
        ((name, found),) = found.items()
        parts.append(name)
    return parts if found == 0 else []


def _stated(table: Mapping[str, Any], file: str) -> Table:
    return {k: _stated(v, file) if isinstance(v, dict) else Stated(v, file) for k, v in table.items()}


def _plain(table: Mapping[str, Any]) -> Table:
    return {k: _plain(v) if isinstance(v, dict) else v.value for k, v in table.items()}


def _files(found: Any) -> Iterator[str]:
    if isinstance(found, Stated):
        yield found.file
    elif isinstance(found, dict):
        for value in found.values():
            yield from _files(value)
