"""Requests that block: the clock runs meanwhile, their order is kept, and what is stuck holds nobody up."""

from __future__ import annotations

import threading

import pytest

from bench.errors import LinkError
from drivers.background import Background


class Slept:
    """A clock that opens a gate after some sleeps, or raises then."""

    def __init__(self, gate: threading.Event, sleeps: int, error: Exception | None = None) -> None:
        self._gate, self._left, self._error = gate, sleeps, error

    def now_ns(self) -> int:
        return 0

    def sleep(self, seconds: float) -> None:
        self._left -= 1
        if self._left == 0:
            self._gate.set()
            if self._error is not None:
                raise self._error
        elif self._left < 0:
            threading.Event().wait(seconds)


def test_the_clock_runs_while_a_request_blocks() -> None:
    gate = threading.Event()
    hands = Background(Slept(gate, 3), "test")
    assert hands.of(lambda text: text if gate.wait(20.0) else "the clock stood")("answer") == "answer"
    hands.close()


def test_what_a_request_raises_arrives() -> None:
    def fails() -> None:
        raise LinkError("no answer")

    hands = Background(Slept(threading.Event(), 1), "test")
    with pytest.raises(LinkError, match="no answer"):
        hands.call(fails)
    hands.close()
    with pytest.raises(LinkError, match="closed"):
        hands.call(fails)


def test_a_request_that_was_given_up_on_comes_before_the_next() -> None:
    done: list[str] = []
    gate = threading.Event()

    def run() -> None:
        gate.wait(20.0)
        done.append("run")

    hands = Background(Slept(gate, 1, LinkError("out of time")), "test")
    with pytest.raises(LinkError, match="out of time"):
        hands.call(run)
    hands.submit(done.append, "coast").result(20.0)
    assert done == ["run", "coast"]
    hands.close()


def test_closing_leaves_a_stuck_request_behind() -> None:
    gate = threading.Event()
    hands = Background(Slept(threading.Event(), 1), "test")
    stuck = hands.submit(gate.wait, 60.0)
    hands.close(0.0)
    assert not stuck.done()
    assert hands._thread.daemon
    gate.set()
    assert stuck.result(20.0)
