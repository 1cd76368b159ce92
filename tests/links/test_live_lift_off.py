"""Lift-off over CAN: the chain before it and lifts by the motor on a served rig, whose controller says LIFTING meanwhile."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import processes
import pytest

from bench.campaign import file

STEPS = ("amb-calibration", "force-constant", "negative-stiffness", "force-coupling", "lift-off")


def short(folder: Path) -> Path:
    """The steps of the shipped campaign that it needs, at their short plans, and two lifts each way."""
    text = file.load("tsbs-identification")[1].read_text(encoding="utf-8")
    head, *steps = text.split("[[step]]")
    last, *_ = steps[-1].split("[equations]")
    steps = [*steps[:-1], last]
    used = [next(s for s in steps if f'procedure = "{name}"' in s) for name in STEPS]
    used = [s.replace("virtual_plan", "plan").replace("repeats = 3", "repeats = 2") for s in used]
    path = folder / "short.toml"
    path.write_text("[[step]]".join([head, *used]), encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_end_is_lifted_as_predicted_on_a_served_rig(tmp_path: Path) -> None:
    with processes.served(tmp_path, "--seed", "3", rig="tsbs12") as rig:
        given = ("campaign", str(short(tmp_path)), "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *given, *rig.links("slcan:socket")) as child:
            assert child.end(840.0) == 0, "\n".join(child.err[-12:])
            found = [json.loads(p.read_text()) for p in (tmp_path / child.out[-1] / "runs").glob("*/record.json")]
        states = rig.state_lines()
    record: dict[str, Any] = next(r for r in found if r["procedure"] == "lift-off")
    codes = {f["code"]: f["effect"] for f in record["findings"]}
    assert "as-predicted" in codes
    assert {c for c, effect in codes.items() if effect != "note"} <= set(processes.EXPECTED)
    values = {m["name"]: m["value"] for m in record["measurements"]}
    assert values["gamma_lift"] == pytest.approx(values["gamma_predicted"], abs=1e-3)
    assert states[-1].endswith("-> OFF")
