"""The file of the index of runs: made from the records where it is missing, old or corrupt, and brought up to date with what
lies in the folder. It imports nothing heavy: `bench.run.indexed` reads the records."""

from __future__ import annotations

import gc
import logging
import os
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from bench.errors import ConfigError
from bench.run.indexrow import CALLED, KIND, MADE, TABLES, Row
from bench.rundir import RunDirectory, named_as_run, runs_in

NAME = "index.sqlite"
VERSION = 8  # of the tables, and of how results are told in them; another one is rebuilt
TICK_NS = 1_000_000_000  # two changes of a folder that are nearer may have one time
LISTED_NS = 10_000_000_000  # so much older an index is made that knows all of its folder: nothing else makes it so
UNWRITABLE = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY)
T = TypeVar("T")
log = logging.getLogger(__name__)


def rebuild(root: Path) -> list[str]:
    """Make the index anew from the records; what cannot be read is left out and named in the messages returned."""
    try:
        with _opened(root) as db:
            return _filled(db, root)
    except sqlite3.OperationalError:
        raise  # locked or not writable: deleting it would not help
    except sqlite3.DatabaseError:
        (root / NAME).unlink(missing_ok=True)
        with _opened(root) as db:
            return _filled(db, root)


def take_in(db: sqlite3.Connection, root: Path) -> set[str] | None:
    """Put in the runs of processes that were killed, and those that were copied here; take out those that were deleted. The
    folder is listed where something was made in it, or taken away, since it was listed last: the index's file's time tells.

    Returns the names in the folder where the index cannot be made to have these alone.
    """
    own, changed_ns = root / NAME, root.stat().st_mtime_ns
    if own.is_file() and own.stat().st_mtime_ns == changed_ns - LISTED_NS:
        return None
    known = {run_id for (run_id,) in db.execute("SELECT run_id FROM runs")}
    there = set(os.listdir(root))  # after those, so that one that begins and ends meanwhile is new and not gone
    new, gone = sorted(filter(named_as_run, there - known)), known - there
    messages: list[str] = []
    if new or gone:
        try:
            db.execute("BEGIN IMMEDIATE")  # a run that ends meanwhile puts itself in afterwards, in place of this
            rows = list(_ended(new, root, messages))
            for row in rows:
                put(db, row)
            for run_id in gone:
                _take_out(db, run_id)
            db.commit()
        except (
            sqlite3.OperationalError
        ) as error:  # a folder of somebody else's, or one in which somebody writes for long
            db.rollback()
            if new:
                log.warning(f"{own}: {len(new)} runs are left out of the index: {error}")
            return there
        for message in messages:
            log.warning(message)
        if len(rows) + len(messages) < len(new):
            return None  # one that goes on may be killed, and nothing in the folder would change
    if time.time_ns() - changed_ns > TICK_NS:
        with suppress(OSError):
            os.utime(own, ns=(changed_ns, changed_ns - LISTED_NS))
    return None


def _ended(names: Iterable[str], root: Path, messages: list[str]) -> Iterator[Row]:
    """What the index keeps of runs, without those that are being written; those that cannot be read are named in `messages`."""
    from bench.lock import is_held
    from bench.run.indexed import row

    for name in names:
        run = RunDirectory(root / name)
        try:
            found = row(run)
        except ConfigError as error:
            messages.append(f"{run.path}: left out of the index: {error}")
            continue
        if found.entry.ended is None:
            with suppress(OSError):  # no recording: it was killed before it began
                if is_held(run.recording):
                    continue
        yield found


def answered(root: Path, ask: Callable[[sqlite3.Connection], T]) -> T:
    """What the index answers. One that is missing, of another version or corrupt is rebuilt first: that shows where it is read,
    as a check of the whole would take longer than any answer. In a folder that cannot be written it is kept in memory."""
    try:
        return on_disk(root, ask)
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF not in UNWRITABLE:
            raise
        return ask(_in_memory(root.resolve(), str(error)))


def on_disk(root: Path, ask: Callable[[sqlite3.Connection], T]) -> T:
    """The same of its file alone: what is put in must stay."""
    for _ in range(2):
        try:
            with _opened(root) as db:
                if db.execute("PRAGMA user_version").fetchone()[0] == VERSION:
                    return ask(db)
        except sqlite3.OperationalError as error:
            if "no such" not in str(error):  # a table or column: it was made otherwise
                raise
        except sqlite3.DatabaseError:
            pass
        rebuild(root)
    with _opened(root) as db:
        return ask(db)


@lru_cache(maxsize=4)
def _in_memory(root: Path, why: str) -> sqlite3.Connection:
    """An index for this process alone, made once. `bench show` asks in many threads, one at a time."""
    log.warning(f"{root / NAME}: {why}: the records are read instead, which takes longer")
    db = sqlite3.connect(":memory:", check_same_thread=False)
    with db:
        _filled(db, root)
    return db


def _filled(db: sqlite3.Connection, root: Path) -> list[str]:
    messages: list[str] = []
    db.execute("BEGIN IMMEDIATE")  # before the records are read: another process adds before or after, not between
    for table in ("runs", "kinds", "made_with", "names", "results"):
        db.execute(f"DROP TABLE IF EXISTS {table}")
    for statement in filter(str.strip, TABLES.split(";")):
        db.execute(statement)
    for found in _ended((run.run_id for run in runs_in(root)), root, messages):
        put(db, found)
    db.execute(f"PRAGMA user_version = {VERSION}")
    for message in messages:
        log.warning(message)
    return messages


def put(db: sqlite3.Connection, row: Row) -> None:
    """A run and its results, in place of what stood there of that run."""
    e = row.entry
    _take_out(db, e.run_id)
    kept = (_kept(db, "kinds", "kind", KIND, e.kind), _kept(db, "made_with", "made", MADE, row.made_with))
    of_run = (None, e.run_id, e.started, e.ended, *kept)
    run = db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(of_run))})", of_run).lastrowid
    for ordinal, (called, shown) in enumerate(row.results):
        number = _kept(db, "names", "number", CALLED, called)
        db.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?, ?)", (number, run, ordinal, *shown))


def _take_out(db: sqlite3.Connection, run_id: str) -> None:
    for (run,) in db.execute("SELECT run FROM runs WHERE run_id = ?", (run_id,)).fetchall():
        db.execute("DELETE FROM results WHERE run = ?", (run,))
        db.execute("DELETE FROM runs WHERE run = ?", (run,))


def _kept(db: sqlite3.Connection, table: str, key: str, columns: str, shared: tuple[str | int | None, ...]) -> int:
    """The number of what many rows share, which a table has once."""
    alike = " AND ".join(f"{column} IS ?" for column in columns.split(", "))
    known = db.execute(f"SELECT {key} FROM {table} WHERE {alike}", shared).fetchone()
    places = ", ".join("?" * len(shared))
    return int(known[0] if known else db.execute(f"INSERT INTO {table} VALUES (NULL, {places})", shared).lastrowid or 0)


@contextmanager
def uncollected() -> Iterator[None]:
    """Rows are tuples of numbers and texts: to look among very many of them for circles takes longer than to read them."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def _opened(root: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(root / NAME, timeout=30.0)) as db, db:
        yield db
