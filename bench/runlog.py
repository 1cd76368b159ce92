"""The log of one run: standard error and `run.log`, warnings also as events in the recording."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SHOWN = "shown"  # attribute of a record that the terminal gets whatever its level
ROOMS = ("bench", "drivers", "procedures", "reports", "sim_backend")


class _Forward(logging.Handler):
    """Hands each record's text to a function; the standard library's way to attach one."""

    def __init__(self, level: int, sink: Callable[[logging.LogRecord], object]) -> None:
        super().__init__(level)
        self._sink = sink

    def emit(self, record: logging.LogRecord) -> None:
        # What cannot be shown or recorded (a closed terminal, a full disk) must never stop a make-safe.
        with suppress(Exception):
            self._sink(record)


class _Quiet(logging.FileHandler):
    """A full disk costs lines of the log, and no tracebacks on the terminal in the middle of a run."""

    def handleError(self, record: logging.LogRecord) -> None:
        pass

    def close(self) -> None:
        with suppress(OSError):
            super().close()


@contextmanager
def to_file(path: Path) -> Iterator[None]:
    """Everything from INFO on goes to `path` within the block, tracebacks included."""
    handler = _Quiet(path, encoding="utf-8", delay=False)
    layout = logging.Formatter("%(asctime)s.%(msecs)03dZ %(levelname)-7s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
    layout.converter = time.gmtime
    handler.setFormatter(layout)
    with _attached(handler, logging.INFO):
        yield


@contextmanager
def to_lines(line: Callable[[str], None], level: int = logging.WARNING) -> Iterator[None]:
    """Within the block `line` gets each message from `level` on, without its traceback, and each that is `shown`."""

    def sink(record: logging.LogRecord) -> None:
        if record.levelno >= level:
            line(f"{record.levelname.lower()}: {record.getMessage()}")
        elif hasattr(record, SHOWN):
            line(record.getMessage())

    lowest = min(level, logging.INFO)
    with _attached(_Forward(lowest, sink), lowest):
        yield


def show(logger: logging.Logger, text: str) -> None:
    """A line for the terminal and the log that is no warning."""
    logger.info(text, extra={SHOWN: True})


@contextmanager
def warnings_to(event: Callable[[str, str], object]) -> Iterator[None]:
    """Within the block each warning calls `event(logger name, text)`."""
    with _attached(_Forward(logging.WARNING, lambda r: event(r.name, r.getMessage())), logging.WARNING):
        yield


@contextmanager
def _attached(handler: logging.Handler, level: int) -> Iterator[None]:
    loggers = [logging.getLogger(room) for room in ROOMS]
    before = [(logger, logger.level) for logger in loggers]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(min(level, logger.level or level))
    try:
        yield
    finally:
        for logger, old in before:
            logger.removeHandler(handler)
            logger.setLevel(old)
        handler.close()
