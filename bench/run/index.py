"""An index of the runs in a directory, `index.sqlite`. The records are the truth; the index can always be rebuilt."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from bench.errors import ConfigError
from bench.findings import SIMULATED_CONTROLLER
from bench.record.records import read_record
from bench.rundir import RunDirectory, runs_in

NAME = "index.sqlite"
VERSION = 3  # of the table; another one is rebuilt
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class IndexEntry:
    """One run, as `bench runs` lists it."""

    run_id: str
    procedure: str
    rig: str
    outcome: str
    started: str
    ended: str | None
    seed: int | None
    visit: int | None
    served: bool  # live, on a controller that says that it is a simulated one


_COLUMNS = ", ".join(f.name for f in fields(IndexEntry))
_INSERT = f"INSERT OR REPLACE INTO runs ({_COLUMNS}) VALUES ({', '.join('?' * len(fields(IndexEntry)))})"


def add(run_dir: Path) -> None:
    """Put a run into the index of the directory that holds it, or bring its line up to date.

    Raises:
        ConfigError: it holds no readable record.
    """
    entry = _entry(RunDirectory(run_dir.resolve()))
    root = run_dir.resolve().parent
    _sound(root)
    with _opened(root) as db:
        db.execute(_INSERT, astuple(entry))


def rebuild(root: Path) -> list[str]:
    """Make the index anew from the records; what cannot be read is left out and named in the messages returned."""
    try:
        return _filled(root)
    except sqlite3.OperationalError:
        raise  # locked or not writable: deleting it would not help
    except sqlite3.DatabaseError:
        (root / NAME).unlink(missing_ok=True)
        return _filled(root)


def entries(root: Path) -> list[IndexEntry]:
    """The runs in `root`, oldest first, without those deleted since; rebuilds a missing or corrupt index."""
    if not root.is_dir():
        return []
    _sound(root)
    with _opened(root) as db:
        rows = db.execute(f"SELECT {_COLUMNS} FROM runs ORDER BY started, run_id").fetchall()
    return [entry for row in rows if (root / (entry := IndexEntry(*row)).run_id).is_dir()]


def _entry(run: RunDirectory) -> IndexEntry:
    record = read_record(run.record)
    # The directory's name, not the record's: a copied directory is another run to whoever looks for it.
    return IndexEntry(run.run_id, record.procedure, record.rig, record.outcome.value, record.started, record.ended,
                      record.seed, record.visit, any(f.code == SIMULATED_CONTROLLER for f in record.findings))  # fmt: skip


def _sound(root: Path) -> None:
    """See to it that there is an index that can be used."""
    try:
        with _opened(root) as db:
            version = db.execute("PRAGMA user_version").fetchone()[0]
            whole = version == VERSION and db.execute("PRAGMA quick_check(1)").fetchone()[0] == "ok"
    except sqlite3.OperationalError:
        raise
    except sqlite3.DatabaseError:
        whole = False
    if not whole:
        rebuild(root)


def _filled(root: Path) -> list[str]:
    messages: list[str] = []
    with _opened(root) as db:
        db.execute("BEGIN IMMEDIATE")  # before the records are read: another process adds before or after, not between
        db.execute("DROP TABLE IF EXISTS runs")
        db.execute(f"CREATE TABLE runs ({_COLUMNS}, PRIMARY KEY (run_id))")
        for run in runs_in(root):
            try:
                db.execute(_INSERT, astuple(_entry(run)))
            except ConfigError as error:
                messages.append(f"{run.path}: left out of the index: {error}")
        db.execute(f"PRAGMA user_version = {VERSION}")
    for message in messages:
        log.warning(message)
    return messages


@contextmanager
def _opened(root: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(root / NAME, timeout=30.0)) as db, db:
        yield db
