"""Exports: every sample of every channel in each format, whole files or none, and the run untouched."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asammdf import MDF
from mcap.reader import make_reader
from pyarrow import parquet
from recordings import HEADER, PERIOD_NS, START_NS, STREAM, SetClock, block, gapped, record
from test_recorder import messages_of

from bench import rundir
from bench.errors import BenchError, ConfigError, RecordingError
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.run.export import export


@pytest.fixture
def run(tmp_path: Path) -> Path:
    path = tmp_path / "amb-calibration-20260101T000000Z-0000"
    path.mkdir()
    record(path / "recording.mcap", gapped())
    return path


def written(name: str) -> np.ndarray[Any, Any]:
    return np.concatenate([b.columns[name] for b in gapped()]).astype(np.float32)


INDEX = np.r_[0:1200, 1205:2305]


NAMES = ["t_s", "t_ns", "index", "tick", "pos_yi", "i_yi_p", "state", "step", "step_kind"]


def test_parquet_holds_every_sample_with_its_unit(run: Path, tmp_path: Path) -> None:
    files = export(run, "parquet", tmp_path / "out" / "deep")
    assert [f.name for f in files] == ["telemetry.parquet", "steps.parquet", "events.parquet", "columns.parquet"]
    table = parquet.read_table(files[0])
    assert table.schema.names == NAMES
    assert np.array_equal(table["index"], INDEX)
    assert np.array_equal(table["t_s"], INDEX / 1000)
    assert np.array_equal(table["t_ns"], START_NS + INDEX * 1_000_000)
    assert np.array_equal(table["tick"], INDEX * 10)
    for name in ("pos_yi", "i_yi_p", "state"):
        assert np.array_equal(table[name], written(name)), name
    assert table.schema.field("pos_yi").metadata == {b"unit": b"m"}
    events = parquet.read_table(files[2]).to_pylist()
    assert len(events) == 48
    assert events[0] == {"t_s": 0.0, "t_ns": START_NS, "kind": "state", "data": '{"now": "LEVITATED", "note": ""}'}


def test_csv_has_the_same_columns_and_a_table_of_their_units(run: Path) -> None:
    files = export(run, "csv")
    assert files[0] == run / "export" / "telemetry.csv"
    with files[0].open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == NAMES
    assert np.array_equal(np.array([row[4] for row in rows], np.float32), written("pos_yi"))
    with (run / "export" / "columns.csv").open(newline="") as file:
        units = {(row["table"], row["column"]): row["unit"] for row in csv.DictReader(file)}
    assert {units["telemetry", name] for name in ("pos_yi", "i_yi_p", "t_s", "t_ns")} == {"m", "A", "s", "ns"}
    assert [name for _, name in units] == NAMES


def test_samples_say_in_which_step_they_lie(run: Path) -> None:
    """23 steps of 100 samples, one after the other; five samples are missing between the twelfth and the thirteenth."""
    telemetry, steps, *_ = export(run, "parquet")
    table = parquet.read_table(telemetry)
    assert np.array_equal(table["step"], np.repeat(np.arange(23), 100))
    assert set(table["step_kind"].to_pylist()) == {"dwell"}
    rows = parquet.read_table(steps).to_pylist()
    assert rows[12] == {
        "step": 12, "kind": "dwell", "start_s": 1.205, "end_s": 1.305, "start_ns": START_NS + 1_205_000_000,
        "end_ns": START_NS + 1_305_000_000, "block": 12.0, "odd": False,
    }  # fmt: skip


def test_the_innermost_step_counts_and_outside_of_all_there_is_none(tmp_path: Path) -> None:
    path = tmp_path / "amb-calibration-20260101T000000Z-0002"
    path.mkdir()
    clock = SetClock()
    with Recorder(path / "recording.mcap", clock=clock, streams=[STREAM], header=HEADER, plain=True) as recorder:
        recorder.samples(block(0, 10))
        clock.now = START_NS + 10 * PERIOD_NS
        with recorder.step("outer", load="M1", mixed=1):
            recorder.samples(block(10, 10))
            clock.now = START_NS + 20 * PERIOD_NS
            with recorder.step("inner", step="label", mixed="two"):
                recorder.samples(block(20, 10))
                clock.now = START_NS + 30 * PERIOD_NS
            recorder.samples(block(30, 10))
            clock.now = START_NS + 40 * PERIOD_NS
        recorder.samples(block(40, 5))
    telemetry, steps, *_ = export(path, "parquet")
    numbers = parquet.read_table(telemetry)["step"].to_pylist()
    assert numbers == [None] * 10 + [0] * 10 + [1] * 10 + [0] * 10 + [None] * 5
    rows = parquet.read_table(steps).to_pylist()
    assert [(r["load"], r["mixed"], r["kind"], r["step_label"]) for r in rows] == [
        ("M1", "1", "outer", None), (None, "two", "inner", "label"),
    ]  # fmt: skip


def test_mdf_holds_every_sample_with_its_unit(run: Path) -> None:
    """Read by the library that others read MDF with; it writes it too, and what it wrote is compared with the recording."""
    (path,) = export(run, "mdf")
    with MDF(path) as file:
        for name in ("pos_yi", "i_yi_p", "state"):
            signal = file.get(name)
            assert np.array_equal(signal.samples, written(name)), name
            assert np.array_equal(signal.timestamps, INDEX / 1000)
        assert file.get("pos_yi").unit == "m"
        assert np.array_equal(file.get("step").samples, np.repeat(np.arange(23), 100))
        assert file.header.start_time.timestamp() == START_NS / 1e9


def test_mcap_holds_one_scalar_message_per_sample(run: Path) -> None:
    (path,) = export(run, "mcap")
    found = messages_of(path)
    assert set(found) == {"/telemetry/sample", "/events"}
    assert [t for t, _ in found["/telemetry/sample"]] == (START_NS + INDEX * 1_000_000).tolist()
    for name in ("pos_yi", "i_yi_p", "state"):
        assert np.array_equal([getattr(m, name) for _, m in found["/telemetry/sample"]], written(name)), name
    assert [m for _, m in found["/events"]] == Recording.open(run / "recording.mcap").events()
    with path.open("rb") as file:
        (told,) = make_reader(file, validate_crcs=True).iter_metadata()
    assert told.metadata["sha256"] == Recording.open(run / "recording.mcap").digest()


def test_an_export_is_not_taken_for_a_recording(run: Path) -> None:
    (path,) = export(run, "mcap")
    with pytest.raises(RecordingError, match="no Levbench recording"):
        Recording.open(path)


@pytest.mark.parametrize("to", ["parquet", "csv", "mcap"])
def test_a_second_export_replaces_the_first_and_the_run_is_untouched(run: Path, to: Any) -> None:
    before = (run / "recording.mcap").read_bytes()
    first = {f: f.read_bytes() for f in export(run, to)}
    assert {f: f.read_bytes() for f in export(run, to)} == first
    assert (run / "recording.mcap").read_bytes() == before
    assert not list((run / "export").glob("*.part"))


@pytest.mark.parametrize("to", ["parquet", "csv", "mcap"])
def test_a_truncated_recording_gives_what_there_is(run: Path, to: Any) -> None:
    path = run / "recording.mcap"
    path.write_bytes(path.read_bytes()[:-9000])
    assert Recording.open(path).truncated
    for file in export(run, to):
        assert file.stat().st_size > 100


def test_what_cannot_be_exported_is_said(run: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        export(tmp_path / "absent", "csv")
    (tmp_path / "file").write_text("precious")
    with pytest.raises(BenchError, match=r"file: cannot be written: .*; the run is untouched"):
        export(run, "csv", tmp_path / "file")
    assert (tmp_path / "file").read_text() == "precious"
    assert rundir.existing(run).recording.is_file()


def test_parquet_has_few_row_groups(tmp_path: Path) -> None:
    """Not one for each block: every row group repeats a description of every column."""
    path = tmp_path / "amb-calibration-20260101T000000Z-0001"
    path.mkdir()
    clock = SetClock()
    with Recorder(path / "recording.mcap", clock=clock, streams=[STREAM], header=HEADER, plain=True) as recorder:
        for first in range(0, 150_000, 500):
            recorder.samples(block(first, 500))
    table = parquet.ParquetFile(export(path, "parquet")[0])
    assert table.metadata.num_rows == 150_000
    assert [table.metadata.row_group(k).num_rows for k in range(table.num_row_groups)] == [66000, 66000, 18000]
