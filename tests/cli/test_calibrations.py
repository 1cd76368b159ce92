"""Calibrations through the command line: adopted, listed, used, and every refusal with the command that helps."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from chained import FILE, RIG, Bench, adopted, chained, edit, opened, run

from bench.recording import Recording


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    return opened(tmp_path, monkeypatch, capsys)


def remedies(said: str) -> list[list[str]]:
    """The commands of a message, as they would be typed."""
    return [shlex.split(c)[1:] for c in re.findall(r"`(bench [^`]*)`", said)]


def follow(bench: Bench, said: str) -> None:
    """Do what a message says."""
    first, then = remedies(said)[:2]
    status, out, err = bench(*first)
    assert status == 0, err
    status, _, err = bench(*[out.splitlines()[-1] if word == "RUN" else word for word in then])
    assert status == 0, err


def test_what_is_needed_is_run_adopted_and_used(bench: Bench) -> None:
    said = chained(bench)
    assert "tiny-levitated: found none for virtual rig 0" in said
    assert remedies(said)[0] == ["run", "tiny-levitated", "--rig", "tsbs12", "--plan", "bias_A=3"]
    follow(bench, said)
    directory = Path(chained(bench, status=0))
    record = json.loads((directory / "record.json").read_text())
    (used,) = record["calibrations"]
    kept = json.loads(FILE.read_text())
    assert used == {k: kept[k] for k in ("procedure", "run_id", "date", "due", "sha256")} | {"state": "current"}
    (excess,) = record["measurements"]
    assert {row["influence"]: row["name"] for row in excess["budget"]} == {
        "meter": "voltmeter", f"{used['run_id']}/meter": f"voltmeter [{used['run_id']}]",
    }  # fmt: skip
    assert excess["standard_uncertainty"] == pytest.approx(0.1 * 2**0.5)
    (stored,) = Recording.open(directory / "recording.mcap").calibrations
    assert stored.values["supply"].value == kept["values"]["supply"]["value"]


def test_analyse_uses_only_what_is_in_the_file(bench: Bench) -> None:
    adopted(bench)
    directory = chained(bench, status=0)
    before = json.loads((Path(directory) / "record.json").read_text())
    shutil.rmtree("rigs")
    status, out, err = bench("analyse", directory)
    assert status == 0, err
    after = json.loads((Path(out.splitlines()[-1]) / "record.json").read_text())
    assert after["calibrations"] == before["calibrations"]
    assert after["measurements"] == before["measurements"]


def test_another_visit_is_the_same_machine(bench: Bench) -> None:
    """What helps is offered for the same day."""
    assert "--seed 0 --visit 2" in chained(bench, "--seed", "0", "--visit", "2")
    adopted(bench)
    directory = Path(chained(bench, "--visit", "2", status=0))
    record, truth = (json.loads((directory / name).read_text()) for name in ("record.json", "truth.json"))
    assert [(said["seed"], said["visit"]) for said in (record, truth)] == [(0, 2)] * 2
    status, out, _ = bench("analyse", str(directory))
    assert status == 0
    again = json.loads((Path(out.splitlines()[-1]) / "record.json").read_text())
    assert (again["visit"], again["measurements"]) == (2, record["measurements"])


def test_another_seed_is_another_machine(bench: Bench) -> None:
    adopted(bench)
    said = chained(bench, "--seed", "4")
    assert "found none for virtual rig 4" in said
    assert "--seed 4" in said
    shutil.copytree(FILE.parent, FILE.parent.with_name("sim-4"))
    said = chained(bench, "--seed", "4")
    assert "is of virtual rig 0; this is virtual rig 4" in said
    follow(bench, said)
    chained(bench, "--seed", "4", status=0)


def test_another_bias(bench: Bench) -> None:
    adopted(bench)
    said = chained(bench, "--plan", "bias_A=2.5")
    assert "made at other settings: bias_A = 3; 2.5 is needed" in said
    follow(bench, said)
    chained(bench, "--plan", "bias_A=2.5", status=0)
    assert "bias_A = 2.5; 3 is needed" in chained(bench)


def test_another_rig(bench: Bench) -> None:
    adopted(bench)
    RIG.write_text(RIG.read_text().replace('serial = "', 'serial = "X'))
    said = chained(bench)
    assert "is of the machine with serial no." in said
    status, out, _ = bench("calibrations", "tsbs12")
    assert status == 0
    assert "other rig" in out
    RIG.write_text(RIG.read_text().replace('name = "tsbs12"', 'name = "tsbs13"'))
    assert "is of rig tsbs12" in chained(bench)
    follow(bench, chained(bench))
    chained(bench, status=0)


def test_expired(bench: Bench) -> None:
    adopted(bench)
    edit(FILE, due="2026-01-01")
    said = chained(bench)
    assert "expired on 2026-01-01" in said
    assert "--allow-expired" in said
    _, out, _ = bench("calibrations", "tsbs12")
    assert "expired" in out
    directory = Path(chained(bench, "--allow-expired", status=0))
    record = json.loads((directory / "record.json").read_text())
    assert record["calibrations"][0]["state"] == "expired"
    assert [f["code"] for f in record["findings"]] == ["calibration-expired"]
    assert bench("report", str(directory))[0] == 0
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert page.count("Made with an expired calibration") == 3  # page 1, the end, the head of each printed page
    status, _, err = bench("adopt", str(directory))  # what rests on it says so too
    assert status == 0
    assert "tiny-levitated had expired on 2026-01-01" in err
    follow(bench, said)
    chained(bench, status=0)
    _, out, _ = bench("calibrations", "tsbs12")
    assert "rests on tiny-levitated, which had expired" in out
    assert "which is superseded" in out


def test_other_certificates(bench: Bench) -> None:
    adopted(bench)
    certificate = {"value": 0.125, "u": 5e-5, "unit": "m", "distribution": "normal", "source": "an older report"}
    edit(FILE, certificates={"geometry/clearance": certificate})
    said = chained(bench)
    assert "made with other certificates" in said
    assert "geometry/clearance: was 0.125 m" in said
    _, out, _ = bench("calibrations", "tsbs12")
    assert "other certificates" in out
    follow(bench, said)
    chained(bench, status=0)


def test_a_broken_file(bench: Bench) -> None:
    adopted(bench)
    FILE.write_text('{"schema": 2}')
    said = chained(bench)
    assert "newer Levbench" in said
    status, out, _ = bench("calibrations", "tsbs12")
    assert status == 2
    assert "unreadable" in out
    follow(bench, said)
    chained(bench, status=0)


def test_a_run_that_did_not_pass(bench: Bench) -> None:
    directory = run(bench, "--plan", 'then="doubt"', status=5)
    status, _, err = bench("adopt", directory)
    assert status == 2
    assert "found outcome INDETERMINATE; expected PASS" in err
    assert not FILE.exists()
    status, _, err = bench("adopt", directory, "--anyway")
    assert status == 0
    assert "adopted although its outcome was INDETERMINATE" in err
    assert json.loads(FILE.read_text())["outcome"] == "INDETERMINATE"
    record = json.loads((Path(chained(bench, status=0)) / "record.json").read_text())
    assert [f["code"] for f in record["findings"]] == ["calibration-not-passed"]
    _, out, _ = bench("calibrations", "tsbs12")
    assert "adopted although its outcome was INDETERMINATE" in out


@pytest.mark.parametrize("act", ["raise", "stop"])
def test_a_run_that_was_stopped(bench: Bench, act: str) -> None:
    directory = run(bench, "--plan", f'act="{act}"', status={"raise": 3, "stop": 4}[act])
    status, _, err = bench("adopt", directory, "--anyway")
    assert status == 2
    assert "stopped before its end" in err
    assert not FILE.exists()


def test_a_recording_that_is_not_the_records(bench: Bench) -> None:
    first, second = run(bench), run(bench, "--seed", "2")
    shutil.copy(Path(second) / "recording.mcap", Path(first) / "recording.mcap")
    status, _, err = bench("adopt", first)
    assert status == 2
    assert "the record was made from" in err
    (Path(first) / "recording.mcap").unlink()
    assert bench("adopt", first)[0] == 2
    assert bench("adopt", "absent")[0] == 2
    assert not FILE.exists()


def test_numbers_that_this_version_does_not_find(bench: Bench) -> None:
    directory = run(bench)
    path = Path(directory) / "record.json"
    record = json.loads(path.read_text())
    record["measurements"][0]["value"] += 1.0
    path.write_text(json.dumps(record))
    status, _, err = bench("adopt", directory)
    assert status == 2
    assert "this version finds" in err


def test_a_run_of_another_rig(bench: Bench) -> None:
    directory = run(bench)
    RIG.write_text(RIG.read_text().replace('serial = "', 'serial = "X'))
    status, _, err = bench("adopt", directory)
    assert status == 2
    assert "serial no." in err


def test_a_folder_of_ones_own(bench: Bench) -> None:
    said = chained(bench, "--calibrations", "mine here")
    follow(bench, said)
    chained(bench, "--calibrations", "mine here", status=0)
    assert not FILE.exists()
    status, out, _ = bench("calibrations", "tsbs12", "--calibrations", "mine here")
    assert status == 0
    assert "sim-0" in out


def test_a_rig_without_any_says_what_to_do(bench: Bench) -> None:
    status, out, err = bench("calibrations", "tsbs12")
    assert (status, out) == (0, "")
    follow(bench, err)
    status, out, _ = bench("calibrations", "tsbs12")
    assert status == 0
    assert re.search(r"sim-0 +tiny-levitated +3 A +\d{4}-\d\d-\d\d +0 d +\d{4}-\d\d-\d\d +current\n +supply", out)
    adopted(bench)
    _, out, _ = bench("calibrations", "tsbs12")
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("sim-0")] == ["current", "superseded"]
