"""Runs of a machine beside those of its twin, served or simulated: no chart and no listing has both as one."""

from __future__ import annotations

import dataclasses
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_histories import record

from bench.cli.__main__ import main
from bench.record.outcomes import Outcome
from bench.record.records import read_record, write_record
from bench.record.told import with_unit
from bench.run import index

Bench = tuple[int, str, str]


def told(capsys: pytest.CaptureFixture[str], *words: str) -> Bench:
    status = main(list(words))
    return status, *capsys.readouterr()


def trend_of(capsys: pytest.CaptureFixture[str], root: Path, *words: str) -> tuple[list[float], dict[str, int], str]:
    status, out, err = told(capsys, "trend", "K_i", "--out", str(root), "--json", *words)
    assert status == 0, err
    data = json.loads(out)
    values = [run["value"] for segment in data["segments"] for run in segment["runs"]]
    return values, data["left_out"], data["machine_kind"]


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """Real, served and simulated runs by turns, told apart by their values; the newest are of no real machine."""
    for k in range(4):
        record(tmp_path, 4 * k, 75 + k / 10)
        record(tmp_path, 4 * k + 1, 76 + k / 10, served=True)
        record(tmp_path, 4 * k + 2, 77 + k / 10, seed=3)
        record(tmp_path, 4 * k + 3, 78 + k / 10, seed=4)
    return tmp_path


def test_a_trend_is_of_the_real_machine_and_says_what_is_left_out(
    mixed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values, left_out, kind = trend_of(capsys, mixed)
    assert (values, kind) == ([75.0, 75.1, 75.2, 75.3], "real")
    assert left_out == {"broken": 0, "repeated": 0, "twins": 12}
    text = told(capsys, "trend", "K_i", "--out", str(mixed))[1]
    assert "12 of simulations left out (--machine)" in " ".join(text.split())
    assert trend_of(capsys, mixed, "--last", "2")[0] == [75.2, 75.3]  # of the newest three runs none is real


def test_the_twin_is_followed_where_it_is_asked_for(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert trend_of(capsys, mixed, "--machine", "served")[0] == [76.0, 76.1, 76.2, 76.3]
    assert trend_of(capsys, mixed, "--machine", "simulated", "--seed", "4")[0] == [78.0, 78.1, 78.2, 78.3]
    assert trend_of(capsys, mixed, "--seed", "3")[0] == [77.0, 77.1, 77.2, 77.3]
    assert trend_of(capsys, mixed, "--seed", "3", "--last", "2")[0] == [77.2, 77.3]
    assert (
        "older ones are neither shown"
        in told(capsys, "trend", "K_i", "--out", str(mixed), "--seed", "3", "--last", "2")[1]
    )
    assert "older" not in told(capsys, "trend", "K_i", "--out", str(mixed), "--seed", "3", "--last", "4")[1]


def test_what_is_several_machines_is_refused_by_what_tells_them_apart(
    mixed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--out", str(mixed))
    assert "Next: add --seed N" in told(capsys, "trend", "K_i", *out, "--machine", "simulated")[2]
    status, _, err = told(capsys, "trend", "K_i", *out, "--machine", "served", "--seed", "3")
    assert (status, "leave --machine out" in err) == (2, True)
    assert told(capsys, "trend", "K_i", *out, "--machine", "true")[0] == 2
    twins = tmp_path / "twins"
    for k in range(4):
        record(twins, k, 75.0, served=k < 2, seed=None if k < 2 else 3)
    status, _, err = told(capsys, "trend", "K_i", "--out", str(twins))
    assert status == 2
    assert "several of machine: tsbs12 (served simulation) (2 runs); tsbs12 (seed 3) (2 runs)" in err
    assert "Next: add --machine served or simulated" in err
    index.add(record(twins, 5, 75.0))
    err = told(capsys, "trend", "K_i", "--out", str(twins))[2]
    assert "found 1 run with a value" in err
    assert "follow its twin, which has 4 runs, by --machine served or simulated" in err


def test_a_run_without_a_value_is_no_other_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A trial on the served twin that was stopped leaves the trend of the virtual machine as it was."""
    for k in range(3):
        record(tmp_path, k, 75.0 + k / 10, seed=3)
    path = record(tmp_path, 3, 75.0, served=True) / "record.json"
    stopped = dataclasses.replace(read_record(path), outcome=Outcome.ABORTED)
    write_record(path, stopped)
    values, left_out, _ = trend_of(capsys, tmp_path)
    assert (values, left_out["broken"]) == ([75.0, 75.1, 75.2], 0)
    write_record(path, dataclasses.replace(stopped, seed=3, visit=9, findings=()))
    index.rebuild(tmp_path)
    values, left_out, _ = trend_of(capsys, tmp_path)
    assert (values, left_out["broken"]) == ([75.0, 75.1, 75.2], 1)


def test_a_listing_says_and_chooses_what_each_run_was_made_on(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ("--out", str(mixed))
    for machine, words in (("real", ""), ("served", "served simulation"), ("simulated", "seed ")):
        lines = told(capsys, "runs", *out, "--machine", machine)[1].splitlines()
        found = json.loads(told(capsys, "runs", *out, "--machine", machine, "--json", "--show", "K_i")[1])
        assert len(lines) == len(found) == (8 if machine == "simulated" else 4)
        assert {run["machine"] for run in found} == {machine}
        assert all(words in line for line in lines)
        assert [line.rpartition("/")[2] for line in lines] == [run["run_id"] for run in found]
        assert all(run["results"]["K_i"]["value"] for run in found)
    assert told(capsys, "runs", *out, "--machine", "served", "--failed")[2].endswith("that are as asked for\n")


def test_two_runs_counted_back_are_of_one_machine(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, "runs", "--out", str(mixed))  # makes the index
    index.add(record(mixed, 16, 75.4))
    status, out, err = told(capsys, "compare", "last~1", "last", "--out", str(mixed), "--json")
    assert status == 0, err
    found = json.loads(out)
    assert (found["a"]["machine"], found["b"]["machine"], found["one_machine"]) == ("real", "real", True)
    assert found["differences"][0]["difference"] == pytest.approx(75.4 - 75.3)
    names = sorted(path.name for path in mixed.glob("amb-*"))
    _, out, _ = told(capsys, "compare", names[0], names[1], "--out", str(mixed))
    assert "tsbs12 7, served simulation" in " ".join(out.split())
    assert "a real machine and a served one: nothing that is certified is the same in both" in " ".join(out.split())


def test_an_index_of_the_version_before_is_made_anew(mixed: Path) -> None:
    with closing(sqlite3.connect(mixed / index.NAME)) as db, db:
        db.execute("CREATE TABLE runs (run INTEGER PRIMARY KEY, run_id, rig, seed, served)")
        db.execute("PRAGMA user_version = 4")
    assert [e.machine for e in index.entries(mixed)] == ["real", "served", "simulated", "simulated"] * 4


@settings(max_examples=25)
@given(
    st.sampled_from([None, "real", "served", "simulated"]), st.sampled_from([None, "tsbs12", "other"]), st.booleans(),
    st.sampled_from([None, 1, 3, 40]),
)  # fmt: skip
def test_a_quick_listing_has_what_the_entries_have(
    standing: Path, machine: index.MachineKind | None, rig: str | None, failed: bool, last: int | None
) -> None:
    found, kinds = index.listing(standing, rig=rig, failed=failed, last=last, machine=machine, timed=True)
    entries = index.entries(standing, rig=rig, failed=failed, last=last, machine=machine)
    assert [(n, kinds[k], s, e) for n, _, k, s, e in found] == [(x.run_id, x.kind, x.started, x.ended) for x in entries]


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    for k in range(6):
        record(root, k, 75.0, seed=(None, 3)[k % 2], served=k % 3 == 0 and k % 2 == 0)
    return root


@pytest.mark.parametrize("few", [True, False])
def test_what_is_listed_of_results_is_what_the_records_say(few: bool, mixed: Path) -> None:
    """To the last bit, although the index keeps texts: 75 + 4 / 3 has all digits that a number can have."""
    record(mixed, 16, 75 + 4 / 3)
    listed, _ = index.listing(mixed)
    runs = [number for _, number, _ in listed] if few else None
    (texts,), (data,) = (index.shown(mixed, "K_i", as_json=k, runs=runs).values() for k in (False, True))
    for run_id, number, _ in listed:
        m = next(m for m in read_record(mixed / run_id / "record.json").measurements if m.name == "K_i")
        assert m.value is not None
        assert m.expanded_uncertainty is not None
        assert texts.pop(number) == with_unit(m.value, m.expanded_uncertainty, m.unit)
        low, high = (m.limit.low, m.limit.high) if m.limit else (None, None)
        assert json.loads(data.pop(number)) == {
            "value": m.value, "unit": m.unit, "standard_uncertainty": m.standard_uncertainty,
            "expanded_uncertainty": m.expanded_uncertainty, "dof": m.dof, "coverage_probability": m.coverage_probability,
            "low": low, "high": high, "verdict": str(m.verdict),
        }  # fmt: skip
    assert (texts, data) == ({}, {})
    assert index.shown(mixed, "Q") == {}
    assert index.shown(mixed, "K_i", runs=[]) == {}
