"""`bench listen` beside a served rig, on each of its endpoints, and on a terminal."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from processes import Served, bench, live, real_bench, served

from bench.cli.__main__ import main

pytestmark = [pytest.mark.long, pytest.mark.timeout(120)]


def listened(capsys: pytest.CaptureFixture[str], rig: str, url: str, *arguments: str) -> list[str]:
    assert main(("listen", rig, "--link", f"controller={url}", "--seconds", "2", *arguments)) == 0
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("rig", ["tsbs12", "amb5dof"])
def test_every_endpoint_is_heard_and_nothing_is_sent(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, rig: str
) -> None:
    with served(tmp_path, rig=rig, patience_s=None) as there:
        for kind in ("slcan:socket", "slcan:pty", "serial:socket", "serial:pty"):
            out = listened(capsys, rig, there.endpoints[kind])
            (row,) = [x.split() for x in out if x.startswith("  Telemetry ")]
            assert int(row[3]) > 1000, kind
            assert any("listen-only (L)" in x for x in out) is kind.startswith("slcan")
            assert any(x.startswith("  state     OFF, fault NONE") for x in out)
        there.child.process.send_signal(signal.SIGINT)
        assert there.child.end() == 0
        assert "received 0 (unknown 0)" in there.child.err[-1]  # frames: no heartbeat, no claim, no command
        assert there.state_lines() == []


def test_it_hears_another_host_at_work_and_does_not_disturb_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with served(tmp_path) as there:
        url = there.endpoints["slcan:socket"]
        with bench(
            tmp_path, *live(there, "slcan:socket", "tiny-levitated", "--plan", "seconds=8", "--no-report")
        ) as run:
            there.child.wait_for("-> LEVITATED")
            links = ("--link", f"fieldbus={there.endpoints['modbus-tcp']}", "--poll")
            out = listened(capsys, "tsbs12", url, *links)
            assert run.end() == 0, run.err[-5:]
    text = "\n".join(out)
    assert "Heartbeat (a host's)" in text
    assert "supply    voltage 14" in text
    assert "state     LEVITATED" in text or "state     READY" in text


def test_a_pty_that_another_host_has_is_refused_by_name(tmp_path: Path) -> None:
    with served(tmp_path) as there:
        with bench(tmp_path, *live(there, "slcan:pty", "tiny-levitated", "--plan", "seconds=8", "--no-report")) as run:
            there.child.wait_for("-> LEVITATED")
            refused = ("listen", "tsbs12", "--link", f"controller={there.endpoints['slcan:pty']}", "--seconds", "1")
            with real_bench(tmp_path, *refused) as child:
                assert child.end() == 2
                assert f"it is in use by process {run.process.pid}" in child.err[-1]
            assert run.end() == 0, run.err[-5:]


def test_a_terminal_has_a_screen_and_ctrl_c_ends_it_with_status_0(tmp_path: Path) -> None:
    with served(tmp_path, patience_s=None) as there:
        drawn, status = on_a_terminal(there, tmp_path)
    assert status == 0
    assert b"\x1b[?1049h" in drawn  # a screen of its own, which is gone afterwards
    frames, _, after = drawn.partition(b"\x1b[?1049l")
    assert b"Ctrl-C ends" in frames
    assert "pos_xi" in frames.decode()
    assert b"tsbs12: listened" in after
    assert b"\x1b[?25h" in drawn  # the cursor is back


def on_a_terminal(there: Served, folder: Path) -> tuple[bytes, int]:
    """What a terminal of 80 by 24 gets until Ctrl-C, and the status."""
    master, slave = pty.openpty()
    environment = {**os.environ, "COLUMNS": "80", "LINES": "24", "TERM": "xterm"}
    arguments = ("listen", "tsbs12", "--link", f"controller={there.endpoints['slcan:socket']}")
    child = subprocess.Popen([sys.executable, "-m", "bench.cli", *arguments], cwd=folder, env=environment,
                             stdin=slave, stdout=slave, stderr=subprocess.DEVNULL)  # fmt: skip
    os.close(slave)
    drawn, asked, deadline = b"", False, time.monotonic() + 60
    while time.monotonic() < deadline and select.select([master], [], [], 10)[0]:
        try:
            data = os.read(master, 65536)
        except OSError:  # its end
            break
        drawn += data
        if not asked and b"Ctrl-C ends" in drawn:
            asked = True
            child.send_signal(signal.SIGINT)
    os.close(master)
    return drawn, child.wait(10)
