"""A calibration whose bench is killed goes on over the link, on the served machine that had landed by itself meanwhile."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest

from bench.recording import Recording
from bench.recording.earlier import AGAIN

# Noise alone makes readings of 0.1 s drift by up to 1.7 of the 2 mA allowed.
PLAN = ("angles=1", "rounds=8", "settle_s=0.3", "average_s=0.2")
KILLED_AT = 60
NEARLY_DONE = f"step {KILLED_AT + 1}/72"


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_a_killed_calibration_goes_on_over_the_link(tmp_path: Path) -> None:
    plan = [word for text in PLAN for word in ("--plan", text)]
    with processes.served(tmp_path, "--seed", "1") as rig:
        run = ("run", "amb-calibration", "--rig", "tsbs12", "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *run, *rig.links("slcan:socket"), *plan) as child:
            child.wait_for(NEARLY_DONE, timeout_s=500.0)
            child.kill()
        rig.child.wait_for("LANDING -> FAULT")  # until its rotor rests, the controller obeys the host that is gone
        (first,) = (tmp_path / "runs").glob("amb-calibration-*")
        before = Recording.open(first / "recording.mcap")
        assert before.truncated
        done = len(before.steps("hang"))
        with processes.real_bench(tmp_path, "run", "--continue", str(first), "--no-report") as child:
            assert child.end(500.0) == 0, child.err[-10:]
            record = processes.record_in(tmp_path, child)
            second = Path(child.out[-1])
        states = [line.split(": ", 1)[1] for line in rig.state_lines()]
    assert "FAULT" in " ".join(states)  # it landed alone, and the fault of a lost host was cleared for the second run
    assert record["outcome"] == "PASS"
    assert {f["code"] for f in record["findings"]} <= {
        *processes.EXPECTED,
        "continued",
        "fault-cleared",
        "parameters-restored",
        "one-angle",
        "step-incomplete",  # readings of the register devices, ten a second, of a server that is late
    }
    (continued,) = record["continues"]
    assert (continued["run_id"], continued["stopped"]) == (first.name, "killed")
    recording = Recording.open(tmp_path / second / "recording.mcap")
    assert KILLED_AT - 2 <= done <= KILLED_AT + 1
    assert len(recording.steps("hang")) == 72
    assert len(recording.steps(f"hang{AGAIN}")) == 1
