"""cantools' reader of DBC files, without what else `import cantools` brings: its tester imports python-can, which takes longer
than to read a rig file."""

from __future__ import annotations

import importlib.util
import logging
import sys
from types import ModuleType
from typing import Any


def _database() -> ModuleType:
    """`cantools.database`, by a bare package in the place of cantools' own while it is imported. Whoever imports cantools later
    gets all of it, with this database."""
    spec = importlib.util.find_spec("cantools")
    if "cantools" in sys.modules or spec is None:
        return importlib.import_module("cantools.database")
    bare: Any = ModuleType("cantools")
    bare.__path__, bare.__spec__ = spec.submodule_search_locations, spec
    sys.modules["cantools"] = bare
    try:
        return importlib.import_module("cantools.database")
    finally:
        del sys.modules["cantools"]


database = _database()
logging.getLogger("cantools").addHandler(logging.NullHandler())  # what it warns of, `bench check` says by place
