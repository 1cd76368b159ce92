"""Every procedure of the catalogue on a sound rig of each kind, with its default plan, as CI would run it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bench import catalogue

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("rig", "seed", "runs"), [("tsbs12", 0, 12), ("amb5dof", 0, 10), ("amb1dof", 0, 2), ("tsbs6", 0, 5)]
)
def test_a_sound_rig_is_green(tmp_path: Path, rig: str, seed: int, runs: int) -> None:
    """Those of the other machine are skipped, and say what is lacking."""
    junit = tmp_path / "junit.xml"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "procedures", f"--rig={rig}", f"--seed={seed}", "--no-report", "-p",
         "no:cacheprovider", f"--out={tmp_path / 'runs'}", f"--junitxml={junit}"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    many = len(catalogue.PROCEDURES)
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert suite is not None
    assert [suite.get(k) for k in ("tests", "failures", "errors", "skipped")] == [
        str(n) for n in (many, 0, 0, many - runs)
    ]
    for item in suite.iter("testcase"):
        named = {str(p.get("name")): str(p.get("value")) for p in item.findall("properties/property")}
        left_out = item.find("skipped")
        assert (
            named["outcome"] in ("pass", "done")
            if left_out is None
            else "cannot run it" in str(left_out.get("message"))
        )
