"""`bench campaign` killed and interrupted as a process of its own, and gone on with."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from test_campaign import HEAD, TWO, environment

SLOW = TWO.replace('"tiny-needing"\n', '"tiny-needing"\nplan = { act = "count" }\n')
MANY = ("--count", "14", "--jobs", "2", "--no-report")


def start(tmp_path: Path, text: str, *arguments: str) -> subprocess.Popen[str]:
    (tmp_path / "c.toml").write_text(text)
    return subprocess.Popen(
        [sys.executable, "-m", "campaign_catalogue", "campaign", "c.toml", *arguments], cwd=tmp_path, env=environment(),
        text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


def entries(tmp_path: Path) -> list[dict[str, Any]]:
    found = sorted((tmp_path / "runs").glob("small.campaign-*/journal.jsonl"))
    assert len(found) <= 1
    return [json.loads(line) for line in found[0].read_text().splitlines()] if found else []


def wait_for(tmp_path: Path, lines: int, child: subprocess.Popen[str]) -> None:
    for _ in range(1200):
        if len(entries(tmp_path)) >= lines:
            return
        assert child.poll() is None, child.communicate()[1]
        time.sleep(0.05)
    raise AssertionError(f"no {lines} lines in the journal")


def alive(group: int) -> list[int]:
    """Processes of a session that still run, by /proc (zombies do not count)."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, *fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and state != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.long
@pytest.mark.timeout(300)
def test_many_rigs_killed_and_gone_on_with(tmp_path: Path) -> None:
    """What was noted stays, nothing is done twice, no process is left, and all rigs are there in the end."""
    with start(tmp_path, HEAD + TWO, *MANY) as child:
        wait_for(tmp_path, 3, child)
        os.kill(child.pid, signal.SIGKILL)
        child.communicate()
    for _ in range(100):  # the pool's processes notice that their parent is gone
        if not alive(child.pid):
            break
        time.sleep(0.1)
    assert alive(child.pid) == []
    before = entries(tmp_path)
    with start(tmp_path, HEAD + TWO, *MANY) as child:
        _, err = child.communicate()
    assert child.returncode == 5, err
    assert "going on with" in err
    after = entries(tmp_path)
    assert after[: len(before)] == before
    assert sorted(e["seed"] for e in after if e["kind"] == "rig") == list(range(14))
    (folder,) = (tmp_path / "runs").iterdir()
    assert not (folder / "work").exists()


@pytest.mark.long
@pytest.mark.timeout(300)
def test_many_rigs_interrupted_end_in_order(tmp_path: Path) -> None:
    """Ctrl-C reaches every process of the group; rigs under way are finished and noted."""
    with start(tmp_path, HEAD + TWO, *MANY) as child:
        wait_for(tmp_path, 2, child)
        os.killpg(child.pid, signal.SIGINT)
        _, err = child.communicate()
    assert child.returncode == 4, err
    assert "Traceback" not in err
    assert "under way" in err
    done = [e["seed"] for e in entries(tmp_path)]
    assert 2 <= len(done) < 14
    with start(tmp_path, HEAD + TWO, *MANY) as child:
        _, err = child.communicate()
    assert child.returncode == 5, err
    assert sorted(e["seed"] for e in entries(tmp_path) if e["kind"] == "rig") == list(range(14))


@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.long)])
def test_one_rig_stopped_in_a_step_goes_on_with_that_step(tmp_path: Path, number: signal.Signals) -> None:
    with start(tmp_path, HEAD + SLOW, "--no-report") as child:
        wait_for(tmp_path, 1, child)
        assert child.stderr is not None
        for line in child.stderr:
            if line.startswith("at "):  # the second step moves the machine
                break
        os.killpg(child.pid, number)
        _, err = child.communicate()
    noted = [e["outcome"] for e in entries(tmp_path)]
    if number is signal.SIGINT:
        assert child.returncode == 4, err
        assert noted == ["DONE", "ABORTED"]
    else:
        assert noted == ["DONE"]
    with start(tmp_path, HEAD + TWO, "--no-report") as child:
        _, err = child.communicate()
    assert child.returncode == 2
    assert 'steps.2.plan.act: started with "count", now "measure"' in err
    with start(tmp_path, HEAD + SLOW, "--no-report") as child:
        assert child.stderr is not None
        seen = []
        for line in child.stderr:
            seen.append(line)
            if line.startswith("at "):
                break
        child.send_signal(signal.SIGTERM)
        child.communicate()
    assert child.returncode == 4
    assert any("[2/2] tiny-needing" in line for line in seen)
    assert not any("[1/2]" in line for line in seen)
