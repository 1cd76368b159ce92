"""An index of the runs in a directory and of their results, `index.sqlite`. The records are the truth; the index can always be
rebuilt. What only reads it imports nothing heavy: `bench.run.indexed` reads the records."""

from __future__ import annotations

import logging
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TypeVar

from bench.errors import ConfigError
from bench.run.indexrow import IndexEntry, Result, Row
from bench.rundir import RunDirectory, runs_in

NAME = "index.sqlite"
VERSION = 4  # of the tables; another one is rebuilt
SOUND = ("PASS", "DONE")
T = TypeVar("T")
log = logging.getLogger(__name__)


RUN_COLUMNS = ", ".join(IndexEntry._fields)
CALLED = "name, full, quantity, place, unit"
TABLES = f"""
    CREATE TABLE runs (run INTEGER PRIMARY KEY, {RUN_COLUMNS}, settings, parameters, firmware, certificates, calibrations,
                       UNIQUE (run_id));
    CREATE INDEX runs_by_time ON runs (started, run_id);
    CREATE TABLE names (number INTEGER PRIMARY KEY, {CALLED}, UNIQUE ({CALLED}));
    CREATE TABLE results (number INTEGER, run INTEGER, ordinal INTEGER, value, u, expanded, dof, p, lower, upper, verdict,
                          PRIMARY KEY (number, run, ordinal)) WITHOUT ROWID;
    CREATE INDEX results_by_run ON results (run);
"""
"""Results lie together by name, and refer to runs by number: so a series of very many is read in a fraction of a second."""
_READ = """r.run_id, procedure, rig, uut, started, seed, visit, outcome, name, quantity, place, unit, value, u, expanded, dof,
    p, lower, upper, verdict, settings, firmware, calibrations, parameters, certificates, served"""
_NEWEST = "ORDER BY started DESC, r.run_id DESC"


def add(run_dir: Path) -> None:
    """Put a run into the index of the directory that holds it, or bring its lines up to date.

    Raises:
        ConfigError: it holds no readable record.
    """
    from bench.run.indexed import row

    found = row(RunDirectory(run_dir.resolve()))
    _answered(run_dir.resolve().parent, lambda db: _put(db, found))


def rebuild(root: Path) -> list[str]:
    """Make the index anew from the records; what cannot be read is left out and named in the messages returned."""
    try:
        return _filled(root)
    except sqlite3.OperationalError:
        raise  # locked or not writable: deleting it would not help
    except sqlite3.DatabaseError:
        (root / NAME).unlink(missing_ok=True)
        return _filled(root)


def entries(
    root: Path, *, procedure: str | None = None, rig: str | None = None, failed: bool = False, last: int | None = None
) -> list[IndexEntry]:
    """The runs in `root`, oldest first, without those deleted since; rebuilds a missing or corrupt index.

    `failed` are those that ended neither PASS nor DONE; `last` the newest so many of what is left by the others."""
    if not root.is_dir():
        return []
    where, values = _chosen(procedure, rig, failed)
    query = f"SELECT {RUN_COLUMNS} FROM runs r {where} {_NEWEST}"
    return _answered(root, lambda db: _newest(root, map(IndexEntry._make, db.execute(query, values)), last))


def results(
    root: Path, *, quantity: str | None = None, procedure: str | None = None, rig: str | None = None, failed: bool = False,
    last: int | None = None,
) -> list[Result]:  # fmt: skip
    """Results of the runs in `root`, oldest run first, in the record's order within a run; those deleted since left out.

    Args:
        quantity: a name of the record (`K_i`, `B@by the speed channel`), or by kind and place (`K@inboard`); a kind alone is
            all that is measured of it, where nothing has that very name.
        last: the newest so many runs.
    """
    if not root.is_dir():
        return []

    def asked(db: sqlite3.Connection) -> list[Result]:
        where, values = _chosen(procedure, rig, failed)
        if quantity is not None:
            meant = _meant(db, quantity)
            where = f"{where or 'WHERE 1'} AND number IN ({', '.join(map(str, meant))})"
        query = f"SELECT {_READ} FROM results JOIN runs r USING (run) JOIN names USING (number) {where} {_NEWEST}, ordinal DESC"
        return _newest(root, (Result._make((*row, root)) for row in db.execute(query, values)), last)

    return _answered(root, asked)


def names(root: Path) -> list[str]:
    """The names that results have in `root`, and what they are called by kind and place, in order."""
    if not root.is_dir():
        return []
    query = "SELECT name FROM names UNION SELECT full FROM names ORDER BY 1"
    return _answered(root, lambda db: [str(name) for (name,) in db.execute(query)])


def _meant(db: sqlite3.Connection, asked: str) -> list[int]:
    """The numbers of the names of results that somebody means by a word."""
    for column in ("full", "quantity"):
        query = f"SELECT number FROM names WHERE name IN (SELECT name FROM names WHERE name = ?1 OR {column} = ?1)"
        if found := [number for (number,) in db.execute(query, (asked,))]:
            return found
    return []


def _chosen(procedure: str | None, rig: str | None, failed: bool) -> tuple[str, tuple[str, ...]]:
    """The condition of a query for runs, with its values."""
    asked = {"procedure = ?": procedure, "rig = ?": rig}
    conditions = [text for text, value in asked.items() if value is not None]
    conditions += [f"outcome NOT IN {SOUND}"] if failed else []
    return f"WHERE {' AND '.join(conditions)}" if conditions else "", tuple(v for v in asked.values() if v is not None)


def _newest(root: Path, newest_first: Iterator[T], last: int | None) -> list[T]:
    """Rows of runs that are still there, oldest first; of so many runs at most. One listing of the folder is quicker than to
    look for each of very many runs, and slower than to look for a few."""
    there = _in_folder(root) if last is None else _each_looked_for(root)
    out: list[T] = []
    run_id, runs = "", 0
    for row in newest_first:
        if row[0] != run_id:  # type: ignore[index]
            run_id = row[0]  # type: ignore[index]
            present = there(run_id)
            if present and (runs := runs + 1) == (last or 0) + 1 and last is not None:
                break
        if present:
            out.append(row)
    return out[::-1]


def _in_folder(root: Path) -> Callable[[str], bool]:
    return set(os.listdir(root)).__contains__


def _each_looked_for(root: Path) -> Callable[[str], bool]:
    return lambda run_id: (root / run_id).is_dir()


def _answered(root: Path, ask: Callable[[sqlite3.Connection], T]) -> T:
    """What the index answers. One that is missing, of another version or corrupt is rebuilt first: that shows where it is read,
    as a check of the whole would take longer than any answer."""
    for _ in range(2):
        try:
            with _opened(root) as db:
                if db.execute("PRAGMA user_version").fetchone()[0] == VERSION:
                    return ask(db)
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError:
            pass
        rebuild(root)
    with _opened(root) as db:
        return ask(db)


def _filled(root: Path) -> list[str]:
    from bench.run.indexed import row

    messages: list[str] = []
    with _opened(root) as db:
        db.execute("BEGIN IMMEDIATE")  # before the records are read: another process adds before or after, not between
        for table in ("runs", "names", "results"):
            db.execute(f"DROP TABLE IF EXISTS {table}")
        for statement in filter(str.strip, TABLES.split(";")):
            db.execute(statement)
        for run in runs_in(root):
            try:
                _put(db, row(run))
            except ConfigError as error:
                messages.append(f"{run.path}: left out of the index: {error}")
        db.execute(f"PRAGMA user_version = {VERSION}")
    for message in messages:
        log.warning(message)
    return messages


def _put(db: sqlite3.Connection, row: Row) -> None:
    """A run and its results, in place of what stood there of that run."""
    for (run,) in db.execute("SELECT run FROM runs WHERE run_id = ?", row.entry[:1]).fetchall():
        db.execute("DELETE FROM results WHERE run = ?", (run,))
        db.execute("DELETE FROM runs WHERE run = ?", (run,))
    of_run = (None, *row.entry, *row.made_with)
    run = db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(of_run))})", of_run).lastrowid
    for ordinal, (called, numbers) in enumerate(row.results):
        known = db.execute(f"SELECT number FROM names WHERE ({CALLED}) = (?, ?, ?, ?, ?)", called).fetchone()
        number = known[0] if known else db.execute("INSERT INTO names VALUES (NULL, ?, ?, ?, ?, ?)", called).lastrowid
        db.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", (number, run, ordinal, *numbers))


@contextmanager
def _opened(root: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(root / NAME, timeout=30.0)) as db, db:
        yield db
