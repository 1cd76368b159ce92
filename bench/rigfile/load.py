"""A rig by its name or path, checked in full."""

from __future__ import annotations

from functools import lru_cache

from bench.errors import ConfigError
from bench.rigfile.check import problems_of
from bench.rigfile.model import RigFile
from bench.rigfile.text import read_rig


def load_rig(rig: str) -> RigFile:
    """A rig, checked in full (see `bench.rigfile.check`).

    Raises:
        ConfigError: with every problem that was found.
    """
    text = read_rig(rig)
    return _checked(text.toml, text.dbc, str(text.path))


@lru_cache(maxsize=32)
def _checked(toml_text: str, dbc_text: str, path: str) -> RigFile:
    loaded = RigFile.parse(toml_text, dbc_text, path)
    problems = problems_of(loaded)
    if problems:
        raise ConfigError(f"rig file {path} cannot be used:", tuple(problems))
    return loaded
