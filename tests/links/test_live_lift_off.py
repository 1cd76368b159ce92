"""Lift-off over CAN: a served rig and a bench as processes of their own, the motor's constants taken from the truth."""

from __future__ import annotations

import math
from pathlib import Path

import motor_constants
import processes
import pytest

from bench.rigfile import load_rig
from sim_backend.truth import draw

RIG, SEED = "tsbs12-close", 10
PLAN = ("repeats=2", "dwell_s=0.3", "rate_rad_s=5e-3", "raise_s=0.4", "settle_s=0.3", "average_s=0.3", "rest_s=0.3",
        "gamma_max_rad=0.035", "back_rad_s=0.1")  # fmt: skip


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_motor_lifts_on_a_served_rig(tmp_path: Path) -> None:
    true = draw(load_rig(RIG), SEED).quantities
    motor_constants.adopt(RIG, tmp_path / "known", true)
    settings = [x for value in PLAN for x in ("--plan", value)]
    with processes.served(tmp_path, "--seed", str(SEED), rig=RIG) as rig:
        given = processes.live(
            rig, "slcan:socket", "lift-off", "--no-report", "--calibrations", str(tmp_path / "known"), name=RIG
        )
        with processes.real_bench(tmp_path, *given, *settings) as child:
            status = child.end(240.0)
            record, states = processes.record_in(tmp_path, child), rig.state_lines()
    said = [f for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, record["outcome"], said) == (0, "DONE", []), record["findings"]
    found = {m["name"]: m for m in record["measurements"]}
    assert set(found) == {"gamma_lift", "gamma_predicted", "gamma_zero", "rest_depth"}
    for name in ("gamma_lift", "gamma_predicted", "gamma_zero"):
        assert found[name]["value"] == pytest.approx(true[name], abs=math.radians(0.08)), name
    assert [line.split(" -> ")[1] for line in states].count("LEVITATED") == 4
    assert states[-1].endswith("-> OFF")
