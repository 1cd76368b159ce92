"""`bench campaign` in this process: one rig step by step, many rigs, what is refused, what the exit status says."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from campaign_catalogue import SMALL
from in_process import Bench, bench_in_process

from bench import catalogue
from bench.campaign.model import SCHEMA_FILE, json_schema
from bench.cli.campaign.job import run_rig
from bench.cli.campaign.tasks import RigTask
from bench.errors import ConfigError
from bench.recording import Recording
from bench.rigfile import load_rig

ROOT = Path(__file__).resolve().parents[2]
HEAD = 'schema = 1\nname = "small"\nrig = "tsbs12"\n'
TWO = '[[step]]\nprocedure = "tiny-levitated"\n[[step]]\nprocedure = "tiny-needing"\n'


def environment() -> dict[str, str]:
    paths = [str(ROOT / "tests" / "cli"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    """`bench campaign c.toml ...` in an empty directory with the small procedures."""
    monkeypatch.setattr(catalogue, "PROCEDURES", SMALL)
    monkeypatch.chdir(tmp_path)

    command = bench_in_process(capsys)

    def campaign(text: str, *arguments: str) -> tuple[int, str, str]:
        (tmp_path / "c.toml").write_text(text)
        return command("campaign", "c.toml", *arguments)

    return campaign


@pytest.fixture
def bench_process(tmp_path: Path) -> Bench:
    """The same as a process of its own: the pool's processes leave the interpreter's resource tracker in ours."""

    def command(text: str, *arguments: str) -> tuple[int, str, str]:
        (tmp_path / "c.toml").write_text(text)
        done = subprocess.run(
            [sys.executable, "-m", "campaign_catalogue", "campaign", "c.toml", *arguments], cwd=tmp_path,
            env=environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert "Traceback" not in done.stdout + done.stderr
        return done.returncode, done.stdout, done.stderr

    return command


def journal(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]


def test_one_rig_step_by_step_ends_in_a_model(bench: Bench, tmp_path: Path) -> None:
    equations = '[equations]\nsupply = { text = "U_s = R i", source = "Ohm" }\n'
    status, out, err = bench(HEAD + "seed = 4\n" + TWO + equations)
    assert status == 0, err
    folder = tmp_path / out.strip()
    lines = journal(tmp_path / out.strip())
    assert [(e["kind"], e.get("outcome"), e.get("adopted")) for e in lines] == [
        ("step", "DONE", True), ("step", "DONE", False), ("done", None, None),
    ]  # fmt: skip
    for e in lines[:2]:
        assert (folder / e["run"] / "report.html").is_file()
        assert json.loads((folder / e["run"] / "record.json").read_text())["seed"] == 4
    model = json.loads((folder / "model.json").read_text())
    jsonschema.validate(model, json.loads(SCHEMA_FILE.read_text()))
    constants = {c["name"]: c for c in model["constants"]}
    assert constants["double"]["value"] == pytest.approx(2 * constants["supply"]["value"])
    assert constants["supply"]["equation"] == {"text": "U_s = R i", "source": "Ohm"}
    assert constants["supply"]["holds_for"]["bias_A"] == 3.0
    assert model["complete"]
    assert model["simulated"]
    assert model["correlations"] == {
        "names": ["supply", "double"],
        "matrix": [[1.0, pytest.approx(1.0)], [pytest.approx(1.0), 1.0]],
    }
    page = (folder / "summary.html").read_text()
    assert "U<sub>s</sub> = R i" in page
    assert (folder / "summary.pdf").read_bytes().startswith(b"%PDF")
    assert not (tmp_path / "rigs").exists()  # the rig's own calibrations are left alone


def test_the_schema_file_is_the_codes() -> None:
    assert json.loads(SCHEMA_FILE.read_text()) == json.loads(json.dumps(json_schema()))


def test_a_step_that_does_not_pass_ends_it_and_is_done_again(bench: Bench, tmp_path: Path) -> None:
    text = HEAD + TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { then = "doubt" }\n', 1)
    status, out, err = bench(text, "--no-report")
    assert status == 5
    assert "doubt" in err
    assert [e["outcome"] for e in journal(tmp_path / out.strip())] == ["INDETERMINATE"]
    assert not json.loads((tmp_path / out.strip() / "model.json").read_text())["complete"]
    assert not (tmp_path / out.strip() / "summary.html").exists()
    again = bench(text, "--no-report")
    assert again[:2] == (status, out)
    assert "going on with" in again[2]
    assert [e["outcome"] for e in journal(tmp_path / out.strip())] == ["INDETERMINATE", "INDETERMINATE"]


def test_going_on_leaves_out_what_needs_the_step_that_failed(bench: Bench, tmp_path: Path) -> None:
    steps = TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { then = "raise" }\n', 1)
    status, out, err = bench(HEAD + steps + '[[step]]\nprocedure = "tiny-resting"\n', "--no-report", "--go-on")
    assert status == 3
    assert [e["outcome"] for e in journal(tmp_path / out.strip())] == ["ERROR", None, "DONE"]
    assert "left out: needs tiny-levitated" in err


def test_a_need_that_no_step_meets_is_refused_before_the_start(bench: Bench, tmp_path: Path) -> None:
    status, _, err = bench(HEAD + '[[step]]\nprocedure = "tiny-needing"\n')
    assert status == 2
    assert "step.1.procedure" in err
    assert "a [[step]] with tiny-levitated before it" in err
    assert not (tmp_path / "runs").exists()


def test_a_need_at_other_settings_is_refused_before_the_start(bench: Bench, tmp_path: Path) -> None:
    status, _, err = bench(HEAD + TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { bias_A = 2.5 }\n', 1))
    assert status == 2
    assert "bias_A = 2.5; 3 is needed" in err


def test_every_plan_is_checked_before_the_start(bench: Bench, tmp_path: Path) -> None:
    steps = TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { colour = 3 }\n', 1)
    status, _, err = bench(
        HEAD
        + steps
        + 'plan = { seconds = "long" }\njudged = ["triple"]\n[equations]\nx = { text = "y", source = "z" }\n'
    )
    assert status == 2
    for part in ("step.1.colour", "step.2.seconds"):
        assert part in err
    status, _, err = bench(HEAD + TWO + 'judged = ["triple"]\n[equations]\nx = { text = "y", source = "z" }\n')
    for part in ("step.2.judged", "equations.x"):
        assert part in err


def test_what_is_done_is_not_done_again(bench: Bench, tmp_path: Path) -> None:
    status, out, _ = bench(HEAD + TWO, "--no-report")
    assert status == 0
    path = tmp_path / out.strip() / "journal.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text(lines[0] + lines[1][:40])  # killed while the second was noted
    again = bench(HEAD + TWO, "--no-report")
    assert again[:2] == (0, out)
    runs = [p.name for p in (tmp_path / out.strip() / "runs").iterdir() if p.is_dir()]
    assert sum(name.startswith("tiny-levitated") for name in runs) == 1
    assert sum(name.startswith("tiny-needing") for name in runs) == 2


def test_a_changed_campaign_is_refused_with_the_remedy(bench: Bench, tmp_path: Path) -> None:
    text = HEAD + TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { then = "doubt" }\n', 1)
    _, out, _ = bench(text, "--no-report")
    status, _, err = bench(HEAD + TWO, "--no-report")
    assert status == 2
    assert 'steps.1.plan.then: started with "doubt", now "yield"' in err
    status, fresh, _ = bench(HEAD + TWO, "--no-report", "--new")
    assert status == 0
    assert fresh != out


def test_another_visit_is_another_campaign(bench: Bench, tmp_path: Path) -> None:
    text = HEAD + TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { then = "doubt" }\n', 1)
    _, out, _ = bench(text, "--no-report")
    status, _, err = bench(text, "--no-report", "--visit", "2")
    assert status == 2
    assert "visit: started with 0, now 2" in err
    started = tmp_path / out.strip() / "campaign.json"
    old = json.loads(started.read_text())
    assert old.pop("visit") == 0
    started.write_text(json.dumps(old))  # of before there were visits
    assert "visit: started with 0, now 2" in bench(text, "--no-report", "--visit", "2")[2]
    assert bench(text, "--no-report")[:2] == (5, out)
    status, fresh, err = bench(HEAD + "visit = 1\n" + TWO, "--no-report", "--visit", "2", "--new")
    assert status == 0, err
    steps = [e for e in journal(tmp_path / fresh.strip()) if e["kind"] == "step"]
    records = [json.loads((tmp_path / fresh.strip() / e["run"] / "record.json").read_text()) for e in steps]
    assert [(r["seed"], r["visit"]) for r in records] == [(0, 2), (0, 2)]
    model = json.loads((tmp_path / fresh.strip() / "model.json").read_text())
    jsonschema.validate(model, json.loads(SCHEMA_FILE.read_text()))
    assert (model["seed"], model["visit"]) == (0, 2)


def test_the_truth_is_the_same_machine_in_every_step(bench: Bench, tmp_path: Path) -> None:
    status, out, err = bench(HEAD + TWO + "[truth]\ncoulomb = 0.07\n", "--no-report")
    assert status == 0, err
    runs = [tmp_path / out.strip() / e["run"] for e in journal(tmp_path / out.strip()) if e["kind"] == "step"]
    values = [json.loads((r / "truth.json").read_text())["values"] for r in runs]
    assert values[0] == values[1]
    assert values[0]["coulomb"] == 0.07


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--seed", "1", "--count", "3"), "one or the other"),
        (("--first-seed", "5"), "expected --count too"),
        (("--backend", "live", "--count", "3"), "--backend live"),
        (("--backend", "live", "--visit", "1"), "--backend live: a real rig has no seed, no visit and no truth"),
        (("--link", "controller=can:vcan0"), "--link"),
        (("--rig", "tsbs21"), "unknown rig"),
        (("--jobs", "0"), "--jobs"),
    ],
)
def test_options_that_contradict_each_other(bench: Bench, arguments: tuple[str, ...], said: str) -> None:
    status, _, err = bench(HEAD + TWO, *arguments)
    assert status == 2
    assert said in err


@pytest.mark.parametrize("option", ["--seed", "--visit"])
def test_a_campaign_file_for_a_real_rig_has_no_virtual_one(bench: Bench, option: str) -> None:
    status, _, err = bench(HEAD + 'backend = "live"\n' + TWO, option, "1")
    assert status == 2
    assert f"{option}: a real rig has no seed and no visit; expected --backend sim" in err


def test_many_rigs_go_through_the_chain_and_are_noted(bench_process: Bench, tmp_path: Path) -> None:
    """The truth holds no supply: nothing can be judged."""
    status, out, err = bench_process(HEAD + TWO, "--count", "2", "--first-seed", "7", "--visit", "3", "--jobs", "2",
                                      "--keep", "all")  # fmt: skip
    assert status == 5, err
    lines = journal(tmp_path / out.strip())
    rigs = {e["seed"]: e for e in lines if e["kind"] == "rig"}
    assert sorted(rigs) == [7, 8]
    assert [rig["visit"] for rig in rigs.values()] == [3, 3]
    assert "2 rigs from seed 7, visit 3, " in err
    assert lines[-1] == {"kind": "done"}
    for rig in rigs.values():
        assert [v["name"] for v in rig["values"]] == ["supply", "double"]
        assert rig["values"][1]["value"] == pytest.approx(2 * rig["values"][0]["value"])
        assert rig["stopped"] is None
    folder = tmp_path / out.strip()
    kept = sorted(p.relative_to(folder).as_posix() for p in (folder / "recordings").rglob("*.mcap"))
    assert kept[:2] == ["recordings/7/1-tiny-levitated.mcap", "recordings/7/2-tiny-needing.mcap"]
    assert len(kept) == 4
    assert {Recording[Any].open(folder / path).visit for path in kept} == {3}
    assert not (folder / "work").exists()
    told = json.loads((folder / "coverage.json").read_text())
    assert (told["first_seed"], told["visit"], told["verdict"]) == (7, 3, "indeterminate")
    assert "Nothing could be judged" in (folder / "summary.html").read_text()


@pytest.mark.long
def test_more_rigs_are_added_to_an_unfinished_campaign(bench_process: Bench, tmp_path: Path) -> None:
    _, out, _ = bench_process(HEAD + TWO, "--count", "1", "--jobs", "1", "--no-report")
    path = tmp_path / out.strip() / "journal.jsonl"
    path.write_text(path.read_text().splitlines(keepends=True)[0])
    _, again, err = bench_process(HEAD + TWO, "--count", "2", "--jobs", "1", "--no-report")
    assert again == out
    assert [e["seed"] for e in journal(tmp_path / out.strip()) if e["kind"] == "rig"] == [0, 1]
    assert "step 1/1" in err


def test_a_rig_that_fails_a_step_is_told_by_its_code(bench_process: Bench, tmp_path: Path) -> None:
    steps = TWO.replace('"tiny-levitated"\n', '"tiny-levitated"\nplan = { act = "raise" }\n', 1)
    text = HEAD + steps + '[[step]]\nprocedure = "tiny-resting"\n'
    _, out, err = bench_process(text, "--count", "2", "--jobs", "1", "--no-report", "--keep", "none")
    assert "unexpected-ZeroDivisionError in tiny-levitated: 2 rigs, as seed 0" in err
    (first, *_) = (e for e in journal(tmp_path / out.strip()) if e["kind"] == "rig")
    assert [s["step"] for s in first["steps"]] == [1, 3]  # the one that needs it is left out
    assert first["kept"] == []


def test_a_rig_file_that_changes_while_a_campaign_runs_ends_it(tmp_path: Path) -> None:
    rig = tmp_path / "other.toml"
    rig.write_text((catalogue.INSTALLED / "tsbs12.toml").read_text())
    (tmp_path / "tsbs12.dbc").write_text((catalogue.INSTALLED / "tsbs12.dbc").read_text())
    task = RigTask(str(rig), load_rig(str(rig)).digest, (), {}, "none", str(tmp_path))
    assert run_rig(task, 1)["values"] == []
    rig.write_text(rig.read_text() + "\n")
    with pytest.raises(ConfigError, match="changed while the campaign ran"):
        run_rig(task, 2)
