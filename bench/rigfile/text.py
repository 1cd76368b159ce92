"""The texts of a rig file, before anything in them is understood: where they lie, their size, their schema."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench import catalogue
from bench.errors import ConfigError, Problem
from bench.inputfile import decoded, read_regular
from bench.rigfile.based import Merged, read_merged
from bench.rigfile.migration import to_schema_2
from bench.rigfile.tomltext import MOST_TOML, parse_text

__all__ = ["MOST_DBC", "MOST_TOML", "SCHEMA", "RigText", "migrated", "parse_text", "read_rig"]

SCHEMA = 2
MOST_DBC = 16_000_000
"""Bytes of a rig's DBC, wherever it lies."""

MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {1: to_schema_2}
"""From an older schema to the next one."""


def migrated(data: dict[str, Any], path: str) -> dict[str, Any]:
    """The data in today's schema.

    Raises:
        ConfigError: no schema, a newer one, or one that no migration reaches.
    """
    schema = data.get("schema")
    if not isinstance(schema, int) or schema > SCHEMA:
        newer = "; it was written for a newer Levbench" if isinstance(schema, int) else ""
        raise ConfigError(f"rig file {path}: schema: found {schema!r}; expected {SCHEMA}{newer}")
    while schema < SCHEMA:
        if schema not in MIGRATIONS:
            raise ConfigError(f"rig file {path}: schema: found {schema}; no way from there to {SCHEMA}")
        data = {**MIGRATIONS[schema](data), "schema": schema + 1}
        schema += 1
    return data


@dataclass(frozen=True)
class RigText:
    """A rig file's two texts and where it lies. `toml` holds what the file is based on, too: it stands by itself."""

    path: Path
    toml: str
    dbc: str
    merged: Merged

    def told(self, problems: Iterable[Problem]) -> tuple[Problem, ...]:
        """Problems of the rig, each with the file in which its key stands, and those of how the files are laid."""
        return (*self.merged.problems, *self.merged.attributed(problems))


def read_rig(rig: str) -> RigText:
    """The texts of a rig: a path, else a name in `./rigs`, else in the installed `rigs/`.

    Raises:
        ConfigError: unknown rig, unreadable file, or a DBC that is not there.
    """
    path = catalogue.rig_path(rig)
    merged = read_merged(path)
    links = _table(merged.data, "links")
    used = str(_table(_table(merged.data, "devices"), "controller").get("link", ""))
    mapped = [n for n in (used, *links) if _table(links, n).get("dbc")]  # another's, if the controller's has none
    if not mapped:
        raise ConfigError(f'rig file {path}: links: found no dbc; expected [links.NAME] with dbc = "FILE.dbc"')
    key = f"links.{mapped[0]}"
    file = Path(merged.file_of(f"{key}.dbc"))
    return RigText(path, merged.toml, _dbc_text(file, key, links[mapped[0]]), merged)


def _dbc_text(path: Path, key: str, link: Mapping[str, Any]) -> str:
    """The DBC of a link; what is wrong with it is told without a word of it: it may be any file."""
    dbc, encoding = str(link["dbc"]), str(link.get("encoding", "utf-8"))
    try:
        return decoded(read_regular(path.parent / dbc, MOST_DBC), encoding)
    except OSError as error:
        why = error.strerror or error
        raise ConfigError(f"rig file {path}: {key}.dbc: cannot read {path.parent / dbc}: {why}") from error
    except LookupError as error:
        raise ConfigError(
            f"rig file {path}: {key}.encoding: found {encoding!r}; expected a known one, such as cp1252"
        ) from error
    except ValueError as error:
        at = f"byte {error.start} of " if isinstance(error, UnicodeDecodeError) else ""
        raise ConfigError(
            f"rig file {path}: {key}.encoding: found {encoding!r}, which {at}{dbc} is not; expected that of the file, such as "
            'encoding = "cp1252"'
        ) from error


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = data.get(key)
    return found if isinstance(found, dict) else {}
