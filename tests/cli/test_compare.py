"""`bench compare` and `bench runs`: which runs are meant, what is printed, what is refused."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.history.naming import pair_named, run_named
from bench.quantity import Quantity
from bench.record.outcomes import Outcome
from bench.record.records import Record, measurement, unfinished, write_record
from bench.record.setup import Certified, Setup
from bench.run import index
from bench.uncertainty import Estimate, Influence
from tests.cli.in_process import Bench, bench_in_process

GAIN = Influence("sensors/i/gain", "gain of i", 0.002, "1", "B", "normal")
SCATTER = Influence("scatter/yi", "scatter of the hangings", 0.1, "N/A", "A", "normal", 8)
NUMBER = {"type": ["number", "null"]}
PART = {"name", "influence", "in_a", "in_b", "left", "alone", "shared"}


@pytest.fixture
def bench(capsys: pytest.CaptureFixture[str]) -> Bench:
    return bench_in_process(capsys)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one run."""
    folder = tmp_path_factory.mktemp("runs")
    made(folder, 1, 70.0)
    return folder


def made(
    root: Path, day: int, value: float, procedure: str = "amb-calibration", rig: str = "stand", **other: object
) -> Path:
    """A run of that day which measured K_i and, at a long place, a drag."""
    name = f"{procedure}-202601{day:02}T000000Z-{day:04x}"
    certified = {GAIN.id: Certified(1.0, GAIN.u, "1", "normal", "SIM-1")}
    setup = Setup("ab" * 32, "protocol 1", {"bias": 3.0}, {"K_i": "K@inboard"}, certified)
    start: Record = unfinished(
        run_id=name, procedure=procedure, rig=rig, uut={"model": "stand", "serial": "001"}, seed=None, plan={"angles": day},
        started=f"2026-01-{day:02}T00:00:00+00:00", versions={}, setup=setup,
    )  # fmt: skip
    force = Quantity("K_i", "N/A", "force constant").measured(Estimate(value, "N/A", {GAIN: value, SCATTER: 1.0}))
    drag = Quantity("drag", "m", "drag").measured(
        Estimate(1e-6, "m", {dataclasses.replace(SCATTER, id="s/1"): 1e-7}), "at " + 40 * "x"
    )
    record = dataclasses.replace(start, outcome=Outcome.DONE, ended="2026-01-31", findings=(),
                                 measurements=(measurement(force, None), measurement(drag, None)))  # fmt: skip
    path = root / name
    path.mkdir(parents=True)
    write_record(path / "record.json", dataclasses.replace(record, **other))  # type: ignore[arg-type]
    index.add(path)
    return path


def test_a_run_by_path_name_beginning_and_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = made(tmp_path, 1, 70.0), made(tmp_path, 2, 71.0)
    step, third = made(tmp_path, 3, 1.0, "step"), made(tmp_path, 4, 72.0)
    other = made(tmp_path, 5, 9.0, rig="another")
    for word, path in (
        (str(first), first),
        (second.name, second),
        (second.name[:24], second),
        ("step", step),
        ("last", other),
    ):
        assert run_named(word, tmp_path).path == path
    assert [r.path for r in pair_named((first.name, "last"), tmp_path)] == [first, other]
    shutil.rmtree(other)
    assert [r.path for r in pair_named(("last~1", "last"), tmp_path)] == [
        second,
        third,
    ]  # step is no run to compare with
    monkeypatch.chdir(tmp_path)
    assert run_named("last~2", Path()).path == first


@settings(max_examples=30)
@given(st.text(max_size=300) | st.from_regex(r"last~\d*", fullmatch=True) | st.text("amb-/.~x", max_size=400))
def test_whatever_is_said_is_a_run_or_one_message(root: Path, word: str) -> None:
    try:
        found = run_named(word, root)
    except ConfigError as error:
        told = str(error)
    else:
        told = "expected" if found.record.is_file() else "nothing there"
    assert "expected" in told


def test_the_difference_on_the_terminal_fits_it(tmp_path: Path, bench: Bench) -> None:
    made(tmp_path, 1, 70.0)
    made(tmp_path, 2, 72.0)
    status, out, err = bench("compare", "last~1", "last", "--out", str(tmp_path))
    assert (status, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    assert "amb-calibration: B - A" in out
    assert "plan angles: 1, then 2" in out
    assert (
        "72.00 ± 0.35" in out
    )  # u = sqrt(0.1^2 + 0.144^2) = 0.1753, 8 (0.1753/0.1)^4 = 75 degrees of freedom, k = 1.99
    # By hand: u_d = sqrt(2 x 0.1^2 + 0.004^2) = 0.1415, 16 degrees of freedom, k = 2.12: U = 0.300.
    assert "2.00 ± 0.30" in out
    assert "6.67" in out
    assert "gain of i: by 14 u" in out


def test_as_json_it_has_all_of_it(tmp_path: Path, bench: Bench) -> None:
    a, b = made(tmp_path, 1, 70.0), made(tmp_path, 2, 70.1)
    status, out, _ = bench("compare", str(a), str(b), "--json")
    found = json.loads(out)
    assert status == 0
    assert (found["schema"], found["procedure"], found["one_machine"], found["only"]) == (
        1,
        "amb-calibration",
        True,
        [],
    )
    assert (found["a"]["run_id"], found["b"]["path"]) == (a.name, str(b))
    assert found["differs"] == [{"what": "plan", "key": "angles", "a": "1", "b": "2"}]
    force, drag = found["differences"]
    assert (force["name"], force["unit"], force["source"], force["beyond"]) == ("K_i", "N/A", "record", False)
    assert force["en"] == pytest.approx(0.1 / force["expanded_uncertainty"])
    assert {p["influence"] for p in force["parts"]} == {GAIN.id, f"{a.name}/scatter/yi", f"{b.name}/scatter/yi"}
    jsonschema.validate(force, {"required": ["interval", "dof", "method", "removed"], "properties": {"dof": NUMBER}})
    assert all(p.keys() == PART for p in drag["parts"])


def test_what_cannot_be_compared_is_said_in_one_message(tmp_path: Path, bench: Bench) -> None:
    a = made(tmp_path, 1, 70.0)
    step, running = made(tmp_path, 2, 1.0, "step"), made(tmp_path, 3, 70.0, ended=None)
    newer = made(tmp_path, 4, 70.0)
    text = (newer / "record.json").read_text().replace('"schema": 3', '"schema": 99')
    (newer / "record.json").write_text(text)
    for words, said in (
        ((a.name, step.name), "they measure different quantities; expected two runs of one procedure"),
        ((a.name, running.name), "still being written"),
        ((a.name, a.name), "the same run twice"),
        ((a.name, newer.name), "schema: found 99; expected 3. It was written by a newer Levbench"),
        ((a.name, "amb-"), "whose name begins so"),
        ((a.name, "nothing"), "found no run directory of that name"),
        ((a.name, "last~40"), "expected at least 41"),
        ((a.name, str(tmp_path / "nothing")), "found no run directory of that name"),
    ):
        status, out, err = bench("compare", *words, "--out", str(tmp_path))
        assert (status, out) == (2, "")
        assert said in err
        assert len(err.splitlines()) == 1


def test_runs_with_results_by_what_is_asked_for(tmp_path: Path, bench: Bench) -> None:
    for day in (1, 2):
        made(tmp_path, day, 70.0 + day)
    made(tmp_path, 3, 1.0, "step", outcome=Outcome.FAIL)
    out = ("--out", str(tmp_path))
    status, text, _ = bench("runs", *out, "--procedure", "amb-calibration", "--show", "K@inboard", "--last", "1")
    assert status == 0
    head, line = text.splitlines()
    assert (head.split(), line.split()[:4]) == (["K_i"], ["DONE", "72.00", "±", "0.35"])
    assert line.endswith(str(tmp_path / "amb-calibration-20260102T000000Z-0002"))
    (failed,) = json.loads(bench("runs", *out, "--failed", "--json", "--show", "K_i", "--show", "drag")[1])
    assert (failed["outcome"], failed["procedure"]) == ("FAIL", "step")
    assert failed["results"]["K_i"]["value"] == 1.0
    assert bench("runs", *out, "--rig", "nowhere")[1:] == (
        "", f"no runs in {tmp_path} of nowhere; there are some of stand\n")  # fmt: skip
    assert (
        bench("runs", *out, "--procedure", "amb-calibration", "--failed")[2]
        == f"no runs in {tmp_path} that are as asked for\n"
    )
    status, _, err = bench("runs", *out, "--show", "K_j")
    assert (status, "such as K_i" in err) == (2, True)
