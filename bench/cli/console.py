"""Asking a person at the terminal. Questions go to standard error: standard output belongs to the run directory."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from bench.clock import Clock
from bench.errors import OperatorAbort
from bench.run.supervisor import Supervisor

LOOK_S = 0.05
CLOSED = "standard input is closed: nobody can answer"


Asking = Callable[[str], AbstractContextManager[None]]
"""Puts a question where a person sees it; within the block they type."""


@contextmanager
def quietly(question: str) -> Iterator[None]:
    """The question as it is, on standard error, where no display is in the way."""
    sys.stderr.write(f"{question}\n")
    sys.stderr.flush()
    yield


def blocking(supervisor: Supervisor, asking: Asking = quietly) -> Callable[[str], str]:
    """For a simulated rig, whose time stands still meanwhile; a signal ends the waiting at once."""

    def ask(question: str) -> str:
        with asking(question), supervisor.interruptible():
            answer = sys.stdin.readline()
        if not answer:
            raise OperatorAbort(CLOSED)
        return answer

    return ask


def attentive(clock: Clock, asking: Asking = quietly) -> Callable[[str], str]:
    """For a live rig: its clock runs while the person thinks, so that heartbeats, recording and interlocks go on."""
    keyboard = Keyboard(sys.stdin.fileno())

    def ask(question: str) -> str:
        with asking(question):
            while (answer := keyboard.line()) is None:
                clock.sleep(LOOK_S)
        if not answer:
            raise OperatorAbort(CLOSED)
        return answer

    return ask


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
