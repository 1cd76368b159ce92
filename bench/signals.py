"""The one module that touches POSIX and Windows signals: SIGINT and SIGTERM delivered to a callback, then restored."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

STOPPING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def delivered_to(callback: Callable[[str], None]) -> Iterator[None]:
    """Within the block, SIGINT and SIGTERM call `callback` with the signal's name instead of their usual effect.

    Both are installed explicitly: a process started in the background by a shell inherits SIGINT ignored. Outside of
    the main thread Python allows no handlers, and the block runs without.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, _: FrameType | None) -> None:
        callback(signal.Signals(number).name)

    before = {number: signal.signal(number, handle) for number in STOPPING}
    try:
        yield
    finally:
        for number, previous in before.items():
            # None stands for a handler that was not installed from Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if previous is None else previous)
