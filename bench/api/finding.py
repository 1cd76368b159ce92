"""From what a person says of a run to its directory."""

from __future__ import annotations

import os
from pathlib import Path

from bench import rundir
from bench.errors import ConfigError
from bench.rundir import RunDirectory

LAST = "last"


def found_run(run: str | os.PathLike[str], folder: Path) -> RunDirectory:
    """The run directory of a path to it or to a file in it, of a run's name in `folder` or the beginning of one, or the newest
    there for `last`.

    Raises:
        ConfigError: there is no such run, or there are several.
    """
    path = Path(run)
    if path.exists() or len(path.parts) > 1:
        return rundir.existing(path.parent if path.is_file() else path)
    known = {found.run_id: found for found in rundir.runs_in(folder)}
    if os.fspath(run) == LAST:
        if not known:
            raise ConfigError(f"{folder}: found no run; expected one to be the last")
        return max(known.values(), key=lambda found: (_started(found.run_id), found.run_id))
    chosen = [name for name in known if name == os.fspath(run)] or [n for n in known if n.startswith(os.fspath(run))]
    if len(chosen) != 1:
        found = f"{len(chosen)} runs" if chosen else "no run"
        raise ConfigError(
            f"{run}: found {found} of that name in {folder}; expected one. Next: bench.runs({str(folder)!r}) lists them"
        )
    return known[chosen[0]]


def _started(run_id: str) -> str:
    """When a run began, as its name has it: `<procedure>-<UTC>-<4 hex>`."""
    return run_id.split("-")[-2]
