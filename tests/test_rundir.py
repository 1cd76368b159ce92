"""Run directories: exclusive, never overwritten, told apart from other directories."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

import pytest

from bench import rundir
from bench.errors import ConfigError

AT = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)


def test_the_name_is_procedure_utc_and_four_hex_digits(tmp_path: Path) -> None:
    run = rundir.create(tmp_path / "new" / "runs", "amb-calibration", AT)
    assert re.fullmatch(r"amb-calibration-20260304T050607Z-[0-9a-f]{4}", run.run_id)
    assert run.path.is_dir()
    assert ":" not in run.run_id


def test_a_taken_name_is_never_used_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = iter(["aaaa", "aaaa", "bbbb"])
    monkeypatch.setattr("secrets.token_hex", lambda _: next(names))
    first = rundir.create(tmp_path, "p", AT)
    (first.path / "record.json").write_text("precious")
    second = rundir.create(tmp_path, "p", AT)
    assert second.run_id.endswith("bbbb")
    assert first.record.read_text() == "precious"


@pytest.mark.parametrize("out", ["file", "file/runs"])
def test_a_file_in_the_path_is_a_clear_error(tmp_path: Path, out: str) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(ConfigError, match="no run directory can be made there"):
        rundir.create(tmp_path / out, "p", AT)
    assert (tmp_path / "file").read_text() == "x"


def test_two_analyses_in_one_second_do_not_meet(tmp_path: Path) -> None:
    run = rundir.create(tmp_path, "p", AT)
    first, second = rundir.create_analysis(run, AT), rundir.create_analysis(run, AT)
    assert first != second
    assert first.name == "20260304T050607Z"


def test_what_is_no_run_directory_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="found nothing"):
        rundir.existing(tmp_path / "absent")
    with pytest.raises(ConfigError, match="neither recording"):
        rundir.existing(tmp_path)
    (tmp_path / "record.json").write_text("{}")
    with pytest.raises(ConfigError, match="found a file"):
        rundir.existing(tmp_path / "record.json")
    assert rundir.existing(tmp_path).record == tmp_path.resolve() / "record.json"


def test_runs_are_found_by_their_names(tmp_path: Path) -> None:
    run = rundir.create(tmp_path, "amb-calibration", AT)
    (tmp_path / "notes").mkdir()
    (tmp_path / "p-20260304T050607Z-aaaa").write_text("a file")
    assert [r.run_id for r in rundir.runs_in(tmp_path)] == [run.run_id]
    assert list(rundir.runs_in(tmp_path / "absent")) == []
