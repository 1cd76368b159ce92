"""The one module that touches POSIX and Windows signals: SIGINT, SIGTERM and SIGHUP delivered to a callback, then restored."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

STOPPING = (signal.SIGINT, signal.SIGTERM)
HANGUP = getattr(signal, "SIGHUP", None)
"""A terminal that closed, such as a connection over ssh that was lost; Windows has none."""


def wake_main_thread() -> None:
    """Have the main thread call its handler of SIGINT as soon as it runs Python. No signal is sent."""
    _thread.interrupt_main(signal.SIGINT)


def are_heard() -> bool:
    """Whether handlers can be installed here: Python calls them in the main thread alone."""
    return threading.current_thread() is threading.main_thread()


@contextmanager
def delivered_to(callback: Callable[[str], None]) -> Iterator[None]:
    """Within the block, SIGINT, SIGTERM and SIGHUP call `callback` with the signal's name instead of their usual effect.

    The first two are installed explicitly: a process started in the background by a shell inherits SIGINT ignored. A
    SIGHUP that is ignored at the start stays so: `nohup` asks for that. Outside of the main thread Python allows no
    handlers, and the block runs without.
    """
    if not are_heard():
        yield
        return

    def handle(number: int, _: FrameType | None) -> None:
        callback(signal.Signals(number).name)

    watched = list(STOPPING)
    if HANGUP is not None and signal.getsignal(HANGUP) != signal.SIG_IGN:
        watched.append(HANGUP)
    before = {number: signal.signal(number, handle) for number in watched}
    try:
        yield
    finally:
        for number, previous in before.items():
            # None stands for a handler that was not installed from Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if previous is None else previous)
