"""One small procedure over one link, and who may use the rig when: a served rig and a bench as processes of their own."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import processes
import pytest
from listener import Listener

from bench.recording import Recording


@pytest.mark.timeout(120)
def test_a_live_run_loses_nothing_and_frees_the_rig(tmp_path: Path) -> None:
    with processes.served(tmp_path) as rig:
        for _ in range(2):  # the second one finds the rig free although the first has just ended
            status, record = processes.run(tmp_path, rig, "slcan:socket", "tiny-levitated", "--no-report")
            assert (status, record["outcome"]) == (0, "DONE"), record["findings"]
    assert [f for f in record["findings"] if f["code"] not in processes.EXPECTED] == []
    assert "simulated-controller" in [f["code"] for f in record["findings"]]
    assert record["link"]["gaps"] == 0
    assert record["link"]["errors"] == 0
    counts = record["link"]["counts"]
    assert counts["heartbeats"] > 50
    (first, _) = sorted((tmp_path / "runs").glob("*/recording.mcap"))
    recording: Recording[object] = Recording.open(first)
    seen = recording.channel("supply")
    assert (np.diff(seen["index"]) == 1).all()
    assert len(seen["index"]) > 1500
    states = rig.state_lines()
    assert states[-1].endswith("-> OFF")


@pytest.mark.long
@pytest.mark.timeout(120)
def test_the_drive_turns_the_shaft_and_lets_it_coast(tmp_path: Path) -> None:
    plan = ("--plan", 'act="drive"', "--no-report")
    with processes.served(tmp_path) as rig:
        status, record = processes.run(tmp_path, rig, "serial:socket", "tiny-levitated", *plan)
    assert (status, record["outcome"]) == (0, "DONE"), record["findings"]
    assert not [f for f in record["findings"] if f["code"] not in processes.EXPECTED]
    (path,) = (tmp_path / "runs").glob("*/recording.mcap")
    recording: Recording[object] = Recording.open(path)
    assert {"telemetry", "drive", "supply", "thermal"} <= set(recording.streams)
    drive, shaft = recording.channel("drive_actual_speed"), recording.channel("speed")
    assert (np.diff(drive["index"]) == 1).all()
    ours = np.interp(drive["t_ns"], shaft["t_ns"], shaft["speed"])
    level = np.abs(drive["drive_actual_speed"] - 20.0) < 0.3
    assert level.sum() >= 8
    assert np.abs(ours - drive["drive_actual_speed"])[level].max() < 0.5
    assert np.abs(shaft["speed"][-200:]).max() < 0.5
    assert [e["command"] for e in recording.events("drive")][:2] == ["run", "coast"]


@pytest.mark.long
@pytest.mark.timeout(120)
def test_a_person_may_take_longer_than_the_watchdog(tmp_path: Path) -> None:
    with processes.served(tmp_path) as rig, Listener(rig.endpoints["slcan:socket"]) as bus:
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", "--operator", "console")
        with processes.bench(tmp_path, *arguments, stdin=subprocess.PIPE) as child:
            up = bus.wait_for(lambda h: h.state == "LEVITATED")
            still = bus.wait_for(
                lambda h: h.tick > up.tick + 35_000
            )  # 3.5 s of the controller's time without an answer
            assert still.state == "LEVITATED"
            assert child.process.stdin is not None
            child.process.stdin.write("\n\n")
            child.process.stdin.close()
            assert child.end() == 0, child.err
    assert sum(x.count("Take every mass off") for x in child.err) == 1  # what hangs already is not asked for again
