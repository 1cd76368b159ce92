"""The index of runs."""

from __future__ import annotations

import dataclasses
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from bench.cli.runs import runs_command
from bench.errors import ConfigError
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.record.outcomes import Outcome
from bench.record.records import findings_of, read_record, unfinished, write_record
from bench.run import index


def run(root: Path, second: int, outcome: Outcome = Outcome.PASS) -> Path:
    path = root / f"amb-calibration-20260101T0000{second:02}Z-3f2a"
    path.mkdir(exist_ok=True)
    record = unfinished(run_id=path.name, procedure="amb-calibration", rig="tsbs12", uut={}, seed=None, plan={},
                        started=f"2026-01-01T00:00:{second:02}Z", versions={})  # fmt: skip
    write_record(path / "record.json", dataclasses.replace(record, outcome=outcome))
    return path


def outcomes(root: Path) -> list[str]:
    return [e.outcome for e in index.entries(root)]


def test_add_and_bring_up_to_date(tmp_path: Path) -> None:
    index.add(run(tmp_path, 2, Outcome.ERROR))
    index.add(run(tmp_path, 1, Outcome.FAIL))
    assert outcomes(tmp_path) == ["FAIL", "ERROR"]
    index.add(run(tmp_path, 2, Outcome.PASS))
    assert outcomes(tmp_path) == ["FAIL", "PASS"]
    assert index.entries(tmp_path)[0].run_id == "amb-calibration-20260101T000001Z-3f2a"


def test_a_live_run_on_a_simulation_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for second, found in ((1, ()), (2, (Finding(SIMULATED_CONTROLLER, "it says so", "controller"),))):
        path = run(tmp_path, second)
        record = dataclasses.replace(read_record(path / "record.json"), findings=findings_of(found))
        write_record(path / "record.json", record)
        index.add(path)
    assert [bool(e.served) for e in index.entries(tmp_path)] == [False, True]
    runs_command(tmp_path)
    assert ["served simulation" in line for line in capsys.readouterr().out.splitlines()] == [False, True]


def test_missing_or_corrupt_is_rebuilt(tmp_path: Path) -> None:
    run(tmp_path, 1)
    assert outcomes(tmp_path) == ["PASS"]
    for rubbish in (b"rubbish" * 1000, b""):
        (tmp_path / index.NAME).write_bytes(rubbish)
        assert outcomes(tmp_path) == ["PASS"]
        (tmp_path / index.NAME).write_bytes(rubbish)
        index.add(run(tmp_path, 2))
        assert outcomes(tmp_path) == ["PASS", "PASS"]
        shutil.rmtree(run(tmp_path, 2))


def test_an_index_of_before_there_were_visits_is_rebuilt(tmp_path: Path) -> None:
    run(tmp_path, 1)
    with closing(sqlite3.connect(tmp_path / index.NAME)) as db, db:
        db.execute("CREATE TABLE runs (run_id, procedure, rig, outcome, started, ended, seed, PRIMARY KEY (run_id))")
        db.execute("PRAGMA user_version = 1")
    assert outcomes(tmp_path) == ["PASS"]


def test_a_corrupt_run_is_skipped_with_a_message(tmp_path: Path) -> None:
    run(tmp_path, 1)
    broken = run(tmp_path, 2)
    (broken / "record.json").write_text("{")
    (tmp_path / "something-else").mkdir()
    messages = index.rebuild(tmp_path)
    assert len(messages) == 1
    assert broken.name in messages[0]
    assert outcomes(tmp_path) == ["PASS"]
    with pytest.raises(ConfigError):
        index.add(broken)


def test_deleted_runs_are_not_listed(tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    shutil.rmtree(run(tmp_path, 1))
    assert outcomes(tmp_path) == []
    assert index.entries(tmp_path / "nothing") == []
