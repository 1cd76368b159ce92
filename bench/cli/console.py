"""Asking a person at the terminal. Questions go to standard error: standard output belongs to the run directory."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from bench.clock import Clock
from bench.errors import OperatorAbort
from bench.question import Answer, Elsewhere, Question
from bench.run.supervisor import Supervisor

LOOK_S = 0.05
CLOSED = "standard input is closed: nobody can answer"


Asking = Callable[[Question], AbstractContextManager[Elsewhere | None]]
"""Puts a question where a person sees it; within the block they type, or answer elsewhere where that is possible."""


@contextmanager
def quietly(question: Question) -> Iterator[None]:
    """The question as it is, on standard error, where no display is in the way."""
    sys.stderr.write(f"{question}\n")
    sys.stderr.flush()
    yield


def blocking(supervisor: Supervisor, asking: Asking = quietly) -> Callable[[Question], Answer]:
    """For a simulated rig, whose time stands still meanwhile; a signal ends the waiting at once."""

    def wait(seconds: float) -> None:
        time.sleep(seconds)
        supervisor.checkpoint()

    def ask(question: Question) -> Answer:
        with asking(question) as elsewhere, supervisor.interruptible():
            return _typed(sys.stdin.readline()) if elsewhere is None else _first(keyboard(), elsewhere, wait)

    keyboard = _Once()
    return ask


def attentive(clock: Clock, asking: Asking = quietly) -> Callable[[Question], Answer]:
    """For a live rig: its clock runs while the person thinks, so that heartbeats, recording and interlocks go on."""
    keyboard = _Once()

    def ask(question: Question) -> Answer:
        with asking(question) as elsewhere:
            return _first(keyboard(), elsewhere, clock.sleep)

    return ask


def _first(keyboard: Keyboard | None, elsewhere: Elsewhere | None, wait: Callable[[float], None]) -> Answer:
    """The first answer that comes, typed or from elsewhere. Where nobody can type any more, elsewhere is left."""
    while True:
        line = keyboard.line() if keyboard is not None else ""
        if line or (line is not None and elsewhere is None):
            return _typed(line) if elsewhere is None else elsewhere.offer(_typed(line))
        if elsewhere is not None and (answer := elsewhere.look()) is not None:
            return answer
        wait(LOOK_S)


def _typed(line: str) -> Answer:
    if not line:
        raise OperatorAbort(CLOSED)
    return Answer(line)


class _Once:
    """The keyboard, opened when it is asked for first and kept: it may hold a line that has begun. None where there is none."""

    def __init__(self) -> None:
        self._found: Keyboard | None = None

    def __call__(self) -> Keyboard | None:
        if self._found is None:
            try:
                self._found = Keyboard(sys.stdin.fileno())
            except (
                AttributeError,
                OSError,
                ValueError,
            ):  # no standard input, one that is closed, or none of the system's
                return None
        return self._found


class Keyboard:
    """Lines from a descriptor, without waiting for them."""

    def __init__(self, fileno: int) -> None:
        self._fileno = fileno
        self._held, self._ended = b"", False

    def line(self) -> str | None:
        """The next line with its end; "" when no more can come; None while there is none yet."""
        while b"\n" not in self._held and not self._ended and self._ready():
            part = os.read(self._fileno, 4096)
            self._held, self._ended = self._held + part, not part
        line, end, rest = self._held.partition(b"\n")
        if not end and not self._ended:
            return None
        self._held = rest
        return (line + end).decode("utf-8", "replace")

    def _ready(self) -> bool:
        if sys.platform == "win32":
            import msvcrt

            return msvcrt.kbhit()
        return bool(select.select([self._fileno], [], [], 0)[0])
