"""Levbench: the nouns and the engine. What comes in are bytes from a controller, what goes out is a record.

For scripts and notebooks: `bench.open_run` gives a stored run with its channels, steps, captures and results, `bench.runs` a
table of the runs in a folder. Everything else is imported from its own module.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from bench.api.run import Run

__version__ = "0.1.0"
__all__ = ["__version__", "open_run", "runs"]


def open_run(run: str | os.PathLike[str], folder: str | os.PathLike[str] = "runs") -> Run:
    """A stored run: `run` is its directory, its recording, or its name among the runs in `folder`, of which the beginning is
    enough where it is the only one; `last` is the newest there, `last~1` the one before it of its procedure and rig.

    Raises:
        ConfigError: there is no such run, or several.
        RecordingError: its recording cannot be read (a run without one opens).
    """
    from bench.api.run import Run  # with numpy and the reader, a tenth of a second: `import bench` is to cost nothing

    return Run.open(run, folder)


def runs(folder: str | os.PathLike[str] = "runs") -> pd.DataFrame:
    """The runs in a folder, oldest first: `procedure`, `rig`, `outcome`, `started`, `ended`, `seed`, `visit`, `served` and
    `path` by run id.

    Raises:
        ConfigError: it is not a folder.
        BenchError: its index can neither be read nor rebuilt.
    """
    from bench.api.tables import runs_in

    return runs_in(folder)
