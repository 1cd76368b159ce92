"""A computer that stands still for seconds, as a virtual machine does: no run ends by that, and none is wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import processes
import pytest

from bench.recording import Recording

STANDSTILL_S = 2.5


def family(pid: int) -> list[int]:
    """A process and its descendants."""
    children = [int(c) for t in Path(f"/proc/{pid}/task").glob("*/children") for c in t.read_text().split()]
    return [pid, *(p for child in children for p in family(child))]


@contextmanager
def standing_still(*processes_: subprocess.Popen[str]) -> Iterator[None]:
    """Nothing of these processes runs within the block."""
    both = [pid for process in processes_ for pid in family(process.pid)]
    for pid in both:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in both:
            os.kill(pid, signal.SIGCONT)


@pytest.mark.long
@pytest.mark.timeout(180)
@pytest.mark.parametrize("link", ["slcan:socket", "serial:pty"])
def test_rig_and_bench_stand_still_together(tmp_path: Path, link: str) -> None:
    plan = ("--no-report", "--plan", "seconds=2", "--plan", 'act="drive"')
    with processes.served(tmp_path) as rig:
        with processes.bench(tmp_path, *processes.live(rig, link, "tiny-levitated", *plan)) as child:
            for number in range(2):
                child.wait_for(f"number {number}")
                with standing_still(rig.child.process, child.process):
                    time.sleep(STANDSTILL_S)
            assert child.end() == 0, child.err[-8:]
            record = processes.record_in(tmp_path, child)
    codes = {f["code"] for f in record["findings"]}
    assert {"telemetry-late", "heartbeat-late"} <= codes
    assert [f for f in record["findings"] if f["effect"] != "note"] == []
    assert record["link"]["counts"]["lost"] == record["link"]["errors"] == 0
    (path,) = (tmp_path / "runs").glob("*/recording.mcap")
    recording: Recording[object] = Recording.open(path)
    for step in recording.steps("look"):
        assert abs(len(step.read("supply")["supply"]) - 1e-6 * (step.end_ns - step.start_ns)) <= 1
        assert step.end_ns - step.start_ns > 2e9
