"""Lift-off over CAN: a served rig and a bench as processes of their own, the motor's constants taken from the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import processes
import pytest

from bench.calibration import Calibration
from bench.calibration.store import Store
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from sim_backend.truth import draw

RIG, SEED = "tsbs12-close", 10
PLAN = ("repeats=2", "dwell_s=0.3", "rate_rad_s=5e-3", "raise_s=0.4", "settle_s=0.3", "average_s=0.3", "rest_s=0.3",
        "gamma_max_rad=0.035", "back_rad_s=0.1")  # fmt: skip


def adopt(folder: Path, true: Mapping[str, float]) -> None:
    """The constants as other procedures would have found them, to a thousandth."""
    turn = 8 * true["gamma_0"]
    known = {
        "force-constant": {
            "alpha_d@0": true["alpha_ratio"] * true["alpha_c"] * math.cos(turn),
            "alpha_d": true["alpha_d"],
            "alpha_dx": true["alpha_dx"],
        },
        "negative-stiffness": {"alpha_x_prime": true["alpha_x_prime"]},
        "force-coupling": {"alpha_c": true["alpha_c"], "gamma_0": true["gamma_0"]},
    }
    rig = load_rig(RIG)
    store = Store.of(rig, None, folder)
    for procedure, values in known.items():
        estimates = {
            name: Estimate.of(value, Influence(f"{procedure}/{name}", name, 1e-3 * abs(value), "1", "B", "normal"))
            for name, value in values.items()
        }
        store.adopt(
            Calibration(
                procedure, estimates, run_id=procedure, rig=RIG, uut=rig.uut.serial, backend="served", sha256="0" * 64
            )
        )


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_motor_lifts_on_a_served_rig(tmp_path: Path) -> None:
    true = draw(load_rig(RIG), SEED).quantities
    adopt(tmp_path / "known", true)
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
