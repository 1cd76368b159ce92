"""From a procedure's name to the procedure, without what opens rigs."""

from __future__ import annotations

import importlib

from bench import catalogue
from bench.errors import ConfigError
from bench.procedure import Procedure
from bench.rundir import LISTENED


def load_procedure(name: str) -> Procedure:
    """The procedure of that name in the catalogue.

    Raises:
        ConfigError: there is none, or it is no procedure that a recording names.
    """
    if name == LISTENED:
        raise ConfigError(
            "it was recorded by `bench listen`, which measures nothing. Next: `bench export` writes what came"
        )
    found: Procedure = importlib.import_module(catalogue.entry(name).module).procedure
    return found
