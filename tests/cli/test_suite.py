"""`pytest PROCEDURES --rig RIG`: what is skipped, what is made first, what is an error, and what JUnit is told."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from suite_catalogue import SMALL

from bench import catalogue
from bench.cli.suite import by_procedure, properties
from bench.errors import ConfigError
from bench.procedure import Quantity
from bench.record.limits import Limit
from bench.record.outcomes import Outcome
from bench.record.records import measurement, unfinished
from bench.run.runner import RunResult
from bench.uncertainty import Estimate, Influence

ROOT = Path(__file__).resolve().parents[2]
LEVITATED, NEEDING, LACKING = (
    f"tests/{name}.py" for name in ("tiny_procedures", "campaign_procedures", "lacking_procedure")
)


class Done:
    """A session of pytest: its status, output, and the JUnit file's items by name."""

    def __init__(self, tmp_path: Path, *arguments: str) -> None:
        junit, paths = tmp_path / "junit.xml", [ROOT / "tests" / "cli", ROOT]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "suite_catalogue", f"--junitxml={junit}", "-p", "no:cacheprovider",
             "-p", "no:hypothesispytest", f"--out={tmp_path / 'runs'}", "--no-report", *arguments],
            cwd=ROOT, env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        self.status, self.output = done.returncode, done.stdout + done.stderr
        self.items: dict[str, ElementTree.Element] = {}
        if junit.exists():
            self.items = {str(c.get("name")): c for c in ElementTree.parse(junit).getroot().iter("testcase")}

    def said(self, name: str, kind: str) -> str:
        """What JUnit says of an item that is skipped, failed or in error."""
        found = self.items[name].find(kind)
        assert found is not None, self.output
        return f"{found.get('message')} {found.text}"

    def properties(self, name: str) -> list[tuple[str, str]]:
        return [(str(p.get("name")), str(p.get("value"))) for p in self.items[name].findall("properties/property")]


def test_what_is_missing_is_made_and_what_the_rig_lacks_is_skipped(tmp_path: Path) -> None:
    done = Done(tmp_path, "--rig", "tsbs12", "--visit", "3", NEEDING, LACKING)
    assert done.status == 0, done.output
    assert "role winch" in done.said("tiny-lacking", "skipped")
    assert "channels: found no pos_zi" in done.said("tiny-lacking", "skipped")
    told = done.properties("tiny-needing")
    assert len(told) == len(dict(told))
    named = dict(told)
    assert (named["outcome"], named["seed"], named["visit"], named["double.verdict"]) == ("done", "0", "3", "none")
    assert float(named["double.value"]) == pytest.approx(2 * 148, abs=4)
    assert Path(named["needs.tiny-levitated"]).is_dir()
    assert not (ROOT / "rigs" / "tsbs12.calibrations").exists()  # the rig's own store is left alone


def test_who_needs_what_did_not_pass_is_an_error(tmp_path: Path) -> None:
    """Also where an older calibration is in the store: the machine has just been seen not to give one."""
    done = Done(tmp_path, "--rig", "tsbs12", LEVITATED, "--adopt", f"--calibrations={tmp_path / 'known'}")
    assert done.status == 0, done.output
    done = Done(tmp_path, "--rig", "tsbs12", LEVITATED, NEEDING, "--plan", 'tiny-levitated:then="doubt"',
                f"--calibrations={tmp_path / 'known'}")  # fmt: skip
    assert done.status == 1
    assert "INDETERMINATE" in done.said("tiny-levitated", "failure")
    said = done.said("tiny-needing", "error")
    assert "tiny-needing needs tiny-levitated, which ended INDETERMINATE: doubt" in said
    assert "bench/cli" not in done.output  # sentences, no source of ours
    assert "Traceback" not in done.output


def test_a_plan_that_does_not_fit_is_an_error_of_that_procedure(tmp_path: Path) -> None:
    done = Done(
        tmp_path, "--rig", "tsbs12", LEVITATED, NEEDING, "--plan", "tiny-levitated:bias_A=7", "--plan", "seconds=0.3"
    )
    assert done.status == 1
    said = done.said("tiny-levitated", "error")
    assert "the plan does not fit the rig; nothing was started:" in said
    assert "the envelope allows" in said
    assert "def " not in done.output
    assert "Traceback" not in done.output


def test_a_verdict_may_be_asked_for(tmp_path: Path) -> None:
    done = Done(tmp_path, "--rig", "tsbs12", LEVITATED, "--require-verdict")
    assert done.status == 1
    assert "nothing-judged" in done.said("tiny-levitated", "error")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--rig", "tsbs13"), "Did you mean tsbs12?"),
        (("--rig", "tsbs12", "--plan", "absent=1"), "--plan absent=1: found absent; expected a setting of a procedure"),
        (("--rig", "tsbs12", "--plan", "tiny-levitatd:seconds=1"), "Did you mean tiny-levitated?"),
    ],
)
def test_usage_errors_are_told_before_anything_runs(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    done = Done(tmp_path, *arguments, LEVITATED)
    assert done.status == 4
    assert said in done.output
    assert "Traceback" not in done.output
    assert not (tmp_path / "runs").exists()


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "PROCEDURES", SMALL)


@pytest.mark.usefixtures("small")
def test_a_setting_is_for_the_procedures_that_have_it() -> None:
    found = by_procedure(("seconds=0.3", "tiny-needing:bias_A=2.5", "tiny-needing:seconds=0.2"), "tsbs12")
    assert found == {
        "tiny-levitated": ("seconds=0.3",),
        "tiny-needing": ("seconds=0.3", "bias_A=2.5", "seconds=0.2"),
    }
    assert by_procedure(("tiny-lacking:tilt_rad=0.1",), "tsbs12") == {"tiny-lacking": ("tilt_rad=0.1",)}


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    "wrong",
    ["tilt_rad=0.1", "tiny-levitated:tilt_rad=0.1", "tiny-levitated:seconds", "seconds=much", "nobody:seconds=1"],
)
def test_a_setting_that_nobody_has_is_refused(wrong: str) -> None:
    """A key of a procedure that the rig cannot run is nobody's."""
    with pytest.raises(ConfigError):
        by_procedure((wrong,), "tsbs12")


def test_junit_is_told_place_limit_and_seed_once_each(tmp_path: Path) -> None:
    rise, meter = Quantity("rise_time", "s", ""), Influence("scatter", "scatter", 1e-3, "s", "A", "normal", 9.0)
    made = [
        measurement(rise.measured(Estimate.of(0.04, meter), where), Limit(None, 0.05, "s", "house", True))
        for where in ("y, 20 µm", "z, 20 µm")
    ]
    record: Any = unfinished(run_id="r", procedure="step", rig="amb5dof", uut={}, started="2026-01-01T00:00:00Z", seed=0,
                             visit=3, plan={}, versions={})  # fmt: skip
    result = RunResult(tmp_path, replace(record, outcome=Outcome.PASS, measurements=tuple(made)))
    told = properties(result)
    assert len(told) == len(dict(told))
    named = dict(told)
    assert (named["outcome"], named["seed"], named["visit"]) == ("pass", "0", "3")
    assert named["rise_time@y, 20 µm.where"] == "y, 20 µm"
    assert named["rise_time@z, 20 µm.limit_high"] == "0.05"
    assert "rise_time@z, 20 µm.limit_low" not in named
    assert named["rise_time@z, 20 µm.verdict"] == "pass"
