"""The live page's server over real sockets: who is refused, what comes early, late and twice, and what an end leaves."""

from __future__ import annotations

import base64
import math
import socket
from collections.abc import Iterator
from dataclasses import replace
from email.message import Message
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_client import Client, Page
from made_run import MadeRun

from bench.clock import WallClock
from bench.errors import ConfigError
from bench.live import exchange, site
from bench.live.buckets import Buckets
from bench.live.gate import check_host
from bench.question import Answer, Choice, Question
from bench.recording.tap import Tap
from bench.samples import SampleBlock

ASSET, TOKEN = "/index.html", "X-Levbench-Token"


@pytest.fixture(scope="module")
def shared() -> Iterator[MadeRun]:
    """For requests that change nothing."""
    with MadeRun().served() as run:
        yield run


@pytest.fixture
def client(shared: MadeRun) -> Iterator[Client]:
    yield Client(shared.url)
    assert shared.stopped == []


@pytest.fixture
def made() -> Iterator[MadeRun]:
    with MadeRun().served() as run:
        yield run


@pytest.fixture
def own(made: MadeRun) -> Client:
    return Client(made.url)


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "", "0.0.0.0:{port}",
                                  "localhost.evil.example:{port}", "127.0.0.1:{port}.evil.example"])  # fmt: skip
@pytest.mark.parametrize("path", ["/", "/events"])
def test_another_host_is_refused(client: Client, host: str, path: str) -> None:
    reply = client.ask("GET", path, {"Host": host.format(port=client.port), TOKEN: client.token})
    assert reply.status == 403
    assert b"Host" in reply.body
    assert b"hello" not in reply.body


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]", "LOCALHOST"])
def test_its_own_names_are_let_in(client: Client, name: str) -> None:
    assert client.ask("GET", "/", {"Host": f"{name}:{client.port}"}).status == 200


def test_two_hosts_or_none_are_refused(client: Client) -> None:
    for head in (b"Host: 127.0.0.1:%d\r\nHost: evil.example\r\n" % client.port, b""):
        assert client.raw(b"GET / HTTP/1.1\r\n" + head + b"\r\n").startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://{here}", "http://127.0.0.1", "http://localhost:1", ""]
)
@pytest.mark.parametrize(("method", "path"), [("GET", "/"), ("GET", "/events"), ("POST", "/stop"), ("POST", "/answer")])
def test_another_origin_is_refused(client: Client, origin: str, method: str, path: str) -> None:
    headers = {TOKEN: client.token, "Origin": origin.format(here=client.here), "Content-Type": "application/json"}
    assert client.ask(method, path, headers, b"{}").status == 403


@pytest.mark.parametrize("token", [None, "", "x", "{token}x", "{short}", "ü", "{token}, {token}"])
@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/events"), ("POST", "/stop"), ("POST", "/answer"), ("GET", "/report.html")]
)
def test_a_missing_or_wrong_token_is_refused(client: Client, token: str | None, method: str, path: str) -> None:
    headers = {"Content-Type": "application/json", "Origin": f"http://{client.here}"}
    if token is not None:
        headers[TOKEN] = token.format(token=client.token, short=client.token[:-1])
    reply = client.ask(method, path, headers, b"{}")
    assert reply.status == 403
    assert b"Next: open the address that bench printed" in reply.body


def test_what_a_form_of_another_page_can_send_changes_nothing(client: Client) -> None:
    """No header of ours, a type that needs no preflight; and the preflight itself is not granted."""
    body = b'{"by": "evil"}'
    assert client.ask("POST", f"/stop?token={client.token}", {"Content-Type": "text/plain"}, body).status == 403
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "application/jsonx"):
        assert client.post("/stop", {}, **{"Content-Type": kind}).status == 415
    reply = client.ask("OPTIONS", "/stop", {"Origin": f"http://{client.here}"})
    assert reply.status == 405
    assert not [name for name in reply.headers if name.lower().startswith("access-control")]


@pytest.mark.parametrize(("method", "path", "status"), [
    ("GET", "/stop", 405), ("GET", "/answer", 405), ("POST", "/", 405), ("POST", "/events", 405), ("PUT", "/", 405),
    ("DELETE", "/report.html", 405), ("HEAD", "/", 405), ("TRACE", "/", 405), ("GET", "/nothing", 404), ("POST", "/no", 404),
    ("GET", "/../site.py", 404), ("GET", "/%2e%2e/site.py", 404), ("GET", "//etc/passwd", 404), ("GET", "/__init__.py", 404),
])  # fmt: skip
def test_other_methods_and_paths(client: Client, method: str, path: str, status: int) -> None:
    assert client.ask(method, path, {TOKEN: client.token, "Content-Type": "application/json"}).status == status


@pytest.mark.parametrize(("headers", "body", "status"), [
    ({"Content-Length": "5000"}, b"", 413), ({"Content-Length": "99999999999999999999"}, b"", 413),
    ({"Content-Length": "-1"}, b"", 411), ({"Content-Length": "1e3"}, b"", 411), ({"Content-Length": "²"}, b"", 411),
    ({"Transfer-Encoding": "chunked"}, b"0\r\n\r\n", 411), ({}, b"", 400), ({}, b"[" * 4000, 400), ({}, b"nonsense", 400),
    ({}, b"\xff\xfe", 400), ({}, b"[]", 400), ({}, b'{"by": 7}', 400), ({}, b'{"by": {}}', 400),
])  # fmt: skip
def test_bodies_that_are_no_request(client: Client, headers: dict[str, str], body: bytes, status: int) -> None:
    own = {TOKEN: client.token, "Content-Type": "application/json"}
    assert (
        client.ask("POST", "/stop", {k: v.encode().decode("latin-1") for k, v in (own | headers).items()}, body).status
        == status
    )


@pytest.mark.parametrize("body", [{}, {"id": True, "answer": ""}, {"id": "1", "answer": ""}, {"id": 1}, {"id": 1, "answer": 1},
                                  {"id": 1.0, "answer": ""}, {"id": 1, "answer": "x" * 501}])  # fmt: skip
def test_answers_that_are_none(shared: MadeRun, client: Client, body: Any) -> None:
    with shared.questions.ask(Question("Ready?")) as opened:
        assert client.post("/answer", body).status == 400
        assert opened.look() is None


@pytest.mark.parametrize("path", ["/", "/app.js", "/nothing"])
def test_every_answer_carries_what_browsers_need(client: Client, path: str) -> None:
    headers = {k.lower(): v for k, v in client.ask("GET", path).headers.items()}
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cache-control"] == "no-store"
    assert headers["referrer-policy"] == "no-referrer"
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]


def test_the_page_says_nothing_of_the_run_without_the_token(shared: MadeRun, client: Client) -> None:
    for path in shared.site.assets:
        assert client.token.encode() not in client.ask("GET", path).body
    assert shared.url.index("#") < shared.url.index(client.token)


def test_a_page_that_comes_while_a_simulation_stands_still_sees_where(made: MadeRun, own: Client) -> None:
    """Its clock stands while somebody is asked: what was recorded before, with its age; not an empty page."""
    made.hello()
    made.block()
    (came_ns, block) = made.tap._held["controller"].pop()
    made.tap._held["controller"].append((came_ns - 60_000_000_000, block))
    with made.questions.ask(Question("Hang M4.")), Page(own) as page:
        sample = page.wait("samples")
    assert sample["state"] == made.view.states[3]
    assert sample["age_ms"] >= 60_000


def test_the_age_of_data_is_that_of_the_controllers(made: MadeRun, own: Client) -> None:
    """A device that is polled is stamped by the sample clock, here two seconds ahead of the host's."""
    made.hello()
    watched = Tap(["controller", "supply"])
    made.publisher.watch(watched, Buckets(made.view, "controller", 0), real_time=True)
    with Page(own) as page:
        page.wait("hello")
        made.block()  # into the tap that nobody watches any more
        (came_ns, block) = made.tap._held["controller"].pop()
        heard_ns, at = WallClock().now_ns() - 100_000_000, np.zeros(1, np.int64)
        polled = SampleBlock("supply", 0, at.astype(np.uint64), at, heard_ns + 2_000_000_000, 0, {})
        watched._held["supply"].append((came_ns + 1, polled))
        watched._held["controller"].append((came_ns, replace(block, host_ns=heard_ns)))
        sample = page.wait("samples")
    assert 100 <= sample["age_ms"] < 60_000


def test_a_page_that_comes_late_is_told_what_stands(made: MadeRun, own: Client) -> None:
    made.hub.tell("finding", {"id": "a", "text": "3 samples"}, "a")
    made.hub.tell("log", {"text": "first line"})
    made.hello()
    for done in range(100):
        made.hub.tell("progress", {"done": done})
    made.hub.tell("finding", {"id": "a", "text": "17 samples"}, "a")
    made.hub.tell("finding", {"id": "b", "text": "another"}, "b")
    question = Question("Hang M1.", "Press Enter.", [Choice("Done", "")], "Another: its label")
    with made.questions.ask(question), Page(own) as page:
        prompt = page.wait("prompt")
        assert prompt == {"id": 1, "question": "Hang M1.", "hint": "Another: its label", "free": True,
                          "choices": [{"label": "Done", "answer": ""}]}  # fmt: skip
        assert page.heard[0][0] == "hello"
        page.wait("finding", lambda f: f["id"] == "b")
        assert [f["text"] for f in page.kinds("finding")] == ["17 samples", "another"]
        assert page.kinds("log") == [{"text": "first line"}]
        assert page.kinds("progress") == [{"done": 99}]
    with Page(own) as witness:
        witness.wait("answered")
        with Page(own) as after:
            after.wait("answered")
            assert after.kinds("prompt") == []


def test_samples_come_as_buckets_of_10_ms_with_least_and_greatest(made: MadeRun, own: Client) -> None:
    def numbers(text: str, kind: str) -> Any:
        return np.frombuffer(base64.b64decode(text), kind)

    made.hello()
    with Page(own) as page:
        page.wait("hello")
        while not page.kinds("samples"):  # the publisher takes none while nobody waits
            made.samples = 0
            made.block(100)
            page.wait("samples")
        first = page.kinds("samples")[0]
    t = numbers(first["t"], "<f8")
    assert np.allclose(t, np.arange(len(t)) * 0.01)
    turn = 2 * math.pi * 10 * np.arange(100) * 1e-3
    y = (40e-6 * np.sin(turn)).reshape(-1, 10)
    assert np.allclose(numbers(first["channels"]["pos_yi"]["max"], "<f4"), y.max(axis=1), atol=1e-11)
    assert np.allclose(numbers(first["channels"]["pos_yi"]["min"], "<f4"), y.min(axis=1), atol=1e-11)
    assert first["speed_rpm"] == pytest.approx(600)
    assert (first["state"], first["fault"]) == ("LEVITATED", "NONE")
    assert first["orbits"].keys() == {"inboard", "outboard"}


def test_the_first_answer_wins_and_everybody_hears_whose_it_was(made: MadeRun, own: Client) -> None:
    with Page(own) as ann, Page(own) as bob:
        with made.questions.ask(Question("Ready?")) as opened:
            number = ann.wait("prompt")["id"]
            assert own.post("/answer", {"id": number + 1, "answer": "y"}).status == 409
            first = own.post("/answer", {"id": number, "answer": "yes", "by": "Ann\n"})
            second = own.post("/answer", {"id": number, "answer": "no", "by": "Bob"})
            assert (first.status, first.json) == (200, {"accepted": True, "by": "page: Ann"})
            assert (second.status, second.json) == (409, {"accepted": False, "by": "page: Ann"})
            typed = opened.offer(Answer("no\n"))
            assert (typed, typed.by) == ("yes", "page: Ann")
        for page in (ann, bob):
            assert page.wait("answered") == {"id": number, "answer": "yes", "by": "page: Ann"}
    assert own.post("/answer", {"id": number, "answer": "yes"}).json == {"accepted": False, "by": ""}


def test_stop_says_who_and_is_refused_after_the_end(made: MadeRun, own: Client) -> None:
    assert own.post("/stop", {"by": "Ann"}).status == 202
    assert own.post("/stop", {}).status == 202
    assert made.stopped == ["page: Ann", "page"]
    with Page(own) as page:
        made.hub.tell("end", {"outcome": "ABORTED"})
        page.wait("end")
    assert own.post("/stop", {"by": "Ann"}).status == 409
    assert len(made.stopped) == 2


def test_the_report_needs_the_token_or_the_cookie_of_a_page(made: MadeRun, own: Client, tmp_path: Path) -> None:
    token = {TOKEN: own.token}
    assert own.ask("GET", "/report.html", token).status == 404
    made.site.report = tmp_path / "report.html"
    assert own.ask("GET", "/report.html", token).status == 404
    made.site.report.write_text("<h1>Report</h1>")
    with Page(own) as page:
        for headers in (token, {"Cookie": f"a=b; {page.cookie}; c=d"}):
            reply = own.ask("GET", "/report.html", headers)
            assert (reply.status, reply.body) == (200, b"<h1>Report</h1>")
            assert "sandbox" in reply.headers["Content-Security-Policy"]
            assert "script-src" not in reply.headers["Content-Security-Policy"]
        name, _, value = page.cookie.partition("=")
        assert value != own.token
        for cookie in (f"{name}=", f"{name}={value}x", f"{name}", f"x{page.cookie}"):
            assert own.ask("GET", "/report.html", {"Cookie": cookie}).status == 403
        assert own.ask("GET", "/events", {"Cookie": page.cookie}).status == 403
        assert (
            own.ask("POST", "/stop", {"Cookie": page.cookie, "Content-Type": "application/json"}, b"{}").status == 403
        )


def test_one_page_too_many_is_turned_away_and_finds_a_place_later(made: MadeRun, own: Client) -> None:
    pages = [Page(own).__enter__() for _ in range(site.READERS)]
    assert own.ask("GET", "/events", {TOKEN: own.token}).status == 503
    assert own.ask("GET", "/").status == 200
    gone = pages.pop()
    gone.__exit__()
    made.hub.tell("log", {"text": "anything"})
    while True:  # it is seen within half a second that the page is gone
        try:
            page = Page(own).__enter__()
        except AssertionError:
            continue
        pages.append(page)
        break
    for page in pages:
        page.__exit__()


def test_a_port_in_use_and_an_address_of_somebody_else_are_said_with_what_to_do(made: MadeRun) -> None:
    with pytest.raises(ConfigError, match=rf"--live-port {made.server.port}: found it in use .* leave --live-port out"):
        MadeRun(made.server.port)
    with pytest.raises(ConfigError, match=r"--live-bind 192\.0\.2\.1: found no such address on this host; expected"):
        MadeRun(address="192.0.2.1")
    with pytest.raises(ConfigError, match=r"--live-bind no\.such\.host\.invalid: found no such address; expected"):
        MadeRun(address="no.such.host.invalid")


def test_what_cannot_be_said_costs_itself_alone(made: MadeRun, own: Client) -> None:
    made.hub.tell("finding", {"id": "a", "value": math.nan}, "a")
    made.hub.tell("finding", {"id": "b", "value": object()}, "b")
    made.hub.tell("log", {"text": "next"})
    with Page(own) as page:
        page.wait("log")
        assert page.kinds("finding") == []


def test_a_client_that_says_nothing_holds_only_its_place(made: MadeRun, own: Client) -> None:
    silent = [socket.create_connection((own.host, own.port)) for _ in range(20)]
    silent[0].sendall(b"GET / HTTP/1.1\r\nHost: ")
    try:
        assert own.ask("GET", "/").status == 200
        with Page(own) as page:
            made.hub.tell("log", {"text": "goes on"})
            page.wait("log")
    finally:
        for connection in silent:
            connection.close()


def test_a_request_that_dribbles_is_given_up(made: MadeRun, own: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exchange, "HEAD_S", 0.3)
    with socket.create_connection((own.host, own.port), timeout=20.0) as connection:
        connection.sendall(b"GET / HT")
        assert connection.recv(100) == b""


@pytest.mark.parametrize(
    ("local", "host"), [("::ffff:10.1.2.3", "10.1.2.3:80"), ("10.1.2.3", "10.1.2.3"), ("fe80::1%eth0", "[fe80::1]:80")]
)
def test_the_address_at_which_a_request_came_in_is_its_host(local: str, host: str) -> None:
    headers = Message()
    headers["Host"] = host
    assert check_host(headers, local, 80) == host
