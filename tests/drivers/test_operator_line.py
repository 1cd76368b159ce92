"""The operator's line over TCP: one answer for each question, and never one for another question."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

import pytest

from bench.errors import ConfigError, LinkError, OperatorSilent
from drivers import operator_line
from drivers.operator_line import OperatorLine


class Peer:
    """Answers each line with the next of `answers` (bytes as they are; None: closes). `asked` is what it was asked."""

    def __init__(self, answers: Sequence[bytes | None], greeting: bytes = b"") -> None:
        self._answers, self._greeting = answers, greeting
        self.asked: list[bytes] = []
        self.greeted = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"line:127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with suppress(ConnectionError):  # the line may leave while it is being answered
            self._converse()

    def _converse(self) -> None:
        with self._listener, self._listener.accept()[0] as connection, connection.makefile("rb") as lines:
            connection.sendall(self._greeting)
            self.greeted.set()
            for answer in self._answers:
                line = lines.readline()
                if not line or answer is None:
                    return
                self.asked.append(line)
                connection.sendall(answer)
            lines.readline()

    def end(self) -> None:
        self._thread.join(5.0)


@contextmanager
def opened(*answers: bytes | None, greeting: bytes = b"") -> Iterator[tuple[OperatorLine, Peer]]:
    peer = Peer(answers, greeting)
    try:
        with OperatorLine.open(peer.url) as line:
            assert peer.greeted.wait(5.0)
            yield line, peer
    finally:
        peer.end()


def test_each_question_has_its_answer() -> None:
    with opened(b"ok 0.3\n", b"  yes\r\n") as (line, peer):
        assert line.request("hang M2") == "ok 0.3"
        assert line.request("ask is it\nthere?") == "yes"
    assert peer.asked == [b"hang M2\n", b"ask is it there?\n"]


def test_bytes_that_are_no_text_are_shown_all_the_same() -> None:
    with opened(b"\xff\n") as (line, _):
        assert line.request("x") == "\ufffd"


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (None, "closed|reset"),
        (b"half an answ", "no answer to 'hang M1' within 0.2 s"),
        (b"ok\nok\n", "one line for each"),
        (b"x" * 9000, "answer of over"),
    ],
)
def test_a_line_that_is_lost_stays_lost(monkeypatch: pytest.MonkeyPatch, answer: bytes | None, says: str) -> None:
    monkeypatch.setattr(operator_line, "ANSWER_S", 0.2)
    with opened(answer, b"late\n") as (line, peer):
        with pytest.raises(LinkError, match=says):
            line.request("hang M1")
        with pytest.raises(LinkError, match=says):
            line.request("hang M2")
    assert b"hang M2\n" not in peer.asked


def test_an_operator_that_says_nothing_is_called_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operator_line, "ANSWER_S", 0.2)
    with opened(b"") as (line, _), pytest.raises(OperatorSilent, match=r"no answer .* the line is open"):
        line.request("hang M1")


def test_what_comes_unasked_is_no_answer() -> None:
    with opened(b"ok\n", greeting=b"ok 0.3\n") as (line, peer):
        with pytest.raises(LinkError, match="before anything was asked"):
            line.request("hang M1")
    assert peer.asked == []


def test_nobody_there_is_a_configuration_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(ConfigError, match="--operator console"), OperatorLine.open(f"line:127.0.0.1:{port}"):
        pass


@pytest.mark.parametrize("url", ["slcan:/dev/ttyACM0", "line:127.0.0.1", "line:..:5", f"line:{'x' * 70}.a:5"])
def test_a_wrong_address_is_a_configuration_error(url: str) -> None:
    with pytest.raises(ConfigError), OperatorLine.open(url):
        pass
