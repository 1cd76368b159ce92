"""SIGKILL: a rig whose bench dies coasts and lands alone; a bench whose rig dies says so."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest
from listener import Listener


def test_a_killed_bench_leaves_a_rig_that_coasts_down_and_lands_alone(tmp_path: Path) -> None:
    with processes.served(tmp_path) as rig, Listener(rig.endpoints["slcan:socket"]) as bus:
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", "--plan", 'act="spin"')
        with processes.bench(tmp_path, *arguments) as child:
            child.wait_for("at ")
            child.wait_for("at ", len(child.err))
            seen = len(bus.heard)
            child.kill()
        coasting = bus.wait_for(lambda h: h.state != "SPINNING", seen)
        landing = bus.wait_for(lambda h: h.state == "LANDING", seen)
        end = bus.wait_for(lambda h: h.state == "FAULT", seen)
    assert coasting.state == "COASTING"
    assert abs(coasting.speed) > 25
    assert coasting.fault == end.fault == "HEARTBEAT_LOST"
    assert processes.PATIENCE_S <= coasting.host_age < processes.PATIENCE_S + 0.002
    assert abs(landing.speed) <= 5.1
    assert landing.tick < end.tick


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_stand_whose_bench_is_killed_at_speed_coasts_down_and_lands_alone(tmp_path: Path) -> None:
    """Its shaft is turned by a drive that no controller commands: both notice by themselves that nobody is there,
    the controller before the drive's own time-out lets the shaft slow down."""
    speeds = ("--plan", "speeds_rpm=[2000]", "--plan", "dwell_s=30", "--plan", "slow_s=30")
    with (
        processes.served(tmp_path, "--seed", "1", rig="amb5dof", patience_s=1.0) as rig,
        Listener(rig.endpoints["slcan:socket"], "amb5dof") as bus,
    ):
        run = ("run", "unbalance", "--rig", "amb5dof", "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *run, *rig.links("slcan:socket"), *speeds) as child:
            fast = bus.wait_for(lambda h: h.state == "SPINNING" and h.speed > 30, timeout_s=150.0)
            seen = len(bus.heard)
            child.kill()
        left = bus.wait_for(lambda h: h.state != "SPINNING", seen)
        landing = bus.wait_for(lambda h: h.state == "LANDING", seen, timeout_s=120.0)
        end = bus.wait_for(lambda h: h.state == "FAULT", seen)
        heard = bus.heard[seen:]
    assert fast.state == "SPINNING"
    assert left.state == "COASTING"
    assert left.speed > 28  # slow roll, above the landing speed
    assert left.fault == end.fault == "HEARTBEAT_LOST"
    assert landing.speed <= 20.1
    assert [h for h in heard if h.state in ("LANDING", "FAULT") and h.speed > 20.1] == []


@pytest.mark.long
def test_a_killed_rig_is_noticed(tmp_path: Path) -> None:
    with processes.served(tmp_path) as rig:
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", "--plan", 'act="count"')
        with processes.bench(tmp_path, *arguments) as child:
            child.wait_for("at ")
            rig.child.kill()
            assert child.end() == 3
            record = processes.record_in(tmp_path, child)
    assert record["outcome"] == "ERROR"
    codes = [f["code"] for f in record["findings"]]
    assert codes[0] == "link-lost"
    assert "make-safe-failed" in codes


@pytest.mark.long
def test_a_bench_that_hangs_is_as_good_as_dead(tmp_path: Path) -> None:
    import signal

    with processes.served(tmp_path) as rig, Listener(rig.endpoints["slcan:socket"]) as bus:
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", "--plan", 'act="count"')
        with processes.bench(tmp_path, *arguments) as child:
            child.wait_for("at ")
            seen = len(bus.heard)
            child.process.send_signal(signal.SIGSTOP)
            bus.wait_for(lambda h: h.state == "FAULT" and h.fault == "HEARTBEAT_LOST", seen)
            child.process.send_signal(signal.SIGCONT)
            assert child.end() == 4
            record = processes.record_in(tmp_path, child)
    assert record["outcome"] == "ABORTED"
    assert record["findings"][0]["code"] == "controller-fault"
