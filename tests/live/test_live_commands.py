"""`--live` as commands: what is printed, what is refused, what an end leaves, and a served rig that is watched."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_client import Client, Page
from made_run import MadeRun

from bench.cli import live
from bench.cli.__main__ import main
from bench.cli.live import LivePage, PageRequest
from bench.cli.serve_live import Heard
from bench.link.frames import empty_batch
from bench.rigfile import load_rig
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0


@contextmanager
def process(*arguments: str, cwd: Path) -> Iterator[tuple[subprocess.Popen[str], Client]]:
    """`bench` with a page, in a process of its own, once it has said where."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "cli"), os.environ.get("PYTHONPATH", "")])
    with subprocess.Popen(
        [sys.executable, *arguments], cwd=cwd, env=os.environ | {"PYTHONPATH": path}, text=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as child:  # fmt: skip
        try:
            assert child.stderr is not None
            for line in child.stderr:
                if found := re.fullmatch(r"live page: (http://127\.0\.0\.1:\d+/#\S{22})\n", line):
                    break
            else:
                raise AssertionError(f"no address was printed: {child.communicate()}")
            yield child, Client(found[1])
        finally:
            child.kill()


def tiny(*arguments: str, cwd: Path) -> Any:
    words = ["-m", "tiny_catalogue", "run", "tiny-levitated", "--rig", "tsbs12", "--live", *arguments]
    return process(*words, cwd=cwd)


def test_stop_ends_the_command_with_status_4(tmp_path: Path) -> None:
    with tiny("--plan", "seconds=1e9", "--no-report", cwd=tmp_path) as (child, client), Page(client) as page:
        page.wait("progress", lambda p: p["step"].startswith("look"))
        assert client.post("/stop", {"by": "Ann"}).status == 202
        end = page.wait("end")
        out, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == end["status"] == 4
    assert end["outcome"] == "ABORTED"
    assert "operator-stop" in end["reason"]
    assert "STOP (page: Ann)" in err
    assert Path(tmp_path, out.splitlines()[-1]).is_dir()


def test_after_its_end_a_run_serves_its_report_while_a_page_is_open(tmp_path: Path) -> None:
    with tiny(cwd=tmp_path) as (child, client):
        with Page(client) as page:
            end = page.wait("end")
            assert end["report"] == "/report.html"
            report = client.ask("GET", "/report.html", {"Cookie": page.cookie})
            assert (report.status, report.body) == (200, Path(tmp_path, end["folder"], "report.html").read_bytes())
            assert child.poll() is None
        _, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == end["status"] == 0
    assert "the live page has the report until it is closed" in err


@pytest.fixture
def ended(tmp_path: Path) -> Iterator[LivePage]:
    """The page of a run that is over and has a report."""
    with live.opened(PageRequest(), None) as page:
        page.site.report = tmp_path / "report.html"
        page.site.report.write_text("<h1>Report</h1>")
        yield page


def client_of(page: LivePage) -> Client:
    return Client(page.site.url("127.0.0.1", page.server.port))


def test_the_wait_ends_with_ctrl_c(ended: LivePage, capsys: pytest.CaptureFixture[str]) -> None:
    client = client_of(ended)
    with Page(client):
        assert client.ask("GET", "/report.html", {"X-Levbench-Token": client.token}).status == 200
        asked = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        asked.start()
        ended.stay()
        asked.join()
    assert "until it is closed, for at most 300 s; Ctrl-C ends that" in capsys.readouterr().err


def test_the_wait_ends_when_the_page_is_closed(ended: LivePage) -> None:
    client = client_of(ended)
    with Page(client):
        assert client.ask("GET", "/report.html", {"X-Levbench-Token": client.token}).status == 200
    ended.stay()


def test_a_page_that_asks_for_no_report_is_not_waited_for(
    ended: LivePage, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(live, "FETCHED_S", 0.2)
    with Page(client_of(ended)):
        ended.stay()
    assert capsys.readouterr().err == ""


def test_nobody_looks_and_nobody_is_waited_for(ended: LivePage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live.time, "sleep", lambda _: pytest.fail("it waited"))
    ended.stay()


RUN = ("run", "amb-calibration", "--rig", "tsbs12")


@pytest.mark.parametrize("command", [RUN, ("serve", "tsbs12")])
def test_what_cannot_be_served_is_one_message_and_status_2(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with MadeRun().served() as other:
        asked = (
            (("--live", "--live-port", str(other.server.port)), f"--live-port {other.server.port}: found it in use"),
            (("--live", "--live-bind", "192.0.2.1"), "--live-bind 192.0.2.1: found no such address on this host"),
            (("--live-port", "8000"), "--live-port: found without --live; expected both. Next: add --live"),
            (("--live-bind", "0.0.0.0"), "--live-bind: found without --live"),
        )
        for options, text in asked:
            assert main((*command, *options)) == 2
            out, err = capsys.readouterr()
            assert text in err
            assert (out, err.count("\n"), list(tmp_path.iterdir())) == ("", 1, [])


def test_no_page_is_made_of_a_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("serve", "lira", "--live")) == 2
    assert "Next: leave --live out" in capsys.readouterr().err


def test_an_address_beyond_this_computer_is_announced_with_a_warning() -> None:
    with live.opened(PageRequest(bind="0.0.0.0"), None) as page:
        assert "without encryption" in page.announced
        client = Client(page.site.url("127.0.0.1", page.server.port))
        assert client.ask("GET", "/").status == 200
        assert client.ask("GET", "/events").status == 403
    with live.opened(PageRequest(), None) as page:
        assert page.announced == f"live page: {page.site.url('127.0.0.1', page.server.port)}"


def test_a_served_controller_is_heard_by_a_page_and_not_disturbed_by_it() -> None:
    rig = load_rig("tsbs12")
    alone, watched = (SimulatedController(rig, draw(rig, 1)) for _ in range(2))
    heard = Heard(rig, watched)
    for k in range(50):
        sent = [c.advance(20, empty_batch(), k * 2_000_000) for c in (alone, heard)]
        assert np.array_equal(*sent)
    (blocks,) = heard.take().values()
    assert sum(len(b) for _, b in blocks) == 100
    assert set(blocks[0][1].columns) >= {"pos_yi", "state"}
    assert heard.take() == {}
    assert heard.state == alone.state


def test_a_served_rig_is_watched_and_stopped_by_nobody(tmp_path: Path) -> None:
    free = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "fieldbus=modbus-tcp:127.0.0.1:0",
            "--link", "operator=line:127.0.0.1:0")  # fmt: skip
    with process("-m", "bench.cli", "serve", "tsbs12", "--live", *free, cwd=tmp_path) as (child, client):
        with Page(client) as page:
            hello = page.wait("hello")
            samples = page.wait("samples")
            assert (hello["served"], hello["may_stop"], hello["procedure"]) == (True, False, "bench serve")
            assert (samples["state"], samples["fault"]) == ("OFF", "NONE")
            assert client.post("/stop", {}).status == 409
            assert child.poll() is None
            child.send_signal(signal.SIGINT)
            assert page.wait("end")["reason"].startswith("SIGINT")
        child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 0
