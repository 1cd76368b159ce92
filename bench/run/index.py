"""An index of the runs in a directory and of their results, `index.sqlite`. The records are the truth; the index can always be
rebuilt. What only reads it imports nothing heavy: `bench.run.indexed` reads the records."""

from __future__ import annotations

import json
import sqlite3
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

from bench.run.indexrow import KIND, NUMBERS, RUN_COLUMNS, IndexEntry, Kind, MachineKind, Result
from bench.run.indexstore import NAME, VERSION, answered, on_disk, put, rebuild, take_in, uncollected
from bench.rundir import RunDirectory

__all__ = ["NAME", "SOUND", "VERSION", "IndexEntry", "MachineKind", "Result", "add", "entries", "kinds", "listing", "machines",
           "names", "rebuild", "results", "shown", "uncollected"]  # fmt: skip
SOUND = ("PASS", "DONE")
T = TypeVar("T")
OF_MACHINE: dict[MachineKind, str] = {
    "real": "seed IS NULL AND NOT served",
    "served": "seed IS NULL AND served",
    "simulated": "seed IS NOT NULL",
}
_READ = """r.run_id, procedure, rig, uut, started, seed, visit, outcome, name, quantity, place, unit, data, settings, firmware,
    calibrations, parameters, certificates, served, overdue"""
DATA = 12  # its place there


def add(run_dir: Path) -> None:
    """Put a run into the index of the directory that holds it, or bring its lines up to date.

    Raises:
        ConfigError: it holds no readable record.
    """
    from bench.run.indexed import row

    found = row(RunDirectory(run_dir.resolve()))
    on_disk(run_dir.resolve().parent, lambda db: put(db, found))


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
        return [IndexEntry._make(row) for row in _read(root, lambda db, there: _there(db, query, values, last, there))]


def listing(
    root: Path, *, procedure: str | None = None, rig: str | None = None, failed: bool = False, last: int | None = None,
    machine: MachineKind | None = None, timed: bool = False,
) -> tuple[list[tuple[Any, ...]], dict[int, Kind]]:  # fmt: skip
    """What `entries` gives, quicker of very many runs: of each its name, its number and that of its kind, `timed` with its
    beginning and end; and all kinds by their numbers."""
    if not root.is_dir():
        return [], {}
    where, values = _chosen(procedure, rig, failed, machine)
    wanted = f"WHERE kind IN (SELECT kind FROM kinds {where})" if where else ""
    times = ", started, ended" if timed else ""
    query = f"SELECT run_id, run, kind{times} FROM runs {wanted} ORDER BY started {{0}}, run_id {{0}}"
    with uncollected():
        return _read(root, lambda db, there: (_there(db, query, values, last, there), _kinds(db)))


def kinds(root: Path) -> list[Kind]:
    """Of what kinds the runs in `root` are."""
    if not root.is_dir():
        return []
    return _read(root, lambda db, there: list(_kinds(db, "WHERE kind IN (SELECT kind FROM runs)").values()))


def _kinds(db: sqlite3.Connection, where: str = "", values: tuple[str | int, ...] = ()) -> dict[int, Kind]:
    found = db.execute(f"SELECT kind, {KIND} FROM kinds {where}", values)
    return {number: Kind._make(kind) for number, *kind in found}


def results(
    root: Path, *, quantity: str | None = None, procedure: str | None = None, rig: str | None = None, failed: bool = False,
    last: int | None = None, of: Sequence[str] | None = None, machine: MachineKind | None = None, seed: int | None = None,
) -> list[Result]:  # fmt: skip
    """Results of the runs in `root`, oldest run first, in the record's order within a run; those deleted since left out.

    Args:
        quantity: a name of the record (`K_i`, `B@by the speed channel`), or by kind and place (`K@inboard`); a kind alone is
            all that is measured of it, where nothing has that very name.
        last: the newest so many runs that have any.
        of: the names of some runs: of these alone.
        seed: of this virtual machine alone.
    """
    if not root.is_dir():
        return []
    where, values = _chosen(procedure, rig, failed, machine, of, seed)
    # The newest few are found by going back through the runs, all of a series where they lie together.
    tables = "runs r CROSS JOIN results s ON s.run = r.run" if last or of else "results s JOIN runs r USING (run)"
    tables += " JOIN kinds USING (kind) JOIN names n ON n.number = s.number JOIN made_with USING (made)"

    def asked(db: sqlite3.Connection, there: set[str] | None) -> list[tuple[Any, ...]]:
        named = "" if quantity is None else f" AND {_named(db, quantity)}"
        query = (f"SELECT {_READ} FROM {tables} {where or 'WHERE 1'}{named} "
                 "ORDER BY started {0}, r.run_id {0}, ordinal {0}")  # fmt: skip
        return _there(db, query, values, last if of is None else len(of), there)

    with uncollected():
        return [_result(row, root) for row in _read(root, asked)]


def _result(row: tuple[Any, ...], root: Path) -> Result:
    data = json.loads(row[DATA])
    return Result._make((*row[:DATA], *(data[key] for key in NUMBERS), *row[DATA + 1 :], root))


def shown(
    root: Path, quantity: str, *, as_json: bool = False, runs: Sequence[int] | None = None
) -> dict[str, dict[int, str]]:
    """What runs have measured of a quantity, as text or as JSON: by name, of which one word may mean several, and by the number
    of the run; with `runs` of these alone."""

    def asked(db: sqlite3.Connection) -> dict[str, dict[int, str]]:
        called = dict(db.execute("SELECT number, name FROM names"))
        column, of = (
            "data" if as_json else "told",
            "" if runs is None else "AND run IN (SELECT value FROM json_each(?))",
        )
        values = () if runs is None else (json.dumps(list(runs)),)
        found: dict[str, dict[int, str]] = {}
        for number in _meant(db, quantity):
            query = f"SELECT run, {column} FROM results NOT INDEXED WHERE number = {number} {of}"
            if texts := dict(db.execute(query, values)):
                found.setdefault(called[number], {}).update(texts)
        return found

    with uncollected():
        return answered(root, asked) if root.is_dir() else {}


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

    return answered(root, asked) if root.is_dir() else found


def names(root: Path) -> list[str]:
    """The names that results have in `root`, and what they are called by kind and place, in order."""
    if not root.is_dir():
        return []
    query = "SELECT name FROM names UNION SELECT full FROM names ORDER BY 1"
    return _read(root, lambda db, there: [str(name) for (name,) in db.execute(query)])


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
    procedure: str | None, rig: str | None, failed: bool, machine: MachineKind | None, of: Sequence[str] | None = None,
    seed: int | None = None,
) -> tuple[str, tuple[str | int, ...]]:  # fmt: skip
    """The condition of a query for runs, with its values."""
    asked: dict[str, str | int | None] = {"procedure = ?": procedure, "rig = ?": rig, "seed = ?": seed}
    conditions = [text for text, value in asked.items() if value is not None]
    values = tuple(v for v in asked.values() if v is not None)
    conditions += [f"outcome NOT IN {SOUND}"] if failed else []
    conditions += [OF_MACHINE[machine]] if machine is not None else []
    if of is not None:
        conditions.append("r.run_id IN (SELECT value FROM json_each(?))")
        values = (*values, json.dumps(list(of)))
    return f"WHERE {' AND '.join(conditions)}" if conditions else "", values


def _there(
    db: sqlite3.Connection, query: str, values: tuple[str | int, ...], last: int | None, there: set[str] | None
) -> list[tuple[Any, ...]]:
    """Rows of runs that are still there, oldest first; of so many runs at most. `query` has `{0}` for the order; `there` are
    the names in the folder, where the index has others."""
    found = db.execute(query.format("ASC" if last is None else "DESC"), values)
    rows = found if there is None else (row for row in found if row[0] in there)
    if last is None:
        return list(rows)
    newest = [list(of_run) for _, of_run in islice(groupby(rows, key=itemgetter(0)), min(last, sys.maxsize))]
    return [row for of_run in reversed(newest) for row in reversed(of_run)]


def _read(root: Path, ask: Callable[[sqlite3.Connection, set[str] | None], T]) -> T:
    """As `answered`, of all runs that are there and no others: `ask` has what `take_in` found."""
    return answered(root, lambda db: ask(db, take_in(db, root)))
