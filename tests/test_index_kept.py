"""What the index keeps: runs that are there, and results as they are told."""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from test_index import measuring, outcomes, run

from bench.history.naming import run_named
from bench.run import index
from bench.run.index import _there
from bench.run.indexstore import take_in


def test_deleted_runs_are_taken_out_and_come_back_with_their_results(tmp_path: Path) -> None:
    paths = [measuring(tmp_path, second, 70.0 + second) for second in (1, 2, 3)]
    os.utime(tmp_path, ns=(0, 10**18))
    assert len(outcomes(tmp_path)) == 3
    moved = shutil.move(paths[1], tmp_path / "kept-elsewhere")
    os.utime(tmp_path, ns=(0, 2 * 10**18))
    assert [r.value for r in index.results(tmp_path, quantity="K_i")] == [71.0, 73.0]
    with closing(sqlite3.connect(tmp_path / index.NAME)) as db:
        assert db.execute("SELECT count(*), count(DISTINCT run) FROM results").fetchone() == (6, 2)
    shutil.move(moved, paths[1])
    os.utime(tmp_path, ns=(0, 3 * 10**18))
    assert [r.value for r in index.results(tmp_path, quantity="K_i", last=2)] == [72.0, 73.0]


def test_an_index_that_cannot_be_written_answers_without_runs_deleted_since(tmp_path: Path) -> None:
    for second in (1, 2, 3):
        index.add(run(tmp_path, second))
    shutil.rmtree(run(tmp_path, 2))
    with closing(sqlite3.connect(tmp_path / index.NAME)) as other:
        other.execute("BEGIN IMMEDIATE")  # as long as somebody writes, nobody else can
        db = sqlite3.connect(tmp_path / index.NAME, timeout=0.0)
        with closing(db):
            there = take_in(db, tmp_path)
            query = "SELECT run_id FROM runs ORDER BY run_id {0}"
            found = [_there(db, query, (), last, there) for last in (None, 1, 2, 3)]
    listed = [[run_id[-7:-5] for (run_id,) in runs] for runs in found]
    assert listed == [["1Z", "3Z"], ["3Z"], ["1Z", "3Z"], ["1Z", "3Z"]]


def test_a_folder_that_can_have_no_index_is_read_all_the_same(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A share or a medium that cannot be written; here a folder has the index's name."""
    paths = [measuring(tmp_path, second, 70.0 + second) for second in (1, 2, 3)]
    kept = shutil.move(paths[2], tmp_path.parent / "kept")
    (tmp_path / index.NAME).unlink()
    (tmp_path / index.NAME).mkdir()
    assert [r.value for r in index.results(tmp_path, quantity="K_i")] == [71.0, 72.0]
    assert run_named("last~1", tmp_path).path == paths[0]
    shutil.move(kept, paths[2])
    shutil.rmtree(paths[0])
    found, _ = index.listing(tmp_path)
    assert [index.shown(tmp_path, "K_i", runs=[number])["K_i"][number][:2] for _, number, _ in found] == ["72", "73"]
    assert len(caplog.messages) == 1
    assert "index.sqlite: unable to open database file: the records are read instead" in caplog.text
    with pytest.raises(sqlite3.OperationalError):
        index.add(paths[1])


def test_what_is_told_of_a_result_is_that_of_this_version(tmp_path: Path) -> None:
    """The index keeps results as they are told: where another text is right from now on, VERSION is raised, so that all are
    told anew."""
    measuring(tmp_path, 1, 71.0)
    told = [text for of_run in index.shown(tmp_path, "K_i").values() for text in of_run.values()]
    assert (index.VERSION, told) == (8, ["71.00 ± 0.21 N/A"])
