"""Runs on the simulated rig with a page: questions answered there, STOP, and a recording that does not know of it."""

from __future__ import annotations

import dataclasses
import io
import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import tiny_procedures
from live_client import Client, Page
from mcap.records import Attachment, Chunk, Metadata
from mcap.stream_reader import StreamReader
from tiny_procedures import Plan

from bench.cli import live
from bench.cli.compose import simulated
from bench.cli.live import LivePage, PageRequest
from bench.errors import LinkError
from bench.procedure import Procedure
from bench.progress import PlainProgress, Silent
from bench.record.outcomes import Outcome
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig
from bench.run import runner
from bench.run.job import Job
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor

BENCH_NS = 1_000_000_000


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


@pytest.fixture
def nobody(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Standard input is closed, as that of a service is."""
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        yield


@dataclass
class Watched:
    """A run with a page: its client, and the terminal's lines."""

    out: Path
    rig: RigFile
    page: LivePage
    supervisor: Supervisor
    terminal: io.StringIO = field(default_factory=io.StringIO)

    @property
    def client(self) -> Client:
        return Client(self.page.site.url("127.0.0.1", self.page.server.port))

    def run(self, procedure: Procedure, operator: str = "auto", report: runner.Report | None = None) -> RunResult:
        job = Job(procedure, self.rig, Plan(), {}, "sim", 1)
        progress = self.page.progress(PlainProgress(self.terminal))
        connect = self.page.watched(job, simulated(self.rig, 1, {}, operator, asking=progress.asking))
        with self.supervisor.watching():
            result = runner.run(job, self.out, connect, self.supervisor, progress, report)
        self.page.end(result, 0)
        return result


@pytest.fixture
def watched(tmp_path: Path, rig: RigFile) -> Iterator[Watched]:
    supervisor = Supervisor()
    with live.opened(PageRequest(), supervisor.stop) as page:
        yield Watched(tmp_path, rig, page, supervisor)


def doing(act: Callable[[Any], None]) -> Procedure:
    def acquire(bench: Any, plan: Any, record: Any) -> None:
        with record.step("look", number=0):
            bench.clock.sleep(0.2)
        act(bench)

    return dataclasses.replace(tiny_procedures.levitated, acquire=acquire)


def events(result: RunResult, kind: str) -> list[dict[str, Any]]:
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    return list(recording.events(kind))


def codes(result: RunResult) -> list[str]:
    return [f.code for f in result.record.findings]


def test_a_page_sees_a_run_from_its_first_stage_to_its_end(watched: Watched) -> None:
    with Page(watched.client) as page:
        result = watched.run(tiny_procedures.levitated)
        end = page.wait("end")
        hello = page.wait("hello")
    assert result.outcome is Outcome.DONE
    assert (end["outcome"], end["status"], end["report"]) == ("DONE", 0, None)
    (supply,) = end["results"]
    measured = result.record.measurements[0]
    assert (supply["name"], supply["value"], supply["U"]) == ("supply", measured.value, measured.expanded_uncertainty)
    assert hello["run_id"] == result.directory.name
    assert (hello["rig"], hello["simulated"], hello["served"], hello["may_stop"]) == ("tsbs12", True, False, True)
    assert hello["states"]["3"] == "LEVITATED"
    assert {c["name"] for c in hello["channels"]} >= {"pos_yi", "i_yi_p", "supply", "drive_actual_speed"}
    limits = next(c for c in hello["channels"] if c["name"] == "i_yi_p")
    assert (limits["kind"], limits["group"], limits["upper"]) == ("current", "inboard", 12.5)
    assert [o["x"] for o in hello["orbits"]] == ["pos_xi", "pos_xo"]
    assert page.kinds("progress")[-1]["stage"] in ("analyse", "report")


def test_a_question_is_answered_on_the_page_and_the_recording_knows_by_whom(watched: Watched, nobody: None) -> None:
    client = watched.client

    def answer(kind: str, data: Any) -> None:
        if kind == "prompt":
            client.post("/answer", {"id": data["id"], "answer": "", "by": "Ann"})

    with Page(client) as other, Page(client, answer) as page:
        result = watched.run(tiny_procedures.levitated, "console")
        page.wait("end")
        answers = other.kinds("answered")
    assert result.outcome is Outcome.DONE
    asked = [e for e in events(result, "operator") if "question" in e]
    assert [(e["answer"], e["by"]) for e in asked] == [("", "page: Ann")]
    assert "Press Enter when all is still" in asked[0]["question"]
    assert [(a["answer"], a["by"]) for a in answers] == [("", "page: Ann")]
    assert "page: Ann answered ''" in watched.terminal.getvalue()
    (prompt,) = page.kinds("prompt")
    assert "Enter" not in prompt["question"]
    assert prompt["choices"] == [{"label": "Done: all is still", "answer": ""}]


def test_what_is_typed_first_counts_and_the_page_is_told(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    reader, writer = os.pipe()
    with (
        os.fdopen(reader) as keyboard,
        Page(watched.client, lambda k, d: k == "prompt" and os.write(writer, b"\n")) as page,
    ):
        monkeypatch.setattr("sys.stdin", keyboard)
        result = watched.run(tiny_procedures.levitated, "console")
        assert page.wait("answered") == {"id": 1, "answer": "\n", "by": "console"}
        os.close(writer)
    assert [e["by"] for e in events(result, "operator") if "question" in e] == ["console"]


def test_stop_while_a_person_thinks(watched: Watched, nobody: None) -> None:
    client = watched.client
    with Page(client, lambda kind, _: kind == "prompt" and client.post("/stop", {"by": "Bob"})) as page:
        result = watched.run(tiny_procedures.levitated, "console")
        assert page.wait("end")["outcome"] == "ABORTED"
        assert page.wait("answered") == {"id": 1, "answer": None, "by": ""}
    assert codes(result) == ["operator-stop"]
    assert "STOP (page: Bob)" in result.reason


def test_stop_in_the_middle_of_a_sleep_lands_within_a_fifth_of_a_second(watched: Watched) -> None:
    times: list[int] = []

    def act(bench: Any) -> None:
        times.append(bench.clock.now_ns())
        assert watched.client.post("/stop", {"by": "Ann"}).status == 202
        bench.clock.sleep(1e6)

    result = watched.run(doing(act))
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["operator-stop"]
    assert not result.stopped_by_signal
    landing = next(e for e in events(result, "command") if e["name"] == "LAND")
    assert 0 <= landing["t_ns"] - times[0] <= 0.2 * BENCH_NS


@pytest.mark.parametrize("stage", ["bring the rig to LEVITATED", "acquire", "make safe", "analyse", "report"])
def test_stop_in_any_part_of_a_run_ends_it_aborted_with_one_finding(watched: Watched, stage: str) -> None:
    """As a signal does (tests/test_runner_stopped.py); while the report is built too, where it comes from another thread."""

    class Stopping(PlainProgress):
        def stage(self, text: str) -> None:
            if text == stage:
                reply: list[int] = []
                asked = threading.Thread(target=lambda: reply.append(watched.client.post("/stop", {}).status))
                asked.start()
                asked.join()
                assert reply == [202]

    job = Job(tiny_procedures.levitated, watched.rig, Plan(), {}, "sim", 1)
    progress = watched.page.progress(Stopping(io.StringIO()))
    connect = watched.page.watched(job, simulated(watched.rig, 1, {}, "auto"))
    with watched.supervisor.watching():
        result = runner.run(job, watched.out, connect, watched.supervisor, progress, lambda *_: None)
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["operator-stop"]


def test_stop_wakes_a_long_analysis(watched: Watched) -> None:
    """Where signals are heard, STOP raises in the main thread as one does, and not only at the next check."""

    def report(*_: Any) -> None:
        assert watched.client.post("/stop", {"by": "Ann"}).status == 202
        for _ in iter(int, 1):  # never ends by itself
            pass

    result = watched.run(tiny_procedures.levitated, report=report)
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["operator-stop"]


def test_findings_come_while_the_run_goes_on(watched: Watched) -> None:
    seen: list[Any] = []

    def acquire(bench: Any, plan: Any, record: Any) -> None:
        bench.counters.lost, bench.counters.duplicates = 3, 2
        with record.step("look", number=0):
            bench.clock.sleep(0.2)
        with Page(watched.client) as page:
            seen.append(page.wait("finding"))
        bench.counters.lost, bench.counters.duplicates = 17, 0

    with Page(watched.client) as page:
        watched.run(dataclasses.replace(tiny_procedures.levitated, acquire=acquire))
        page.wait("end")
    assert (seen[0]["code"], seen[0]["text"]) == ("samples-lost", "3 samples were lost in 0 gaps")
    told = [f for f in page.kinds("finding") if f["code"] == "samples-lost"]
    assert [f["text"] for f in told] == ["3 samples were lost in 0 gaps", "17 samples were lost in 0 gaps"]
    assert len({f["id"] for f in told}) == 1
    passed = [f for f in page.kinds("finding") if f["code"] == "frames-duplicated"]
    assert [f["text"].partition(" (for a while")[1] for f in passed] == ["", " (for a while"]


def content(path: Path) -> list[Any]:
    """All that a recording holds but the metadata record `wall`."""
    kept: list[Any] = []
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                kept.append(record.data)
            elif isinstance(record, Attachment):
                kept.append((record.name, record.data))
            elif isinstance(record, Metadata) and record.name != "wall":
                kept.append((record.name, record.metadata))
    return kept


@contextmanager
def stopped_reader(client: Client) -> Iterator[None]:
    """A page that asks for the events and reads nothing."""
    with socket.create_connection((client.host, client.port)) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        head = f"GET /events HTTP/1.1\r\nHost: {client.here}\r\nX-Levbench-Token: {client.token}\r\n\r\n"
        connection.sendall(head.encode())
        yield


def test_a_recording_does_not_know_who_watched(watched: Watched, tmp_path: Path) -> None:
    """Byte by byte, with a page that reads, one that reads nothing, and one that is gone."""
    job = Job(tiny_procedures.levitated, watched.rig, Plan(), {}, "sim", 1)
    with Supervisor().watching() as supervisor:
        alone = runner.run(job, tmp_path / "alone", simulated(watched.rig, 1, {}, "auto"), supervisor, Silent(), None)
    with Page(watched.client):
        pass
    with stopped_reader(watched.client), Page(watched.client) as page:
        shown = watched.run(tiny_procedures.levitated)
        page.wait("end")
        assert page.kinds("samples")
    assert content(alone.directory / "recording.mcap") == content(shown.directory / "recording.mcap")
    assert alone.record.measurements == shown.record.measurements


def test_a_page_that_cannot_be_made_ends_no_run(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError

    monkeypatch.setattr("bench.live.view.view_of", broken)
    monkeypatch.setattr("bench.live.progress.LiveProgress._tell_finding", broken)
    lossy = doing(lambda bench: setattr(bench.counters, "lost", 3))
    assert [f.code for f in watched.run(lossy).record.findings] == ["samples-lost", "steps-missing"]


def test_a_run_that_does_not_start_says_so_on_the_page() -> None:
    def start() -> None:
        with live.opened(PageRequest(), lambda _: None) as page:
            watching.append(Page(Client(page.site.url("127.0.0.1", page.server.port))).__enter__())
            raise LinkError("the controller does not talk")

    watching: list[Page] = []
    with pytest.raises(LinkError):
        start()
    heard = watching[0].wait_for_the_end()
    watching[0].__exit__()
    (end,) = (data for kind, data in heard if kind == "end")
    assert (end["outcome"], end["status"], end["reason"]) == ("ERROR", 3, "the controller does not talk")
