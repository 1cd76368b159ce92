"""`bench run current-step` against the C controller with a command line: what it finds is what its law is in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from line_programs import MACHINE, PATIENT_MS, ZETA, controller, rise_time, run_bench

INDETERMINATE = 5
PLAN = ("spare_s=0.3", "repeats=6", "small_repeats=6")
"""Its two writes may take a third of a second on a busy machine."""
LIMITED = "limit-untouched"
"""This plant has no limit that a large step could touch; the procedure says so and leaves the decision."""


@pytest.mark.parametrize(("kind", "place"), [("lira", "tcp"), pytest.param("north", "pty", marks=pytest.mark.long)])
def test_the_step_response_of_a_law(line_program: Path, rig_folder: Path, kind: str, place: str) -> None:
    given = ("run", "current-step", "--rig", kind, "--backend", "live", "--operator", "console", "--no-report")
    with controller(line_program, place, kind, PATIENT_MS) as there:
        settings = (x for setting in PLAN for x in ("--plan", setting))
        done = run_bench(rig_folder, *given, *settings, "--link", f"controller={there.url}", real=True)
    assert done.returncode == INDETERMINATE, done.stderr
    record = json.loads((rig_folder / done.stdout.strip() / "record.json").read_text())
    assert {f["code"] for f in record["findings"]} <= {LIMITED, *MACHINE}
    found = {m["name"]: (m["value"], m["expanded_uncertainty"]) for m in record["measurements"]}
    inner = 1 - 2 * ZETA**2
    expected = {
        "rise_time": rise_time(),
        "fall_time": rise_time(),
        "overshoot": math.exp(-math.pi * ZETA / math.sqrt(1 - ZETA**2)),
        "bandwidth_small": 4000 * math.sqrt(inner + math.sqrt(inner**2 + 1)),
    }
    for name, value in expected.items():
        assert abs(found[name][0] - value) < 2 * found[name][1], name  # of four standard uncertainties
    assert found["rise_time"][0] == pytest.approx(rise_time(), rel=0.02)
    assert found["rise_time"][1] < 0.01 * rise_time()
