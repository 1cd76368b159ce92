"""Bytes that are no request, or nearly one: nothing is stopped or answered, and the run never hears of it."""

from __future__ import annotations

import random
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_client import Client, Page
from made_run import MadeRun

from bench.live.gate import TOKEN_HEADER, Refused, body_length, check_host, check_origin, check_token, cookie_of

WORDS = [
    b"GET", b"POST", b"PUT", b" ", b"/", b"/events", b"/stop", b"/answer", b"/report.html", b"HTTP/1.1",
    b"HTTP/0.9", b"HTTP/9.9", b"\r\n", b"\n", b"\r", b"\x00", b":", b"Host: ", b"127.0.0.1", b"Origin: ",
    b"X-Levbench-Token: ", b"Content-Type: ", b"application/json", b"Content-Length: ", b"4", b"99", b"-1",
    b"Transfer-Encoding: chunked", b"Cookie: ", b"{}", b'{"id":1}', b"[[[[", b"\xff\xfe", b"%2e%2e/", b"A" * 300,
    b"Expect: 100-continue", b"Connection: keep-alive", b"\r\n\r\n",
]  # fmt: skip
REQUESTS = st.lists(st.sampled_from(WORDS) | st.binary(max_size=12), max_size=25).map(b"".join)


class Served:
    """A made run that is served, and what was raised in its threads."""

    def __init__(self) -> None:
        self.raised: list[BaseException | None] = []
        self.made = MadeRun()
        self.client = Client(self.made.url)
        self.before = threading.excepthook

    def is_untouched(self) -> bool:
        """Nothing was stopped, answered or raised, and a page is served as before."""
        with Page(self.client) as page:
            page.wait("log")
        return (self.made.stopped, self.raised) == ([], []) and self.client.ask("GET", "/").status == 200


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    out = Served()
    threading.excepthook = lambda hooked: out.raised.append(hooked.exc_value)
    try:
        with out.made.served():
            out.made.hub.tell("log", {"text": "here"})
            yield out
    finally:
        threading.excepthook = out.before


@given(st.lists(REQUESTS, min_size=1, max_size=5))
def test_any_bytes_are_refused_or_dropped(served: Served, sent: list[bytes]) -> None:
    for request in sent:
        answer = served.client.raw(request)
        assert answer == b"" or answer.startswith(b"HTTP/1.1 "), answer[:80]
        assert not answer.startswith(b"HTTP/1.1 50") or answer.startswith(b"HTTP/1.1 505 ")
    assert served.made.stopped == []
    assert served.raised == []


def test_after_them_a_page_is_served_as_before(served: Served) -> None:
    assert served.is_untouched()


HEADS = st.lists(
    st.tuples(
        st.sampled_from(["Host", "Origin", TOKEN_HEADER, "Content-Type", "Content-Length", "Transfer-Encoding", "Cookie"]),
        st.text(max_size=30) | st.sampled_from(["127.0.0.1:80", "application/json", "12", "chunked", "a=b; c"]),
    ),
    max_size=8,
)  # fmt: skip


class Given:
    """Headers as the standard library hands them over."""

    def __init__(self, pairs: list[tuple[str, str]]) -> None:
        self._pairs = pairs

    def get_all(self, name: str, /) -> list[str] | None:
        return [value for key, value in self._pairs if key.lower() == name.lower()] or None


@given(HEADS, st.text(max_size=20))
def test_no_headers_raise_anything_but_a_refusal(pairs: list[tuple[str, str]], secret: str) -> None:
    headers = Given(pairs)
    for check in (
        lambda: check_host(headers, "127.0.0.1", 80),
        lambda: check_origin(headers, "127.0.0.1:80"),
        lambda: check_token(headers, secret),
        lambda: body_length(headers),
        lambda: cookie_of(headers, "c"),
    ):
        with suppress(Refused):
            check()


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_hundred_thousand_requests_reach_no_thread_of_the_run(served: Served) -> None:
    """The token is known to some of them: those are let in and still ask for nothing that there is."""
    drawn = random.Random(20)
    words = [*WORDS, served.client.token.encode(), f"Host: {served.client.here}\r\n".encode()]
    for _ in range(100_000):
        parts = (
            drawn.choice(words) if drawn.random() < 0.8 else drawn.randbytes(8) for _ in range(drawn.randrange(25))
        )
        served.client.raw(b"".join(parts))
    assert served.is_untouched()
