"""Words of the progress display: questions broken between words, how many, time left, the width of a terminal."""

from __future__ import annotations

import shutil
import textwrap

WIDEST = 100  # columns of a question: longer lines read badly

PLAIN_WIDTH = 80  # of a question where the width is unknown


def wrapped(question: str, width: int) -> str:
    """A question broken between words, each of its own lines by itself."""
    return "\n".join(textwrap.fill(line, min(width, WIDEST)) for line in question.splitlines())


def columns() -> int:
    """Width of the terminal; 80 where it is not told."""
    return shutil.get_terminal_size((PLAIN_WIDTH, 24)).columns


def counted(begun: int, total: int) -> str:
    """How many of them have begun; some runs find more to do than they foresaw."""
    return f"{begun}/{total}" if begun <= total else str(begun)


def time_left(done: int, total: int, seconds: float) -> str:
    """`01:05 left` at the pace so far; empty where that is not known."""
    return f"{clock_text(seconds / done * max(0, total - done))} left" if total and done else ""


def clock_text(seconds: float) -> str:
    """`01:05`, or `1:01:05` from an hour on."""
    whole = round(seconds)
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"
