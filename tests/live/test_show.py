"""`bench show` over real sockets: the list, a run, its report and a trend, and who is refused."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_client import Client, Reply

from bench.cli.__main__ import main
from bench.cli.show import StoredRuns
from bench.findings import Finding
from bench.live.server import LiveServer
from bench.live.stored import StoredHandler, stored_site
from bench.quantity import Quantity
from bench.record.limits import Limit
from bench.record.outcomes import Outcome
from bench.record.records import Record, findings_of, measurement, missing, unfinished, write_record
from bench.uncertainty import Estimate, Influence

ROOT = Path(__file__).resolve().parents[2]
TOKEN, SECRET = "X-Levbench-Token", "not of the runs"
REPORT = "<!doctype html><title>Report</title><script>alert(1)</script><h1>A report</h1>"
K, CLEARANCE = Quantity("K_i", "N/A", "force constant"), Quantity("clearance", "m", "clearance")
VALUES = [75.0, 75.1, 74.9, 75.05, 74.95, 75.02, 74.98, 75.03, 74.97, 77.0]


def write(root: Path, k: int, **changed: Any) -> Path:
    """The k-th day's run, of a real machine unless something else is said."""
    path = root / f"amb-calibration-202601{k + 1:02}T080000Z-{k:04x}"
    path.mkdir()
    estimate = Estimate.of(VALUES[k], Influence("scatter/1", "scatter", 0.1, "N/A", "A", "normal"))
    blank = unfinished(run_id=path.name, procedure="amb-calibration", rig="tsbs12", uut={"serial": "7"}, seed=None, visit=None,
                       plan={}, started=f"2026-01-{k + 1:02}T08:00:00+00:00", versions={})  # fmt: skip
    judged = measurement(K.measured(estimate), Limit(70.0, 76.0, "N/A", "design", True))
    made: Record = dataclasses.replace(
        blank, outcome=Outcome.PASS, findings=(), measurements=(judged, missing(CLEARANCE))
    )
    write_record(path / "record.json", dataclasses.replace(made, **changed))
    return path


def folder(root: Path) -> Path:
    """Ten runs: the last one failed and has a finding and a report; one more is a virtual machine's."""
    runs = root / "runs"
    runs.mkdir(parents=True)
    told = findings_of([Finding("samples-lost", "<b>3</b> samples were lost", "link", "note")])
    paths = [write(runs, k, **({"outcome": Outcome.FAIL, "findings": told} if k == 9 else {})) for k in range(10)]
    (paths[9] / "report.html").write_text(REPORT)
    (paths[8] / "report.html").symlink_to(root / "secret.txt")
    (root / "secret.txt").write_text(SECRET)
    (root / "report.html").write_text(SECRET)
    virtual = dataclasses.replace(
        unfinished(run_id="x", procedure="unbalance", rig="lira", uut={}, seed=3, visit=2, plan={},
                   started="2025-12-31T00:00:00+00:00", versions={}), outcome=Outcome.DONE)  # fmt: skip
    (runs / "unbalance-20251231T000000Z-0000").mkdir()
    write_record(runs / "unbalance-20251231T000000Z-0000" / "record.json", virtual)
    return runs


@contextmanager
def served(runs: Path) -> Iterator[Client]:
    server = LiveServer(site := stored_site(StoredRuns(runs)), "127.0.0.1", 0, StoredHandler, "--")
    with server.serving():
        yield Client(site.url("127.0.0.1", server.port))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return folder(tmp_path_factory.mktemp("shown"))


@pytest.fixture(scope="module")
def client(runs: Path) -> Iterator[Client]:
    with served(runs) as client:
        yield client


def get(client: Client, path: str, **headers: str) -> Reply:
    return client.ask("GET", path, {TOKEN: client.token} | headers)


def started(reply: Reply) -> list[str]:
    assert reply.status == 200, reply.body
    return [run["started"][:10] for run in reply.json["runs"]]


FAILED = "amb-calibration-20260110T080000Z-0009"


def test_the_page_is_its_own_and_says_nothing_of_the_runs(client: Client) -> None:
    page = client.ask("GET", "/?run=x")
    assert (page.status, page.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    text = page.body.decode()
    assert 'src="show.js"' in text
    assert not re.search(r"<script(?![^>]* src=)|style=|\son\w+=", text)
    assert "default-src 'self'" in page.headers["Content-Security-Policy"]
    for name in re.findall(r'(?:src|href)="([a-z.]+)"', text):
        assert client.ask("GET", f"/{name}").status == 200
    assert client.ask("GET", "/index.html").status == 404


def test_the_newest_run_is_first_and_a_filter_leaves_those_with_all_its_words(client: Client) -> None:
    told = get(client, "/runs").json
    assert (told["all"], told["found"], told["procedures"], told["rigs"]) == (
        11, 11, ["amb-calibration", "unbalance"], ["lira", "tsbs12"])  # fmt: skip
    assert [run["started"][:10] for run in told["runs"]] == [
        *(f"2026-01-{k:02}" for k in range(10, 0, -1)),
        "2025-12-31",
    ]
    assert (told["runs"][0]["outcome"], told["runs"][0]["run_id"], told["runs"][0]["which"]) == ("FAIL", FAILED, "")
    assert told["runs"][-1]["which"] == "seed 3, visit 2"
    assert "K_i" in told["quantities"]
    assert started(get(client, "/runs?last=2")) == ["2026-01-10", "2026-01-09"]
    assert started(get(client, "/runs?filter=failed")) == ["2026-01-10"]
    assert started(get(client, "/runs?filter=UNBAL+lira")) == ["2025-12-31"]
    assert started(get(client, "/runs?filter=unbalance+failed")) == []
    assert get(client, "/runs?filter=tsbs12&last=1").json["found"] == 10


def test_a_run_has_its_results_findings_and_where_its_report_is(client: Client, runs: Path) -> None:
    run = get(client, f"/run/{FAILED}").json
    assert (run["outcome"], run["rig"], run["folder"]) == ("FAIL", "tsbs12", str(runs / FAILED))
    measured, lacking = run["results"]
    assert (measured["name"], measured["value"], measured["unit"], measured["verdict"]) == ("K_i", 77.0, "N/A", "fail")
    assert measured["U"] == pytest.approx(0.196, abs=1e-3)  # 1.96 u of a normal distribution
    assert lacking["value"] is None
    assert [f["text"] for f in run["findings"]] == ["<b>3</b> samples were lost"]
    assert run["report"] == f"/run/{FAILED}/report.html"
    assert get(client, "/run/unbalance-20251231T000000Z-0000").json["report"] is None


def test_a_report_is_shown_by_the_cookie_without_scripts(client: Client) -> None:
    path = f"/run/{FAILED}/report.html"
    cookie = get(client, "/runs").headers["Set-Cookie"]
    assert {"HttpOnly", "SameSite=Strict"} <= set(cookie.split("; "))
    report = client.ask("GET", path, {"Cookie": cookie.partition(";")[0]})
    assert (report.status, report.body.decode()) == (200, REPORT)
    policy = report.headers["Content-Security-Policy"]
    assert policy.endswith("; sandbox")
    assert "default-src 'none'" in policy
    assert client.ask("GET", path).status == 403
    assert client.ask("GET", "/runs", {"Cookie": cookie.partition(";")[0]}).status == 403
    assert get(client, "/run/unbalance-20251231T000000Z-0000/report.html").status == 404


def test_a_trend_is_that_of_bench_trend(
    client: Client, runs: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    told = get(client, "/trend?quantity=K_i&rig=tsbs12&procedure=amb-calibration").json
    figure = get(client, "/trend.svg?quantity=K_i")
    assert main(("trend", "K_i", "--out", str(runs), "--figure", str(tmp_path / "k.svg"))) == 0
    assert " ".join(said for _, said in told["told"]).split() == capsys.readouterr().out.split()
    assert {kind for kind, _ in told["told"]} == {"head", "segment", "rows", "note", "marks"}
    assert figure.body == (tmp_path / "k.svg").read_bytes()
    assert figure.headers["Content-Type"] == "image/svg+xml"
    assert "sandbox" in figure.headers["Content-Security-Policy"]
    assert ElementTree.fromstring(figure.body).tag.endswith("svg")
    assert [run["value"] for run in told["segments"][0]["runs"]] == VALUES


@pytest.mark.parametrize(("path", "says"), [
    ("/trend", "quantity: found none"), ("/trend?quantity=K_x", "trend of K_x"),
    ("/trend?quantity=K_i&seed=x", "seed: found x"), (f"/trend?quantity=K_i&seed={2**63}", "expected a whole number from 0 to"),
    ("/trend?quantity=K_i&seed=12345678901", "no such result"),
    ("/trend.svg?quantity=K_i&last=1", "last: found 1"), ("/runs?last=0", "last: found 0"),
    ("/runs?last=1&last=2", "each field once"),
    ("/runs?" + "&".join(f"a{k}=1" for k in range(20)), "at most 8 fields"), (f"/runs?filter={'x' * 201}", "200 characters"),
])  # fmt: skip
def test_what_is_asked_for_wrongly_is_a_sentence(client: Client, path: str, says: str) -> None:
    reply = get(client, path)
    assert (reply.status, reply.headers["Content-Type"]) == (400, "text/plain; charset=utf-8")
    assert says in reply.body.decode()


DATA = ("/runs", f"/run/{FAILED}", "/trend?quantity=K_i", "/trend.svg?quantity=K_i", f"/run/{FAILED}/report.html")


@pytest.mark.parametrize("path", DATA)
@pytest.mark.parametrize("headers", [
    {}, {TOKEN: "x"}, {"Cookie": "levbench-1=x"}, {TOKEN: "{token}", "Host": "evil.example"},
    {TOKEN: "{token}", "Origin": "http://evil.example"}, {TOKEN: "{token}", "Origin": "null"},
])  # fmt: skip
def test_who_has_no_token_or_comes_from_elsewhere_is_refused(
    client: Client, path: str, headers: dict[str, str]
) -> None:
    reply = client.ask("GET", path, {name: value.format(token=client.token) for name, value in headers.items()})
    assert reply.status == 403
    assert b"K_i" not in reply.body


@pytest.mark.parametrize("run_id", [
    "..", ".", "", "../runs", f"../runs/{FAILED}", "%2e%2e", "..%2f..", f"..%2Fruns%2F{FAILED}", "%00", f"{FAILED}/..",
    f"{FAILED}%2f", "/etc", "%2fetc", f"./{FAILED}", "..%5c..", "index.sqlite", f"{FAILED}/record.json",
])  # fmt: skip
def test_a_name_that_is_no_run_of_the_folder_is_not_found(client: Client, run_id: str) -> None:
    for path in (f"/run/{run_id}", f"/run/{run_id}/report.html"):
        reply = get(client, path)
        assert reply.status == 404
        assert SECRET.encode() not in reply.body


def test_a_report_that_is_a_link_elsewhere_is_not_followed(client: Client) -> None:
    reply = get(client, "/run/amb-calibration-20260109T080000Z-0008/report.html")
    assert reply.status == 404
    assert SECRET.encode() not in reply.body


@given(st.text(max_size=40).filter(lambda text: text != FAILED))
def test_no_text_becomes_a_path(runs: Path, client: Client, text: str) -> None:
    reply = get(client, f"/run/{quote(text, safe='')}/report.html")
    assert reply.status in (400, 404)
    assert SECRET.encode() not in reply.body


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD"])
@pytest.mark.parametrize("path", ["/", "/runs", "/stop", f"/run/{FAILED}"])
def test_nothing_but_get_is_answered(client: Client, method: str, path: str) -> None:
    headers = {TOKEN: client.token, "Content-Type": "application/json"}
    assert client.ask(method, path, headers, b"{}").status == 405


def test_what_belongs_to_a_run_that_goes_on_is_not_here(client: Client) -> None:
    assert [get(client, path).status for path in ("/events", "/report.html", "/answer", "/stop")] == [404] * 4


def test_asking_leaves_the_runs_as_they_were(tmp_path: Path) -> None:
    runs = folder(tmp_path)

    def there() -> dict[Path, bytes]:
        return {p: p.read_bytes() for p in runs.rglob("*") if p.is_file() and not p.name.startswith("index.sqlite")}

    before = there()
    with served(runs) as client:
        assert all(get(client, path).status == 200 for path in DATA)
    assert there() == before


def test_trends_drawn_at_once_are_each_as_drawn_alone(client: Client) -> None:
    alone = get(client, "/trend.svg?quantity=K_i").body
    found: list[bytes] = []
    threads = [
        threading.Thread(target=lambda: found.append(get(client, "/trend.svg?quantity=K_i").body)) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [alone] * 4


def test_an_unreadable_record_is_told_and_an_index_that_cannot_be_made_is_done_without(tmp_path: Path) -> None:
    runs = folder(tmp_path)
    with served(runs) as client:
        before = [run["run_id"] for run in get(client, "/runs").json["runs"] if run["run_id"] != FAILED]
        (runs / FAILED / "record.json").write_text("{")
        reply = get(client, f"/run/{FAILED}")
        assert (reply.status, b"record.json" in reply.body) == (500, True)
        (runs / "index.sqlite").unlink()
        (runs / "index.sqlite").mkdir()
        runs_told = [get(client, "/runs").json["runs"] for _ in range(2)]
    assert [[run["run_id"] for run in told] for told in runs_told] == [before] * 2


def test_the_command_serves_until_ctrl_c(tmp_path: Path) -> None:
    runs = folder(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-m", "bench.cli", "show", "--port", "0"], cwd=tmp_path, text=True, stdin=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as child:  # fmt: skip
        try:
            assert child.stderr is not None
            found = re.fullmatch(r"page: (http://127\.0\.0\.1:\d+/#\S{22})\n", child.stderr.readline())
            assert found
            assert child.stderr.readline() == "Ctrl-C ends it\n"
            told = get(Client(found[1]), "/runs").json
            assert (told["folder"], told["all"]) == ("runs", len(list(runs.iterdir())) - 1)  # beside the index
            child.send_signal(signal.SIGINT)
            out, err = child.communicate(timeout=60)
        finally:
            child.kill()
    assert (child.returncode, out, err) == (0, "", "")


def test_what_cannot_be_shown_is_one_message_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for words, text in (
            ((str(tmp_path / "none"),), "found no folder there; expected a folder of run directories"),
            ((str(tmp_path / "file"),), "found a file; expected a folder"),
            ((str(tmp_path), "--port", str(port)), f"--port {port}: found it in use"),
            ((str(tmp_path), "--bind", "192.0.2.1"), "--bind 192.0.2.1: found no such address on this host"),
        ):
            assert main(("show", *words)) == 2
            out, err = capsys.readouterr()
            assert (out, err.count("\n")) == ("", 1)
            assert text in err


def test_a_real_machine_and_its_twin_are_told_apart(client: Client) -> None:
    assert get(client, "/runs?filter=real").json["found"] == 10
    assert [run["machine"] for run in get(client, "/runs?filter=simulated").json["runs"]] == ["simulated"]
    told = get(client, "/trend?quantity=K_i&machine=real").json
    assert (told["machine_kind"], told["older"]) == ("real", False)
    assert get(client, "/trend?quantity=K_i&machine=served").status == 400
    refused = get(client, "/trend?quantity=K_i&machine=twin")
    assert (refused.status, "expected real, served, simulated" in refused.body.decode()) == (400, True)
