"""Which run is meant: by its directory, its name, the beginning of that, or as `last`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from bench import rundir
from bench.errors import ConfigError
from bench.run import index
from bench.run.indexrow import IndexEntry
from bench.rundir import RunDirectory

LAST = re.compile(r"last(?:~[0-9]{1,6})?")
SHOWN = 3


def run_named(word: str, root: Path, of: Sequence[RunDirectory] = ()) -> RunDirectory:
    """The run that a word means: the path of a run directory; the name of one in `root`, or its beginning; `last`, the newest
    in `root`, or `last~N`, the N-th before it.

    Args:
        of: runs that were named before: `last` and what counts from it are then of the procedure of the first of them.

    Raises:
        ConfigError: no such run, or several; the text says which.
    """
    if _by_time(word):
        return _last(int(word[5:] or 0), word, root, of)
    if _is_folder(word) or not root.is_dir():
        return rundir.existing(Path(word))
    fitting = [run for run in rundir.runs_in(root) if run.run_id.startswith(word)]
    exact = [run for run in fitting if run.run_id == word] or fitting
    if len(exact) == 1:
        return rundir.existing(exact[0].path)
    if not exact:
        raise ConfigError(
            f"{word}: found no run directory of that name, here or in {root}; expected a run directory, its name or the "
            f"beginning of it, or last. Next: `bench runs --out {root}` lists them"
        )
    some = ", ".join(run.run_id for run in exact[:SHOWN]) + (" and others" if len(exact) > SHOWN else "")
    raise ConfigError(
        f"{word}: found {len(exact)} runs in {root} whose name begins so: {some}; expected one. Next: give more of it"
    )


def pair_named(words: tuple[str, str], root: Path) -> tuple[RunDirectory, RunDirectory]:
    """Two runs to be compared. Where `last` stands beside a run that is named otherwise, it is of that run's procedure;
    `last~1` beside `last` is of its procedure and rig.

    Raises:
        ConfigError: as `run_named`.
    """
    named = {w: run_named(w, root) for w in words if not _by_time(w)}
    context = list(named.values())
    a, b = (named.get(w) or run_named(w, root, context) for w in words)
    return a, b


def _by_time(word: str) -> bool:
    """Whether it is `last` or `last~N`, and no folder of that name."""
    return LAST.fullmatch(word) is not None and not _is_folder(word)


def _is_folder(word: str) -> bool:
    """False too of what no path can be."""
    try:
        return Path(word).is_dir()
    except (OSError, ValueError):
        return False


def _last(back: int, word: str, root: Path, of: Sequence[RunDirectory]) -> RunDirectory:
    found = index.entries(root)
    if not found:
        raise ConfigError(f"{word}: found no runs in {root}; expected some. Next: give their folder with --out")
    series = _series(found, of)
    if back >= len(series):
        kind = f"{len(series)} of {series[-1].procedure} on {series[-1].rig}" if series else "none of that procedure"
        raise ConfigError(
            f"{word}: found {kind} in {root}; expected at least {back + 1}. Next: `bench runs --out {root}` lists them"
        )
    return rundir.existing(root / series[-1 - back].run_id)


def _series(found: Sequence[IndexEntry], of: Sequence[RunDirectory]) -> list[IndexEntry]:
    """The runs that `last` counts: of one procedure on one rig, those of the newest run that it can mean; not those of a real
    machine beside those of its twin."""
    names = {run.run_id for run in of}
    procedures = {name.rsplit("-", 2)[0] for name in names}
    rest = [e for e in found if (not procedures or e.procedure in procedures) and e.run_id not in names]
    newest = rest[-1:]
    return [e for e in rest for n in newest if (e.procedure, e.rig, e.machine) == (n.procedure, n.rig, n.machine)]
