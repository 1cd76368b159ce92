"""The servomotor of six phases over CAN: an angle step, served rig and bench as processes of their own, with captures."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest

RIG = "tsbs6"
PORTS = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "fieldbus=modbus-tcp:127.0.0.1:0",
         "--link", "operator=line:127.0.0.1:0")  # fmt: skip
PLAN = ("repeats=2", "steps_deg=[15]", "steps_static_deg=[10]", "settle_s=1.5", "standstill_s=0.3", "record_s=0.8")


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize("planted", ["", "literal_7_6b=1"])
def test_a_step_of_15_degrees_on_a_served_rig(tmp_path: Path, planted: str) -> None:
    """Force first leaves the orbit as it is; a printed sign of the motor's frame ends the run before the motor carries."""
    truth = ("--truth", planted) if planted else ()
    with processes.served(tmp_path, "--seed", "1", *truth, rig=RIG, ports=PORTS) as rig:
        given = ("run", "angle-step", "--rig", RIG, "--backend", "live", "--operator", "auto", "--no-report")
        plan = [x for value in PLAN for x in ("--plan", value)]
        with processes.real_bench(tmp_path, *given, *rig.links("slcan:socket"), *plan) as child:
            status = child.end(240.0)
            record, states = processes.record_in(tmp_path, child), rig.state_lines()
    serious = [f["code"] for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert states[-1].endswith("-> OFF")
    if planted:
        assert (status, record["outcome"]) == (3, "ERROR"), record["findings"]
        assert "motor-frame" in serious
        return
    assert (status, serious) == (0, []), record["findings"]
    found = {(m["name"], m["where"]): m["value"] for m in record["measurements"]}
    assert found["excess", "priority, 15°, 1000 Hz"] < 3e-6
    assert found["excess", "static, 10°, 1000 Hz"] > 5 * found["excess", "priority, 15°, 1000 Hz"]
    assert found["bound_excess", "priority, 15°, 1000 Hz"] < 2e-6
    assert found["amplitude", "priority, 15°, 1000 Hz"] == pytest.approx(10.0, abs=0.05)
