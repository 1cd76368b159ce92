"""Plans of schema 1: of recordings without a schema in plan.json, and of rig files of schema 1."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recordings import HEADER, block, record
from test_rigfile import of_schema_1

from bench import catalogue
from bench.cli.loading import load_procedure
from bench.errors import ConfigError, RecordingError
from bench.procedure.plans import assemble
from bench.recording import Recording, storedplan
from bench.recording.recorder import RunHeader
from bench.rigfile import RigFile
from bench.rigfile.former_plans import PLAN_SCHEMA, plan_of_schema_1
from bench.run.step_gaps import missing_steps

ROOT = Path(__file__).resolve().parent
FORMER: dict[str, dict[str, Any]] = json.loads((ROOT / "former" / "plans.json").read_text(encoding="utf-8"))
"""The default plans of all procedures as plan.json had them before plans had a schema."""
NAMES = [entry.name for entry in catalogue.PROCEDURES]
THEN = [name for name in NAMES if name in FORMER]  # the others are younger
STAND = [(ROOT.parent / "rigs" / f"amb5dof.{x}").read_text(encoding="utf-8") for x in ("toml", "dbc")]


@pytest.mark.parametrize("name", THEN)
def test_a_plan_of_schema_1_is_read_with_every_setting_that_it_had(name: str) -> None:
    then, now = FORMER[name], load_procedure(name).plan
    made = now.model_validate_json(json.dumps(storedplan.migrated(then, name)))
    kept = json.loads(made.model_dump_json())
    assert {key: kept[key] for key in then} == then
    assert kept.get("law", "CCS") == ("PID" if name == "sensitivity" else "CCS")


@pytest.mark.parametrize("name", THEN)
def test_what_a_plan_took_by_default_then_is_in_the_table(name: str) -> None:
    """A default that moves since, with no intention to move results, belongs into `former_plans`."""
    made = load_procedure(name).plan.model_validate(plan_of_schema_1(name, {}))
    kept, then = json.loads(made.model_dump_json()), FORMER[name]
    moved = {key for key in then if kept[key] != then[key]}
    assert moved - {"rate_hz"} == (
        {"record_s"} if name == "step" else set()
    )  # the stand's nearest to it is the same rate
    assert kept.get("rate_hz") is None or "rate_hz" not in moved


@pytest.mark.parametrize("name", NAMES)
def test_a_plan_of_today_comes_back(name: str) -> None:
    plan = load_procedure(name).plan()
    stored = json.loads(storedplan.written(plan))
    assert stored["schema"] == PLAN_SCHEMA
    assert load_procedure(name).plan.model_validate(storedplan.migrated(stored, name)) == plan


def test_what_a_plan_of_schema_1_says_stays() -> None:
    assert plan_of_schema_1("unbalance", {"law": "CAC", "slow_s": 3.0}) == {"law": "CAC", "slow_s": 3.0}
    assert plan_of_schema_1("spindown", {}) == {}


@pytest.mark.parametrize("schema", [PLAN_SCHEMA + 1, 0, True, "2", None])
def test_another_schema_is_refused(schema: Any) -> None:
    with pytest.raises(ConfigError, match=r"plan.json: schema: found .*; expected 1 to 2"):
        storedplan.migrated({"schema": schema}, "step")


@pytest.mark.parametrize(("text", "law"), [('{"slow_s": 3}', "CCS"), ('{"schema": 2, "slow_s": 3}', "")])
def test_a_recordings_plan_is_migrated_by_its_schema(tmp_path: Path, text: str, law: str) -> None:
    run = {"run": {"procedure": "unbalance", "seed": "7"}}
    header = RunHeader(dict(HEADER.metadata) | run, dict(HEADER.attachments) | {"plan.json": text.encode()})
    record(tmp_path / "a.mcap", [], header=header)
    recording = Recording.open(tmp_path / "a.mcap", load_procedure("unbalance").plan)
    plan: Any = recording.plan
    assert (plan.law, recording.plan_dict.get("law", "")) == (law, law)


def test_a_recording_of_a_newer_plan_says_so(tmp_path: Path) -> None:
    header = RunHeader(HEADER.metadata, dict(HEADER.attachments) | {"plan.json": b'{"schema": 3}'})
    record(tmp_path / "a.mcap", [], header=header)
    with pytest.raises(RecordingError, match="written by a newer Levbench"):
        _ = Recording.open(tmp_path / "a.mcap").plan_dict


def test_a_rig_file_of_schema_1_takes_the_laws_that_plans_had_then() -> None:
    toml, dbc = STAND
    begin, end = toml.index("[plans.step]"), toml.index("# What follows is read by the simulated backend")
    old = RigFile.parse(of_schema_1(toml[:begin] + "[plans.balance]\nlaw = 'CAC'\n\n" + toml[end:]), dbc)
    new = RigFile.parse(toml, dbc)
    for name in ("step", "bearing-model", "unbalance", "compensation", "run-up", "coast-down", "sensitivity"):
        procedure = load_procedure(name)
        plans = [assemble(procedure.plan, ("rig", rig.plans.get(name, {}))) for rig in (old, new)]
        assert plans[0] == plans[1]
        assert not procedure.problems(old, plans[0])
    assert old.plans["balance"] == {"law": "CAC"}


def test_a_controller_without_a_choice_of_law_gets_none() -> None:
    toml, dbc = ((ROOT.parent / "rigs" / f"tsbs12.{x}").read_text(encoding="utf-8") for x in ("toml", "dbc"))
    assert RigFile.parse(of_schema_1(toml), dbc).plans == RigFile.parse(toml, dbc).plans
    assert re.search(r"^\[plans\.amb-calibration\]", toml, re.MULTILINE)


@pytest.mark.parametrize(("plan", "told"), [(b"{}", []), (b'{"schema": 2}', ["steps-missing"])])
def test_a_recording_of_plan_schema_1_has_the_steps_of_then(tmp_path: Path, plan: bytes, told: list[str]) -> None:
    """One step is there; today two are recorded, then it was one."""
    spindown = load_procedure("spindown")
    procedure = replace(spindown, step_count=lambda _: 2, fewest_steps=None, steps_on=None, former_steps=lambda _: 1)
    record(
        tmp_path / "a.mcap",
        [block(0, 10)],
        header=RunHeader(HEADER.metadata, dict(HEADER.attachments) | {"plan.json": plan}),
    )
    recording = Recording.open(tmp_path / "a.mcap", procedure.plan)
    assert [f.code for f in missing_steps(procedure, recording)] == told
