"""What a run shows while it goes on: the part it is in, steps done and to do, time left, and questions to a person.

A line that is drawn anew on a terminal, plain lines elsewhere. `bench.display_units` puts a step's labels into words.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Protocol, TextIO

from bench.findings import Finding
from bench.progress_text import PLAIN_WIDTH, counted, time_left, wrapped
from bench.question import Elsewhere, Question

PLAIN_LINES = 20  # about as many lines in a run, however many steps it has


class Progress(Protocol):
    """What the runner tells whoever watches."""

    def stage(self, text: str) -> None:
        """The run enters a new part; the count stands until `total`."""
        ...

    def busy(self, text: str) -> AbstractContextManager[None]:
        """A new part in which nothing moves, for the length of the block: the time that it takes is shown as it passes."""
        ...

    def total(self, steps: int) -> None:
        """How many steps will come; 0 is unknown."""
        ...

    def step(self, text: str) -> None:
        """A step begins."""
        ...

    def line(self, text: str) -> None:
        """A line of the log."""
        ...

    def asking(self, question: Question) -> AbstractContextManager[Elsewhere | None]:
        """Put a question on lines of its own; within the block a person types, or answers elsewhere if that is possible."""
        ...

    def found(self, look: Callable[[], Iterable[Finding]]) -> None:
        """There may be findings; a display that shows none does not look."""
        ...


class PlainProgress:
    """Lines on a stream that is not a terminal."""

    def __init__(self, stream: TextIO, now: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._now = stream, now
        self._total = self._begun = 0
        self._started = 0.0

    def stage(self, text: str) -> None:
        self.line(text)

    @contextmanager
    def busy(self, text: str) -> Iterator[None]:
        self.stage(text)
        yield

    def total(self, steps: int) -> None:
        self._total, self._begun, self._started = steps, 0, self._now()

    def step(self, text: str) -> None:
        self._begun += 1
        every = max(1, self._total // PLAIN_LINES)
        if (self._begun - 1) % every == 0:
            left = time_left(self._begun - 1, self._total, self._now() - self._started)
            self.line(f"step {counted(self._begun, self._total)}: {text}{f', {left}' if left else ''}")

    def line(self, text: str) -> None:
        with suppress(OSError, ValueError):  # nobody reads any more; the run goes on
            self._stream.write(text + "\n")
            self._stream.flush()

    @contextmanager
    def asking(self, question: Question) -> Iterator[None]:
        self.line(wrapped(question, PLAIN_WIDTH))
        yield

    def found(self, look: Callable[[], Iterable[Finding]]) -> None: ...


class Silent:
    """No display, for callers that only want the result."""

    def stage(self, text: str) -> None: ...
    def total(self, steps: int) -> None: ...
    def step(self, text: str) -> None: ...
    def line(self, text: str) -> None: ...
    def found(self, look: Callable[[], Iterable[Finding]]) -> None: ...

    @contextmanager
    def busy(self, text: str) -> Iterator[None]:
        yield

    @contextmanager
    def asking(self, question: Question) -> Iterator[None]:
        yield


@contextmanager
def shown_on(stream: TextIO) -> Iterator[Progress]:
    """The progress display that fits the stream."""
    if not stream.isatty():
        yield PlainProgress(stream)
        return
    from bench.terminal import TerminalProgress

    bar = TerminalProgress(stream)
    bar.start()
    try:
        yield bar
    finally:
        bar.stop()
