"""The index of runs."""

from __future__ import annotations

import dataclasses
import itertools
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from bench import lock
from bench.cli.runs import RunsRequest, runs_command
from bench.errors import ConfigError
from bench.findings import CERTIFICATE_OVERDUE, SIMULATED_CONTROLLER, Finding
from bench.quantity import Quantity
from bench.record.limits import Limit
from bench.record.outcomes import Outcome
from bench.record.records import findings_of, measurement, missing, read_record, unfinished, write_record
from bench.record.setup import Certified, Setup
from bench.rigfile.certificates import OutOfDate
from bench.rigfile.elements import Certificate
from bench.run import index
from bench.run.indexstore import take_in
from bench.uncertainty import Estimate, Influence


def run(root: Path, second: int, outcome: Outcome = Outcome.PASS) -> Path:
    path = root / f"amb-calibration-20260101T0000{second:02}Z-3f2a"
    path.mkdir(exist_ok=True, parents=True)
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
    runs_command(RunsRequest(tmp_path))
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


def test_an_index_with_other_tables_is_rebuilt(tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    with closing(sqlite3.connect(tmp_path / index.NAME)) as db, db:
        db.execute("ALTER TABLE kinds RENAME COLUMN rig TO stand")
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


@pytest.mark.parametrize("key", ["seed", "visit"])
def test_a_number_that_no_table_holds_leaves_out_its_run_alone(key: str, tmp_path: Path) -> None:
    run(tmp_path, 1)
    path = run(tmp_path, 2) / "record.json"
    numbers = {"seed": 3, "visit": 0, key: 2**63}
    write_record(path, dataclasses.replace(read_record(path), **numbers))
    (message,) = index.rebuild(tmp_path)
    assert f"{path}: {key}: found 9223372036854775808; expected 9223372036854775807 at most" in message
    assert outcomes(tmp_path) == ["PASS"]
    assert [e.run_id for e in index.entries(tmp_path, last=10**20)] == [run(tmp_path, 1).name]
    numbers[key] -= 1
    write_record(path, dataclasses.replace(read_record(path), **numbers))
    index.add(path.parent)
    assert [getattr(e, key) for e in index.entries(tmp_path, last=1)] == [2**63 - 1]


def test_deleted_runs_are_not_listed(tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    shutil.rmtree(run(tmp_path, 1))
    assert outcomes(tmp_path) == []
    assert index.entries(tmp_path / "nothing") == []


def test_runs_that_nobody_put_in_are_listed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Of a process that was killed, or copied from elsewhere: once the folder is listed, and again when it has changed."""
    index.add(run(tmp_path, 1))
    run(tmp_path, 2, Outcome.ERROR)
    assert outcomes(tmp_path) == ["PASS", "ERROR"]
    os.utime(tmp_path, ns=(0, 10**18))  # long ago: as if nothing had changed since
    assert outcomes(tmp_path) == ["PASS", "ERROR"]
    (tmp_path / "amb-calibration-20260101T000003Z-3f2a").mkdir()
    assert outcomes(tmp_path) == ["PASS", "ERROR"]
    assert "000003Z-3f2a: left out of the index" in caplog.text
    copied = measuring(tmp_path / "elsewhere", 4, 71.0)
    shutil.move(copied, tmp_path / copied.name)
    assert [r.value for r in index.results(tmp_path, quantity="K_i")] == [71.0]
    assert outcomes(tmp_path) == ["PASS", "ERROR", "PASS"]


def test_a_folder_that_has_not_changed_is_not_listed_again(tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    os.utime(tmp_path, ns=(0, 10**18))
    assert outcomes(tmp_path) == ["PASS"]
    run(tmp_path, 2)
    os.utime(tmp_path, ns=(0, 10**18))  # as no folder is that got a new entry
    assert outcomes(tmp_path) == ["PASS"]
    os.utime(tmp_path, ns=(0, 2 * 10**18))
    assert outcomes(tmp_path) == ["PASS", "PASS"]


@pytest.mark.parametrize("rebuilt", [False, True])
def test_a_run_that_goes_on_is_listed_when_it_has_ended(rebuilt: bool, tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    going = run(tmp_path, 2, Outcome.ERROR)
    (going / "recording.mcap").touch()
    os.utime(tmp_path, ns=(0, 10**18))
    with (going / "recording.mcap").open("rb") as file:
        lock.hold(file.fileno())
        if rebuilt:
            index.rebuild(tmp_path)
        assert outcomes(tmp_path) == ["PASS"]
        os.utime(tmp_path, ns=(0, 10**18))
        assert outcomes(tmp_path) == ["PASS"]
    assert outcomes(tmp_path) == ["PASS", "ERROR"]  # its process was killed: nothing has changed in the folder


def test_an_index_that_cannot_be_written_answers_without_them(tmp_path: Path) -> None:
    index.add(run(tmp_path, 1))
    run(tmp_path, 2)
    read_only = f"file:{tmp_path / index.NAME}?mode=ro"
    with closing(sqlite3.connect(read_only, uri=True)) as db:
        there = take_in(db, tmp_path)
        assert db.execute("SELECT count(*) FROM runs").fetchone() == (1,)
    assert there == set(os.listdir(tmp_path))
    assert outcomes(tmp_path) == ["PASS", "PASS"]


def measuring(
    root: Path, second: int, value: float, *, setup: Setup | None = None, plan: int = 9, rig: str = "tsbs12"
) -> Path:
    """A run that measured K_i, which rests on a gain where the record says with what, and B at one place beside another."""
    path = run(root, second)
    estimate = Estimate.of(value, Influence("scatter/1", "scatter", 0.1, "N/A", "A", "normal", 20.0))
    gain = Estimate(
        0.0, "N/A", {} if setup is None else {Influence("sensors/i/gain", "gain", 1e-3, "1", "B", "normal"): 1.0}
    )
    force, drag = Quantity("K_i", "N/A", "force constant"), Quantity("B", "N/A", "drag")
    made = [
        measurement(force.measured(estimate + gain), Limit(70.0, None, "N/A", "design", True)),
        measurement(drag.measured(estimate), None),
        measurement(drag.measured(estimate, "by the channel"), None),
    ]
    record = read_record(path / "record.json")
    write_record(path / "record.json", dataclasses.replace(record, measurements=tuple(made), rig=rig, setup=setup,
                                                           plan={"angles": plan, "rounds": None}))  # fmt: skip
    index.add(path)
    return path


def setup_with(bias: float = 3.0, gain: float = 1.0) -> Setup:
    return Setup("ab" * 32, "protocol 1", {"bias_i": bias}, {"K_i": "K@inboard"},
                 {"sensors/i/gain": Certified(gain, 1e-3, "1", "rectangular", "SIM-1")})  # fmt: skip


def test_results_are_those_of_the_records(tmp_path: Path) -> None:
    paths = [measuring(tmp_path, second, 70.0 + second) for second in (2, 1, 3)]
    found = index.results(tmp_path, quantity="K_i")
    assert [(r.value, r.path) for r in found] == [(71.0, paths[1]), (72.0, paths[0]), (73.0, paths[2])]
    first = found[0]
    assert (first.lower, first.upper, first.verdict, first.p) == (70.0, None, "pass", 0.95)
    assert (first.u, first.dof, first.unit) == (0.1, 20.0, "N/A")
    assert first.U is not None
    assert abs(first.U - 0.2086) < 1e-5  # t of 20 degrees of freedom: GUM table G.2
    assert [r.value for r in index.results(tmp_path, quantity="K_i", last=2)] == [72.0, 73.0]
    shutil.rmtree(paths[2])
    assert [r.value for r in index.results(tmp_path, quantity="K_i", last=2)] == [71.0, 72.0]


def test_a_name_means_itself_before_all_that_is_of_its_kind(tmp_path: Path) -> None:
    measuring(tmp_path, 1, 71.0)  # by a record that does not say what the rig calls things
    measuring(tmp_path, 2, 72.0, setup=setup_with())
    assert [r.name for r in index.results(tmp_path, quantity="B")] == ["B", "B"]
    assert [r.where for r in index.results(tmp_path, quantity="B@by the channel")] == ["by the channel"] * 2
    for asked in ("K_i", "K@inboard", "K"):
        assert [r.value for r in index.results(tmp_path, quantity=asked)] == [71.0, 72.0]
        assert [*index.shown(tmp_path, asked)] == ["K_i"]
        assert sorted(index.shown(tmp_path, asked)["K_i"].values()) == ["71.00 ± 0.21 N/A", "72.00 ± 0.21 N/A"]
    newer = index.results(tmp_path, quantity="K_i")[1]
    assert (newer.name, newer.quantity, newer.where) == ("K_i", "K", "inboard")
    assert index.results(tmp_path, quantity="Q") == []


def test_runs_and_results_by_procedure_rig_and_outcome(tmp_path: Path) -> None:
    measuring(tmp_path, 1, 71.0)
    measuring(tmp_path, 2, 72.0, rig="other")
    index.add(run(tmp_path, 3, Outcome.ABORTED))
    assert [r.value for r in index.results(tmp_path, quantity="K_i", rig="other")] == [72.0]
    assert [e.outcome for e in index.entries(tmp_path, failed=True)] == ["ABORTED"]
    assert [e.rig for e in index.entries(tmp_path, rig="other", procedure="amb-calibration")] == ["other"]
    assert index.entries(tmp_path, procedure="step") == []
    assert [e.started[-3:] for e in index.entries(tmp_path, last=2)] == ["02Z", "03Z"]


def test_what_makes_another_series_is_told_apart(tmp_path: Path) -> None:
    measuring(tmp_path, 1, 71.0)
    for second, (setup, plan) in enumerate(((setup_with(), 9), (setup_with(2.0), 9), (setup_with(2.0, 1.1), 8)), 2):
        measuring(tmp_path, second, 71.0, setup=setup, plan=plan)
    found = index.results(tmp_path, quantity="K_i")
    changed = [now.changed(before) for before, now in itertools.pairwise(found)]
    assert changed == [(), ("parameters",), ("plan", "certificates")]  # what the oldest does not say has not changed
    drag = index.results(tmp_path, quantity="B")
    assert [n.changed(b) for b, n in itertools.pairwise(drag)] == [(), ("parameters",), ("plan",)]  # rests on no gain


def test_a_run_without_one_of_its_results_has_no_other_certificates(tmp_path: Path) -> None:
    """K_i is missing in the second run, so that nothing of it rests on the gain: B is measured as before."""
    paths = [measuring(tmp_path, second, 71.0, setup=setup_with()) for second in (1, 2, 3)]
    record = read_record(paths[1] / "record.json")
    assert record.setup is not None
    lacking = dataclasses.replace(record.setup, certified={})
    gone = missing(Quantity("K_i", "N/A", "force constant"))
    write_record(
        paths[1] / "record.json",
        dataclasses.replace(record, setup=lacking, measurements=(gone, *record.measurements[1:])),
    )
    index.add(paths[1])
    for quantity in ("B", "K_i"):
        found = index.results(tmp_path, quantity=quantity)
        assert [now.changed(before) for before, now in itertools.pairwise(found)] == [(), ()]


def test_damage_within_the_index_is_seen_where_it_is_read(tmp_path: Path) -> None:
    for second in range(60):
        measuring(tmp_path, second, 71.0)
    whole = (tmp_path / index.NAME).read_bytes()
    (tmp_path / index.NAME).write_bytes(whole[:4096] + b"\xff" * (len(whole) - 4096))
    assert len(index.results(tmp_path, quantity="K_i")) == 60
    assert len(index.entries(tmp_path)) == 60


def test_results_say_which_overdue_certificates_they_rest_on(tmp_path: Path) -> None:
    """Of a result alone what is in its own budget; and nothing of a record that says nothing."""
    span, mass = (Influence(i, i, 1e-3, "1", "B", "normal") for i in ("geometry/amb_span", "masses/M1"))
    made = [
        Quantity(name, "m", "length").measured(Estimate(1.0, "m", {i: 1.0})) for name, i in (("L", span), ("M", mass))
    ]
    late = OutOfDate("span", Certificate(number="SIM-L-102", due="2025-12-31"), False, (span.id, "geometry/other"))
    told = findings_of([Finding(CERTIFICATE_OVERDUE, late.told, "certificates.span")])
    setup = Setup("ab" * 32, "", {}, {})
    found = []
    for second, (setting, findings) in enumerate(((setup, told), (setup, ()), (None, ()))):
        path = run(tmp_path, second)
        record = dataclasses.replace(
            read_record(path / "record.json"), setup=setting, findings=findings,
            measurements=tuple(measurement(m, None) for m in made),
        )  # fmt: skip
        write_record(path / "record.json", record)
    found = [(r.name, r.overdue) for r in index.results(tmp_path)]
    assert found == [("L", "span"), ("M", ""), ("L", ""), ("M", ""), ("L", None), ("M", None)]
