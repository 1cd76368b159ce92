"""Progress: step text, done and total, time left. A bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO

# Ends of the names of labels, SI; the unit in which they are told, and what one of it is in SI.
TOLD = (
    ("_rad_s2", math.pi / 30, " r/min/s"), ("_rad_s", math.pi / 30, " r/min"), ("_rad", math.pi / 180, "°"),
    ("_kg", 1e-3, " g"), ("_m", 1e-6, " µm"), ("_A", 1.0, " A"), ("_hz", 1.0, " Hz"), ("_s", 1.0, " s"),
)  # fmt: skip
PLAIN_LINES = 20  # about as many lines in a run, however many steps it has


class Progress(Protocol):
    """What the runner tells whoever watches."""

    def stage(self, text: str) -> None:
        """The run enters a new part."""
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


class PlainProgress:
    """Lines on a stream that is not a terminal."""

    def __init__(self, stream: TextIO, now: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._now = stream, now
        self._total = self._begun = 0
        self._started = 0.0

    def stage(self, text: str) -> None:
        self.line(text)

    def total(self, steps: int) -> None:
        self._total, self._begun, self._started = steps, 0, self._now()

    def step(self, text: str) -> None:
        self._begun += 1
        every = max(1, self._total // PLAIN_LINES)
        if (self._begun - 1) % every == 0:
            self.line(f"step {_count(self._begun, self._total)}: {text}{self._left()}")

    def line(self, text: str) -> None:
        with suppress(OSError, ValueError):  # nobody reads any more; the run goes on
            self._stream.write(text + "\n")
            self._stream.flush()

    def _left(self) -> str:
        done = self._begun - 1
        if not self._total or not done:
            return ""
        return f", {clock_text((self._now() - self._started) / done * max(0, self._total - done))} left"


class TerminalProgress:
    """A bar on a terminal, drawn without a thread; log lines scroll above it."""

    def __init__(self, stream: TextIO) -> None:
        from rich import progress
        from rich.console import Console

        self._bar = progress.Progress(
            progress.TextColumn("[bold]{task.fields[stage]}"),
            progress.BarColumn(24),
            progress.MofNCompleteColumn(),
            progress.TimeRemainingColumn(),
            progress.TextColumn("{task.description}", markup=False),
            console=Console(file=stream),
            auto_refresh=False,
            redirect_stdout=False,
            redirect_stderr=False,
            transient=True,
        )
        self._task = self._bar.add_task("", total=None, stage="")
        self._begun = 0

    def start(self) -> None:
        self._bar.start()

    def stop(self) -> None:
        with suppress(OSError):
            self._bar.stop()

    def stage(self, text: str) -> None:
        with suppress(OSError):
            self._bar.update(self._task, stage=text, description="", refresh=True)
            self._bar.console.print(text, markup=False, highlight=False)

    def total(self, steps: int) -> None:
        self._begun = 0
        self._bar.reset(self._task, total=steps or None)

    def step(self, text: str) -> None:
        self._begun += 1
        with suppress(OSError):  # the terminal was closed; the run goes on
            self._bar.update(self._task, completed=self._begun - 1, description=text, refresh=True)

    def line(self, text: str) -> None:
        with suppress(OSError):
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def shown_on(stream: TextIO) -> Iterator[Progress]:
    """The progress display that fits the stream."""
    if not stream.isatty():
        yield PlainProgress(stream)
        return
    bar = TerminalProgress(stream)
    bar.start()
    try:
        yield bar
    finally:
        bar.stop()


class Silent:
    """No display, for callers that only want the result."""

    def stage(self, text: str) -> None: ...
    def total(self, steps: int) -> None: ...
    def step(self, text: str) -> None: ...
    def line(self, text: str) -> None: ...


def clock_text(seconds: float) -> str:
    """`01:05`, or `1:01:05` from an hour on."""
    whole = round(seconds)
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"


def _count(begun: int, total: int) -> str:
    return f"{begun}/{total}" if total else str(begun)


def described(labels: Mapping[str, Any]) -> str:
    """A step's labels for people: speeds in r/min, motion in µm, angles in degrees, nothing as "none"."""
    return ", ".join(_label(name, value) for name, value in labels.items())


def _label(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return f"{name} {'yes' if value else 'no'}"
    if isinstance(value, float):
        for end, one, unit in TOLD:
            if name.endswith(end):
                return f"{name.removesuffix(end)} {_number(value / one)}{unit}"
        return f"{name} {_number(value)}"
    return f"{name} {'none' if value == '' else value}"


def _number(value: float) -> str:
    """Four digits, all of a large number, no negative zero."""
    return f"{value + 0.0:.4g}" if abs(value) < 1e4 - 0.5 else f"{value:.0f}"
