"""Progress on a terminal: one line that is drawn anew, log lines scroll above it. It fits 80 columns with its count and its
time left; what a step does is cut where the line ends."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from rich import progress
from rich.console import Console
from rich.table import Column

from bench.findings import Finding
from bench.progress_text import columns, counted, time_left, wrapped
from bench.question import Question

BAR, LONGEST_STAGE = 12, 20  # columns
REDRAWN_HZ = 4.0  # while nothing moves


class TerminalProgress:
    """Drawn without a thread while a machine may move: each step draws it anew."""

    def __init__(self, stream: TextIO) -> None:
        self._console = Console(file=stream)
        self._begun = self._total = 0
        self._started = time.monotonic()
        self._stage = ""
        self._bar = self._line_of(redrawn=False)

    def start(self) -> None:
        with suppress(OSError):  # the terminal was closed; the run goes on
            self._bar.start()

    def stop(self) -> None:
        with suppress(OSError):
            self._bar.stop()

    def stage(self, text: str) -> None:
        self._stage = text
        with suppress(OSError):
            self._console.print(text, markup=False, highlight=False)
        self._draw("")

    @contextmanager
    def busy(self, text: str) -> Iterator[None]:
        self.stop()
        self.stage(text)
        still, self._bar = self._bar, self._line_of(redrawn=True)
        self._draw("")
        self.start()
        try:
            yield
        finally:
            self.stop()
            self._bar = still
            self._draw("")
            self.start()

    def total(self, steps: int) -> None:
        self._begun, self._total, self._started = 0, steps, time.monotonic()

    def step(self, text: str) -> None:
        self._begun += 1
        self._draw(text)

    def line(self, text: str) -> None:
        told = textwrap.fill(text, columns(), break_long_words=False, break_on_hyphens=False) if text else text
        with suppress(OSError):
            self._console.print(told, markup=False, highlight=False, soft_wrap=True)

    @contextmanager
    def asking(self, question: Question) -> Iterator[None]:
        self.stop()
        with suppress(OSError):
            self._console.print(
                f"\n{self._stage} {counted(self._begun, self._total)}" if self._total else "", highlight=False
            )
            self._console.print(
                wrapped(question, columns()), markup=False, highlight=False, style="bold", soft_wrap=True
            )
            self._console.print("> ", end="", markup=False, highlight=False)
        try:
            yield
        finally:
            self.start()

    def found(self, look: Callable[[], Iterable[Finding]]) -> None: ...

    def _line_of(self, *, redrawn: bool) -> progress.Progress:
        """The line: part, bar, count, time, what is done. While nothing moves a thread draws it, with the time so far."""
        cut = Column(ratio=1, no_wrap=True, overflow="ellipsis")
        clock = progress.TimeElapsedColumn() if redrawn else _text("left")
        bar = progress.Progress(
            _text("stage"), progress.BarColumn(BAR), _text("count"), clock,
            progress.TextColumn("{task.description}", markup=False, table_column=cut),
            console=self._console, auto_refresh=redrawn, refresh_per_second=REDRAWN_HZ, redirect_stdout=False,
            redirect_stderr=False, transient=True, expand=True,
        )  # fmt: skip
        bar.add_task("", total=None, visible=False, stage="", count="", left="")
        return bar

    def _draw(self, text: str) -> None:
        done = max(0, self._begun - 1)
        count = counted(self._begun, self._total) if self._begun or self._total else ""
        left = time_left(done, self._total, time.monotonic() - self._started)
        with suppress(OSError):  # the terminal was closed; the run goes on
            self._bar.update(
                progress.TaskID(0), total=self._total or None, completed=done, description=text, stage=_short(self._stage),
                count=count, left=left, visible=bool(self._stage), refresh=True,
            )  # fmt: skip


def _short(stage: str) -> str:
    """What fits beside the count and the time left in 80 columns."""
    return stage if len(stage) <= LONGEST_STAGE else stage[: LONGEST_STAGE - 1] + "…"


def _text(field: str) -> progress.TextColumn:
    """A column that is never cut."""
    return progress.TextColumn(f"{{task.fields[{field}]}}", markup=False, table_column=Column(no_wrap=True))
