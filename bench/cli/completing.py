"""Names for the shell's completion: `bench _complete KIND`. Reads names of files alone, so that a key answers at once."""

from __future__ import annotations

import logging
import sqlite3
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from bench import catalogue, rundir

SHELLS = ("bash", "zsh", "fish")
HIDDEN = "_complete"
"""The command that the completion calls; nobody types it, and `--help` does not show it."""


def complete(arguments: Sequence[str]) -> int:
    """Write the names of a kind, one a line; nothing for one that is not known."""
    for kind in arguments[:1]:
        sys.stdout.writelines(f"{name}\n" for name in NAMES.get(kind, tuple)())
    return 0


def procedures() -> Iterable[str]:
    """As `bench list` shows them."""
    return [entry.name for entry in catalogue.procedures()]


def rigs() -> Iterable[str]:
    """In ./rigs and the installed ones."""
    return _stems(Path("rigs"), catalogue.INSTALLED)


def campaigns() -> Iterable[str]:
    """In ./campaigns and the installed ones."""
    return _stems(Path("campaigns"), catalogue.INSTALLED_CAMPAIGNS)


def runs() -> Iterable[str]:
    """In ./runs, the newest first."""
    found = [str(Path("runs") / run.run_id) for run in rundir.runs_in(Path("runs"))]
    return sorted(found, key=lambda path: path.split("-")[-2:], reverse=True)


def kinds() -> Iterable[str]:
    """Of schemas, as `bench schema` takes them."""
    return ["rig", "spec", "campaign", *(f"plan-{name}" for name in procedures())]


def quantities() -> Iterable[str]:
    """Measured in ./runs; none where a key cannot have them: nothing is told in the middle of a line."""
    from bench.run import index, indexstore

    logging.getLogger(indexstore.__name__).setLevel(logging.ERROR)
    with suppress(sqlite3.Error, OSError):
        return index.names(Path("runs"))
    return ()


def _stems(*folders: Path) -> list[str]:
    return list(dict.fromkeys(path.stem for folder in folders for path in sorted(folder.glob("*.toml"))))


NAMES: Mapping[str, Callable[[], Iterable[str]]] = {
    "PROCEDURE": procedures,
    "RIG": rigs,
    "FILE": campaigns,
    "RUN": runs,
    "A": runs,
    "B": runs,
    "QUANTITY": quantities,
    "KIND": kinds,
    "SHELL": lambda: SHELLS,
}
"""By what `--help` calls a value."""
