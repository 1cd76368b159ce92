"""A run-up to 14 000 r/min over CAN and Modbus: a served rig and a bench as processes of their own."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import processes
import pytest

from bench.recording import Recording

PLAN = (
    "acceleration_rad_s2=200", "bottom_rpm=1150", "top_rpm=14000", "speeds_rpm=[3000, 8000, 13000]", "slow_s=4.5", "settle_s=1",
    "capture_s=0.2",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_run_up_to_14000_with_three_captures(tmp_path: Path) -> None:
    plan = [x for value in PLAN for x in ("--plan", value)]
    with processes.served(tmp_path, "--seed", "1", rig="amb5dof") as rig:
        links = rig.links("slcan:socket")
        given = ("run", "run-up", "--rig", "amb5dof", "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *given, *links, *plan) as child:
            status = child.end(240.0)
            record = processes.record_in(tmp_path, child)
        states = rig.state_lines()
    serious = [f for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, record["outcome"], serious) == (0, "PASS", []), record["findings"]
    assert "no-critical" in {f["code"] for f in record["findings"]}
    assert states[-1].endswith("-> OFF")
    recording: Recording[object] = Recording.open(tmp_path / child.out[-1] / "recording.mcap")
    assert {"telemetry", "drive"} <= set(recording.streams)
    captures = recording.captures()
    assert [round(c.labels["passed_rad_s"] * 30 / math.pi) for c in captures] == [3000, 8000, 13000]
    assert all(c.rate_hz == 10000 and c.samples == 2000 for c in captures)
    speed = recording.channel("speed")["speed"]
    assert float(np.max(speed)) * 30 / math.pi > 13900
    held = recording.channel("state")["state"]
    names = recording.rig.choices("state")
    resting = [code for code, name in names.items() if name in ("OFF", "READY")]
    assert float(speed[np.isin(held, resting)].max()) <= 20.0  # never let go above the landing speed
