"""A rig by its name or path, checked in full."""

from __future__ import annotations

from functools import lru_cache

from bench.errors import ConfigError, Problem
from bench.rigfile.check import problems_of
from bench.rigfile.model import RigFile
from bench.rigfile.text import RigText, read_rig


def load_rig(rig: str) -> RigFile:
    """A rig, checked in full (see `bench.rigfile.check`), with what its file is based on.

    Raises:
        ConfigError: with every problem that was found.
    """
    text = read_rig(rig)
    try:
        loaded, problems = _checked(text.toml, text.dbc, str(text.path))
    except ConfigError as error:
        if not error.problems:
            raise
        raise _unusable(text, error.problems) from error
    if problems or text.merged.problems:
        raise _unusable(text, problems)
    return loaded


def _unusable(text: RigText, problems: tuple[Problem, ...]) -> ConfigError:
    return ConfigError(f"rig file {text.path} cannot be used:", text.told(problems))


@lru_cache(maxsize=32)
def _checked(toml_text: str, dbc_text: str, path: str) -> tuple[RigFile, tuple[Problem, ...]]:
    loaded = RigFile.parse(toml_text, dbc_text, path)
    return loaded, tuple(problems_of(loaded))
