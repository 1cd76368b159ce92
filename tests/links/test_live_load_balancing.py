"""Load balancing over CAN: a served rig and a bench as processes of their own, the motor's constants taken from the truth."""

from __future__ import annotations

import json
from pathlib import Path

import motor_constants
import processes
import pytest

from bench.calibration.store import Store
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.rigfile import load_rig
from sim_backend.truth import draw

RIG, SEED = "tsbs12-offset", 5
PLAN = {"ways": ["forward"], "circle_hz": 0.5, "turns": 1, "repeats": 3, "settle_s": 1.0}
NOISE = {"reduction": 1e-3, "unbalance": 2e-3, "unbalance_ratio": 4e-3, "gamma_extreme": 2e-3, "error_radius": 5e-8}
"""How far noise may take three turns beyond the interval, and what the phase of a step on another computer's clock is worth."""


@pytest.mark.links
@pytest.mark.timeout(300)
def test_a_served_motor_balances_its_load_as_the_same_rig_in_one_process(tmp_path: Path) -> None:
    rig = load_rig(RIG)
    motor_constants.adopt(RIG, tmp_path / "known", draw(rig, SEED).quantities)
    store = Store.of(rig, None, tmp_path / "known")
    known = {p: c for p in ("force-constant", "negative-stiffness", "force-coupling") if (c := store.current(p))}
    here = simulated_run("load-balancing", RIG, SEED, PLAN, tmp_path / "here.mcap", None, known)
    true = truth_of_motion(here)
    settings = [x for key, value in PLAN.items() for x in ("--plan", f"{key}={json.dumps(value)}")]
    with processes.served(tmp_path, "--seed", str(SEED), rig=RIG) as served:
        given = processes.live(
            served, "slcan:socket", "load-balancing", "--no-report", "--calibrations", str(tmp_path / "known"), name=RIG
        )
        with processes.real_bench(tmp_path, *given, *settings) as child:
            status = child.end(240.0)
            record = processes.record_in(tmp_path, child)
    said = [f for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, record["outcome"], said) == (0, "DONE", []), record["findings"]
    found = {m["name"] + "@" + m["where"]: m for m in record["measurements"]}
    assert set(found) == set(true)
    for name, m in found.items():
        room = 1.5 * m["expanded_uncertainty"] + NOISE.get(m["name"], 0.0)
        assert m["value"] == pytest.approx(true[name], abs=room), name
    assert found["reduction@forward"]["value"] < -0.2
