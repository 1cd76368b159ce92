"""An index of the runs in a directory and of their results, `index.sqlite`. The records are the truth; the index can always be
rebuilt. What only reads it imports nothing heavy: `bench.run.indexed` reads the records."""

from __future__ import annotations

import gc
import json
import logging
import os
import sqlite3
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

from bench.errors import ConfigError
from bench.run.indexrow import (
    CALLED,
    KIND,
    MADE,
    RUN_COLUMNS,
    TABLES,
    IndexEntry,
    Kind,
    MachineKind,
    Numbers,
    Result,
    Row,
)
from bench.rundir import RunDirectory, named_as_run, runs_in

NAME = "index.sqlite"
VERSION = 6  # of the tables; another one is rebuilt
SOUND = ("PASS", "DONE")
TICK_NS = 1_000_000_000  # two changes of a folder that are nearer may have one time
LISTED_NS = 10_000_000_000  # so much older an index is made that knows all of its folder: nothing else makes it so
T = TypeVar("T")
log = logging.getLogger(__name__)
OF_MACHINE: dict[MachineKind, str] = {
    "real": "seed IS NULL AND NOT served",
    "served": "seed IS NULL AND served",
    "simulated": "seed IS NOT NULL",
}
_READ = """r.run_id, procedure, rig, uut, started, seed, visit, outcome, name, quantity, place, unit, value, u, expanded, dof,
    p, lower, upper, verdict, settings, firmware, calibrations, parameters, certificates, served"""


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
    root: Path, *, procedure: str | None = None, rig: str | None = None, failed: bool = False, last: int | None = None,
    machine: MachineKind | None = None,
) -> list[IndexEntry]:  # fmt: skip
    """The runs in `root`, oldest first, without those deleted since; rebuilds a missing or corrupt index.

    `failed` are those that ended neither PASS nor DONE; `last` the newest so many of what is left by the others."""
    if not root.is_dir():
        return []
    where, values = _chosen(procedure, rig, failed, machine)
    query = f"SELECT {RUN_COLUMNS} FROM runs r JOIN kinds USING (kind) {where} ORDER BY started {{0}}, r.run_id {{0}}"
    with uncollected():
        return [IndexEntry._make(row) for row in _read(root, lambda db: _there(db, root, query, values, last))]


def listing(
    root: Path, *, procedure: str | None = None, rig: str | None = None, failed: bool = False, last: int | None = None,
    machine: MachineKind | None = None, timed: bool = False,
) -> tuple[list[tuple[Any, ...]], dict[int, Kind]]:  # fmt: skip
    """What `entries` gives, quicker of very many runs: of each its name and the number of its kind, `timed` with its beginning
    and end; and all kinds by their numbers."""
    if not root.is_dir():
        return [], {}
    where, values = _chosen(procedure, rig, failed, machine)
    wanted = f"WHERE kind IN (SELECT kind FROM kinds {where})" if where else ""
    times = ", started, ended" if timed else ""
    query = f"SELECT run_id, kind{times} FROM runs {wanted} ORDER BY started {{0}}, run_id {{0}}"

    def asked(db: sqlite3.Connection) -> tuple[list[tuple[Any, ...]], dict[int, Kind]]:
        return _there(db, root, query, values, last), _kinds(db)

    with uncollected():
        return _read(root, asked)


def _kinds(db: sqlite3.Connection, where: str = "", values: tuple[str, ...] = ()) -> dict[int, Kind]:
    found = db.execute(f"SELECT kind, {KIND} FROM kinds {where}", values)
    return {number: Kind._make(kind) for number, *kind in found}


def results(
    root: Path, *, quantity: str | None = None, procedure: str | None = None, rig: str | None = None, failed: bool = False,
    last: int | None = None, of: Sequence[str] | None = None, machine: MachineKind | None = None,
) -> list[Result]:  # fmt: skip
    """Results of the runs in `root`, oldest run first, in the record's order within a run; those deleted since left out.

    Args:
        quantity: a name of the record (`K_i`, `B@by the speed channel`), or by kind and place (`K@inboard`); a kind alone is
            all that is measured of it, where nothing has that very name.
        last: the newest so many runs that have any.
        of: the names of some runs: of these alone.
    """
    if not root.is_dir():
        return []
    where, values = _chosen(procedure, rig, failed, machine, of)
    # The newest few are found by going back through the runs, all of a series where they lie together.
    tables = "runs r CROSS JOIN results s ON s.run = r.run" if last or of else "results s JOIN runs r USING (run)"
    tables += " JOIN kinds USING (kind) JOIN names n ON n.number = s.number JOIN made_with USING (made)"

    def asked(db: sqlite3.Connection) -> list[tuple[Any, ...]]:
        named = "" if quantity is None else f" AND {_named(db, quantity)}"
        query = (f"SELECT {_READ} FROM {tables} {where or 'WHERE 1'}{named} "
                 "ORDER BY started {0}, r.run_id {0}, ordinal {0}")  # fmt: skip
        return _there(db, root, query, values, last if of is None else len(of))

    with uncollected():
        return [Result._make((*row, root)) for row in _read(root, asked)]


def numbers(root: Path, quantity: str) -> list[Numbers]:
    """What all runs have measured of a quantity, as `results` has it, in no order; of runs deleted since too."""

    def asked(db: sqlite3.Connection) -> list[Numbers]:
        called = {number: rest for number, *rest in db.execute("SELECT number, name, unit FROM names")}
        query = f"""SELECT run_id, s.number, value, u, expanded, dof, p, lower, upper, verdict
            FROM results s JOIN runs USING (run) WHERE {_named(db, quantity)}"""
        return [Numbers(run, *called[number], *rest) for run, number, *rest in db.execute(query)]

    with uncollected():
        return _answered(root, asked) if root.is_dir() else []


def machines(root: Path, quantity: str, procedure: str | None = None, rig: str | None = None) -> Counter[MachineKind]:
    """How many runs measured a quantity, by the machines that they were made on; nothing where all runs are of one sort."""
    found: Counter[MachineKind] = Counter()

    def asked(db: sqlite3.Connection) -> Counter[MachineKind]:
        of = {number: kind.machine for number, kind in _kinds(db, *_chosen(procedure, rig, False, None)).items()}
        if len(set(of.values())) > 1:
            query = f"""SELECT kind, count(DISTINCT run) FROM results s JOIN runs USING (run)
                WHERE {_named(db, quantity)} GROUP BY kind"""
            for kind, runs in db.execute(query):
                found.update({of[kind]: runs} if kind in of else {})
        return found

    return _answered(root, asked) if root.is_dir() else found


def names(root: Path) -> list[str]:
    """The names that results have in `root`, and what they are called by kind and place, in order."""
    if not root.is_dir():
        return []
    query = "SELECT name FROM names UNION SELECT full FROM names ORDER BY 1"
    return _read(root, lambda db: [str(name) for (name,) in db.execute(query)])


def _meant(db: sqlite3.Connection, asked: str) -> list[int]:
    """The numbers of the names of results that somebody means by a word."""
    for column in ("full", "quantity"):
        query = f"SELECT number FROM names WHERE name IN (SELECT name FROM names WHERE name = ?1 OR {column} = ?1)"
        if found := [number for (number,) in db.execute(query, (asked,))]:
            return found
    return []


def _named(db: sqlite3.Connection, quantity: str) -> str:
    """The condition that a result is of a quantity."""
    return f"s.number IN ({', '.join(map(str, _meant(db, quantity)))})"


def _chosen(
    procedure: str | None, rig: str | None, failed: bool, machine: MachineKind | None, of: Sequence[str] | None = None
) -> tuple[str, tuple[str, ...]]:
    """The condition of a query for runs, with its values."""
    asked = {"procedure = ?": procedure, "rig = ?": rig}
    conditions = [text for text, value in asked.items() if value is not None]
    values = tuple(v for v in asked.values() if v is not None)
    conditions += [f"outcome NOT IN {SOUND}"] if failed else []
    conditions += [OF_MACHINE[machine]] if machine is not None else []
    if of is not None:
        conditions.append("r.run_id IN (SELECT value FROM json_each(?))")
        values = (*values, json.dumps(list(of)))
    return f"WHERE {' AND '.join(conditions)}" if conditions else "", values


def _there(
    db: sqlite3.Connection, root: Path, query: str, values: tuple[str, ...], last: int | None
) -> list[tuple[Any, ...]]:
    """Rows of runs that are still there, oldest first; of so many runs at most. `query` has `{0}` for the order. One listing of
    the folder is quicker than to look for each of very many runs, and slower than to look for a few."""
    if last is None:
        present = set(os.listdir(root))
        return [row for row in db.execute(query.format("ASC"), values) if row[0] in present]
    kept: list[list[tuple[Any, ...]]] = []
    for run_id, rows in groupby(db.execute(query.format("DESC"), values), key=itemgetter(0)):
        if (root / run_id).is_dir():
            kept.append(list(rows))
            if len(kept) == last:
                break
    return [row for rows in reversed(kept) for row in reversed(rows)]


def _read(root: Path, ask: Callable[[sqlite3.Connection], T]) -> T:
    """As `_answered`, of all runs that are there: also of those that nobody put in."""

    def asked(db: sqlite3.Connection) -> T:
        _take_in(db, root)
        return ask(db)

    return _answered(root, asked)


def _take_in(db: sqlite3.Connection, root: Path) -> None:
    """Put in the runs of processes that were killed, and those that were copied here. The folder is listed where something was
    made in it, or taken away, since it was listed last: the time of the index's file tells."""
    own, changed_ns = root / NAME, root.stat().st_mtime_ns
    if own.stat().st_mtime_ns == changed_ns - LISTED_NS:
        return
    known = {run_id for (run_id,) in db.execute("SELECT run_id FROM runs")}
    new = sorted(name for name in set(os.listdir(root)) - known if named_as_run(name))
    messages: list[str] = []
    if new:
        try:
            db.execute("BEGIN IMMEDIATE")  # a run that ends meanwhile puts itself in afterwards, in place of this
            rows = list(_ended(new, root, messages))
            for row in rows:
                _put(db, row)
            db.commit()
        except (
            sqlite3.OperationalError
        ) as error:  # a folder of somebody else's, or one in which somebody writes for long
            db.rollback()
            log.warning(f"{own}: {len(new)} runs are left out of the index: {error}")
            return
        for message in messages:
            log.warning(message)
        if len(rows) + len(messages) < len(new):
            return  # one that goes on may be killed, and nothing in the folder would change
    if time.time_ns() - changed_ns > TICK_NS:
        with suppress(OSError):
            os.utime(own, ns=(changed_ns, changed_ns - LISTED_NS))


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


def _answered(root: Path, ask: Callable[[sqlite3.Connection], T]) -> T:
    """What the index answers. One that is missing, of another version or corrupt is rebuilt first: that shows where it is read,
    as a check of the whole would take longer than any answer."""
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


def _filled(root: Path) -> list[str]:
    messages: list[str] = []
    with _opened(root) as db:
        db.execute("BEGIN IMMEDIATE")  # before the records are read: another process adds before or after, not between
        for table in ("runs", "kinds", "made_with", "names", "results"):
            db.execute(f"DROP TABLE IF EXISTS {table}")
        for statement in filter(str.strip, TABLES.split(";")):
            db.execute(statement)
        for found in _ended((run.run_id for run in runs_in(root)), root, messages):
            _put(db, found)
        db.execute(f"PRAGMA user_version = {VERSION}")
    for message in messages:
        log.warning(message)
    return messages


def _put(db: sqlite3.Connection, row: Row) -> None:
    """A run and its results, in place of what stood there of that run."""
    for (run,) in db.execute("SELECT run FROM runs WHERE run_id = ?", row.entry[:1]).fetchall():
        db.execute("DELETE FROM results WHERE run = ?", (run,))
        db.execute("DELETE FROM runs WHERE run = ?", (run,))
    e = row.entry
    kept = (_kept(db, "kinds", "kind", KIND, e.kind), _kept(db, "made_with", "made", MADE, row.made_with))
    of_run = (None, e.run_id, e.started, e.ended, *kept)
    run = db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(of_run))})", of_run).lastrowid
    for ordinal, (called, numbers) in enumerate(row.results):
        number = _kept(db, "names", "number", CALLED, called)
        db.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", (number, run, ordinal, *numbers))


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
