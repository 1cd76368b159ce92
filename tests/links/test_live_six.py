"""The servomotor of six phases over CAN: its frame is tried, served rig and bench as processes of their own."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest

RIG = "tsbs6"
PORTS = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "fieldbus=modbus-tcp:127.0.0.1:0",
         "--link", "operator=line:127.0.0.1:0")  # fmt: skip


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_printed_sign_is_found_on_a_served_rig_before_the_motor_carries(tmp_path: Path) -> None:
    """(7.6b) as printed: the run ends after the motor was leaned on, and the rig is made safe."""
    with processes.served(tmp_path, "--seed", "1", "--truth", "literal_7_6b=1", rig=RIG, ports=PORTS) as rig:
        given = ("run", "angle-step", "--rig", RIG, "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *given, *rig.links("slcan:socket")) as child:
            status = child.end(240.0)
            record, states = processes.record_in(tmp_path, child), rig.state_lines()
    serious = [f["code"] for f in record["findings"] if f["effect"] != "note"]
    assert states[-1].endswith("-> OFF")
    assert (status, record["outcome"]) == (3, "ERROR"), record["findings"]
    assert "motor-frame" in serious
