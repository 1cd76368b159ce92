"""Spindown while the motor carries, then the maximum speed that rests on it, over CAN: a served rig and a bench as processes of
their own, the torque constant taken from the truth."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import processes
import pytest

from bench.calibration import Calibration
from bench.calibration.store import Store
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from sim_backend.truth import draw

RIG, SEED = "tsbs12-drag", 10
DOWN = {"motor_carries": True, "repeats": 2, "speed_rad_s": 50.0, "steady_s": 0.2, "settle_s": 0.5}
UP = {"repeats": 3, "average_s": 0.8, "capture_s": 0.4, "dwell_s": 1.2}
NOISE = {"speed_half": 0.01, "speed_op": 0.02, "ratio": 4e-4, "ratio_predicted": 4e-4, "speed_sd": 5e-3}
"""How far noise alone may take a run, some eight standard deviations: few windows tell these too badly for a bound by U."""


def torque_constant() -> Calibration:
    """As torque-constant would have found it, to a thousandth."""
    rig, true = load_rig(RIG), draw(load_rig(RIG), SEED).quantities
    us = {"alpha_tau": (1e-3 * true["alpha_tau"], "N m/A"), "gamma_0t": (math.radians(0.01), "rad")}
    estimates = {
        name: Estimate.of(true[name], Influence(f"torque-constant/{name}", name, u, unit, "B", "normal"))
        for name, (u, unit) in us.items()
    }
    return Calibration(
        "torque-constant", estimates, run_id="torque-constant", rig=RIG, uut=rig.uut.serial, backend="served",
        sha256="0" * 64,
    )  # fmt: skip


def ran(folder: Path, rig: processes.Served, procedure: str, plan: dict[str, Any]) -> tuple[Path, dict[str, Any]]:
    """A live run that ends DONE or PASS with nothing but notes: its folder, and its results by name and place."""
    settings = [x for key, value in plan.items() for x in ("--plan", f"{key}={json.dumps(value)}")]
    given = processes.live(rig, "slcan:socket", procedure, "--no-report", "--calibrations", "known", name=RIG)
    with processes.real_bench(folder, *given, *settings) as child:
        status = child.end(240.0)
        record = processes.record_in(folder, child)
    said = [f for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, said) == (0, []), record["findings"]
    return folder / child.out[-1], {
        m["name"] + (f"@{m['where']}" if m["where"] else ""): m for m in record["measurements"]
    }


@pytest.mark.links
@pytest.mark.timeout(500)
def test_the_maximum_speed_of_a_served_rig_is_what_its_own_run_downs_expect(tmp_path: Path) -> None:
    store = Store.of(load_rig(RIG), None, tmp_path / "known")
    store.adopt(torque_constant())
    with processes.served(tmp_path, "--seed", str(SEED), rig=RIG) as rig:
        where, drag = ran(tmp_path, rig, "spindown", DOWN)
        with processes.real_bench(tmp_path, "adopt", str(where), "--rig", RIG, "--calibrations", "known") as child:
            assert child.end() == 0, child.err
        _, found = ran(tmp_path, rig, "maximum-speed", UP)
        states = rig.state_lines()
    down = simulated_run("spindown", RIG, SEED, DOWN, tmp_path / "down.mcap")
    facts = {"spindown": down.calibration(), "torque-constant": torque_constant()}
    up = simulated_run("maximum-speed", RIG, SEED, UP, tmp_path / "up.mcap", None, facts)
    true = {f"{name}@motor carries": x for name, x in truth_of_motion(down).items()} | truth_of_motion(up)
    assert len(true) == 4 + 9
    for name, value in true.items():
        m = (drag | found)[name]
        bound = NOISE.get(name.partition("@")[0], 1.3 * m["expanded_uncertainty"])
        assert abs(m["value"] - value) < bound, name
    assert abs(found["ratio"]["value"] / found["ratio_predicted"]["value"] - 1) < 0.01
    assert states[-1].endswith("-> OFF")
