"""The rotary-linear motor over serial packets: a served rig and a bench as processes of their own; a bench that is killed."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest

RIG = "rlsrm"
PORTS = ("--link", "controller=serial:socket://127.0.0.1:0", "--link", "operator=line:127.0.0.1:0")


def changes(lines: list[str]) -> list[str]:
    """`FROM -> TO, fault NAME` of the controller, without their times."""
    return [line.split(": ", 1)[1] for line in lines]


@pytest.mark.long
@pytest.mark.timeout(300)
def test_an_axis_moves_over_packets(tmp_path: Path) -> None:
    with processes.served(tmp_path, "--seed", "1", rig=RIG, ports=PORTS) as rig:
        arguments = processes.live(rig, "serial:socket", "tiny-stage", "--no-report", name=RIG)
        with processes.bench(tmp_path, *arguments, catalogue="stage_catalogue") as child:
            status = child.end(240.0)
            record = processes.record_in(tmp_path, child)
            told = changes(rig.state_lines())
    serious = [f["code"] for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, record["outcome"], serious) == (0, "DONE", []), record["findings"]
    assert record["link"]["gaps"] == 0
    assert abs(record["measurements"][0]["value"]) < 60e-6
    assert told[:3] == ["OFF -> READY", "READY -> HOMING", "HOMING -> READY"]
    assert "HOLDING -> MOVING" in told
    assert told[-1].endswith("-> OFF")


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_machine_whose_bench_is_killed_stops_by_itself_and_says_so(tmp_path: Path) -> None:
    with processes.served(tmp_path, "--seed", "1", rig=RIG, ports=PORTS) as rig:
        arguments = processes.live(rig, "serial:socket", "tiny-stage", "--no-report", "--plan", 'act="count"', name=RIG)
        with processes.bench(tmp_path, *arguments, catalogue="stage_catalogue") as child:
            child.wait_for("at ", timeout_s=120.0)
            seen = len(rig.child.err)
            child.kill()
        rig.child.wait_for("-> FAULT", seen)
        told = changes([line for line in rig.child.err[seen:] if " -> " in line])
    assert told[-2:] == ["MOVING -> STOPPING, fault HEARTBEAT_LOST", "STOPPING -> FAULT, fault HEARTBEAT_LOST"]


SHORT = {
    "step-following": ('moved="stroke"', "together=false", "repeats=2", "lead=0", "dwell_s=2.0"),
    "sine-following": ('moved="angle"', "together=false", "periods=1"),
}


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize("procedure", SHORT)
def test_a_procedure_of_stages_runs_over_packets(tmp_path: Path, procedure: str) -> None:
    """A short plan: what was recorded is whole, and within the limits."""
    plan = [word for setting in SHORT[procedure] for word in ("--plan", setting)]
    with processes.served(tmp_path, "--seed", "1", rig=RIG, ports=PORTS) as rig:
        arguments = processes.live(rig, "serial:socket", procedure, "--no-report", *plan, name=RIG)
        with processes.bench(tmp_path, *arguments, catalogue="bench.cli") as child:
            status = child.end(240.0)
            record = processes.record_in(tmp_path, child)
            told = changes(rig.state_lines())
    serious = [f["code"] for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]
    assert (status, record["outcome"], serious) == (0, "PASS", []), record["findings"]
    assert record["link"]["gaps"] == 0
    assert told[-1].endswith("-> OFF")
