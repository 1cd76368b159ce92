"""From a procedure's name to the procedure, without what opens rigs."""

from __future__ import annotations

import importlib

from bench import catalogue
from bench.procedure import Procedure


def load_procedure(name: str) -> Procedure:
    """The procedure of that name in the catalogue.

    Raises:
        ConfigError: there is none.
    """
    found: Procedure = importlib.import_module(catalogue.entry(name).module).procedure
    return found
