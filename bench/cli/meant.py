"""Which stored run a command is for, as somebody types it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Final

from bench import lock, rundir
from bench.errors import ConfigError
from bench.history.naming import run_named
from bench.rundir import RunDirectory

RUNS: Final = Path("runs")
"""Where runs are looked for by their names: the folder into which `bench run` puts them."""
OF_A_RUN: Final = ("recording.mcap", "record.json")


def meant(word: str) -> Path:
    """The directory of a run: by its path, or that of its recording or record, by its name in ./runs, the beginning of that, or
    as `last` or `last~N`.

    Raises:
        ConfigError: there is none, or several.
    """
    path = Path(word)
    if path.name in OF_A_RUN and path.is_file():
        path = path.parent
    if path.is_dir():  # as it was typed: what is printed is named alike
        return path
    if not any(rundir.runs_in(RUNS)):
        raise ConfigError(
            f"{word}: found nothing; expected a run directory, or a run by its name in ./runs, which has none. "
            "Next: give its path"
        )
    return run_named(word, RUNS).path


def ended(word: str) -> Path:
    """As `meant`, of a run that nobody writes any more. What is made of one in the middle would be of half of its data, and say
    that its process was killed.

    Raises:
        ConfigError: there is none, or it is still being written.
    """
    run = RunDirectory(meant(word))
    with suppress(OSError):  # a recording that is missing, or cannot be opened, is told by who reads it
        if lock.is_held(run.recording):
            raise ConfigError(
                f"{word}: found a run that is still being written; expected one that has ended; nothing was written. "
                "Next: wait for its end; bench.open_run reads what there is of it"
            )
    return run.path
