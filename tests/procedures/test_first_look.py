"""A wrong sign or an exchange is told by the first data that show it: without a person the run ends there, with the finding of
its analysis; a person is asked."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from identified import SEED, WEIGH, calibrated, identified

from bench.calibration import Calibration
from bench.cli.__main__ import main
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from procedures.amb_calibration.checks import WIRED_WRONG
from procedures.amb_rotor import lift
from procedures.shared.first_look import ENDED

CURRENTS = {"current_sign_i": -1.0}
GRID = {"spacing_m": 40e-6, "settle_s": 0.5, "average_s": 0.3}
MOTOR = ("amb-calibration", "force-constant", "torque-constant", "force-coupling", "negative-stiffness")
LEVER = {"masses": ["M2", "M3"], "settle_s": 0.7, "average_s": 0.3}


def run(
    folder: Path, procedure: str, truth: Mapping[str, float], plan: Mapping[str, Any], seed: int = 1,
    calibrations: Mapping[str, Calibration] | None = None,
) -> Simulated:  # fmt: skip
    rig = "tsbs12" if procedure in MOTOR else "amb5dof"
    return simulated_run(procedure, rig, seed, plan, folder / "recording.mcap", truth, calibrations)


def ended_by(found: Simulated) -> set[tuple[str, str]]:
    """Codes and places of what a run ended by, and of the errors of its analysis: the same."""
    errors = {(f.code, f.where) for f in found.results if isinstance(f, Finding) and f.effect is Effect.ERROR}
    told = {(f["code"], f["where"]) for e in found.recording.events(ENDED) for f in e["findings"]}
    assert not [m for m in found.results if isinstance(m, Measured)]
    assert told == errors
    (asked,) = (e for e in found.recording.events("operator") if e.get("action") == "goes-on")
    assert asked["answer"] == "no"
    return told


@pytest.mark.parametrize(
    ("procedure", "truth", "code"),
    [
        ("unbalance", {"told_planes": 1.0}, "planes-exchanged"),
        ("compensation", {"told_axes": 1.0}, "axes-exchanged"),
        ("balance", CURRENTS, "coils-exchanged"),
        ("run-up", {"told_planes": 1.0}, "planes-exchanged"),
        ("coast-down", CURRENTS, "coils-exchanged"),
        ("sensitivity", {"told_axes": 1.0}, "axes-exchanged"),
        ("tracking", {"told_planes": 1.0}, "planes-exchanged"),
    ],
)
def test_a_shaft_that_is_wired_wrong_is_not_turned(
    tmp_path: Path, procedure: str, truth: dict[str, float], code: str
) -> None:
    found = run(tmp_path, procedure, truth, {})
    assert code in {c for c, _ in ended_by(found)}
    assert len(found.recording.all_steps()) == lift.STEPS
    assert {e["command"] for e in found.recording.events("drive")} <= {"coast"}


def test_the_first_bias_shows_exchanged_coils(tmp_path: Path) -> None:
    found = run(tmp_path, "bearing-model", CURRENTS, GRID)
    assert ended_by(found) == {("coils-exchanged", "yi"), ("coils-exchanged", "zi")}
    assert {s.labels["bias_A"] for s in found.recording.steps("hold")} == {1.15}


@pytest.mark.parametrize(
    ("truth", "code", "loads"),
    [({"exchange_segments": 1.0}, "segments-exchanged", 0), ({"segment_sign_1": -1.0}, "segment-sign", 4)],
)
def test_the_first_loads_show_a_motor_that_is_wired_wrong(
    tmp_path: Path, truth: dict[str, float], code: str, loads: int
) -> None:
    found = run(tmp_path, "torque-constant", truth, LEVER, 3)
    assert {c for c, _ in ended_by(found)} == {code}
    assert len(list(found.recording.steps("lever"))) == loads


@pytest.mark.parametrize(
    ("truth", "code"),
    [({"exchange_segments": 1.0}, "segments-exchanged"), ({"segment_sign_1": -1.0}, "segment-sign")],
)
def test_the_first_angle_shows_a_motor_that_is_wired_wrong(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, truth: dict[str, float], code: str
) -> None:
    known = {"amb-calibration": calibrated(tmp_path_factory.mktemp("calibrated")).calibration()}
    found = run(tmp_path, "force-constant", truth, WEIGH, SEED, known)
    assert {c for c, _ in ended_by(found)} == {code}
    assert {s.labels["angle_rad"] for s in found.recording.all_steps()} == {0.0}


@pytest.mark.parametrize("procedure", ["force-coupling", "negative-stiffness"])
def test_the_first_step_shows_a_segment_that_reads_backwards(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, procedure: str
) -> None:
    known = identified(tmp_path_factory.mktemp("identified"))
    found = run(tmp_path, procedure, {"segment_sign_1": -1.0}, {"settle_s": 1.0, "average_s": 0.3}, SEED, known)
    assert ended_by(found) == {("segment-sign", "i_m1")}
    assert len(found.recording.all_steps()) == 1


SHORT = ("--plan", "settle_s=0.3", "--plan", "average_s=0.2")


def asked(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], answers: str, *words: str
) -> tuple[dict[str, Any], str]:
    """The record of a run with a person who types these lines, and what stood on the terminal."""
    monkeypatch.setattr("sys.stdin", io.StringIO(answers))
    main(("run", *words, "--operator", "console", "--no-report", "--out", str(folder)))
    out, err = capsys.readouterr()
    return json.loads((Path(out.splitlines()[-1]) / "record.json").read_text(encoding="utf-8")), err


@pytest.mark.parametrize(
    ("answer", "outcome", "steps"),
    [("no", "ERROR", 0), ("stop", "ABORTED", 0), pytest.param("yes", "ERROR", 72, marks=pytest.mark.long)],
)
def test_a_person_is_asked_after_the_first_mass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], answer: str, outcome: str, steps: int
) -> None:  # fmt: skip
    """M4 on, M4 off, the question, and then as many masses as a run has."""
    lines = f"\n\n{answer}\n" + "\n" * 200
    words = ("amb-calibration", "--rig", "tsbs12", "--seed", "3", "--truth", "current_sign_i=-1", *SHORT)
    record, said = asked(tmp_path, monkeypatch, capsys, lines, *words)
    assert record["outcome"] == outcome
    found = [f["code"] for f in record["findings"] if f["effect"] == "error"]
    assert found == (["wrong-sign"] if outcome == "ERROR" else found)
    assert "the control current of the inboard AMB changes by +" in said
    assert "That is an error of this run. Go on all the same?" in said
    assert said.count("Hang M") == (1 if not steps else said.count("Hang M"))


@pytest.mark.long
def test_who_goes_on_is_told_the_same_in_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("tracking", "--rig", "amb5dof", "--seed", "1", "--truth", "told_planes=1", "--plan", "revolutions=8")
    found = []
    for answer in ("no\n", "yes\n"):
        record, said = asked(tmp_path / answer.strip(), monkeypatch, capsys, answer, *words)
        assert "suspect the readings of the two planes exchanged" in said
        assert record["outcome"] == "ERROR"
        found.append([(f["code"], f["where"]) for f in record["findings"] if f["effect"] == "error"])
    assert found[0] == found[1]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("procedure", "plan"),
    [("tracking", {"revolutions": 8, "settle_s": 1.5}), ("bearing-model", GRID), ("torque-constant", LEVER),
     ("amb-calibration", {"settle_s": 0.3, "average_s": 0.2})],
)  # fmt: skip
def test_a_sound_rig_is_never_stopped(tmp_path: Path, procedure: str, plan: dict[str, Any], seed: int) -> None:
    found = run(tmp_path, procedure, {}, plan, seed)
    assert not list(found.recording.events(ENDED)) + list(found.recording.events(WIRED_WRONG))
    assert [m for m in found.results if isinstance(m, Measured)]
