"""Requests that may block, made in a thread of their own while the caller sleeps on the rig's clock: the heartbeat's lease
is renewed, links are read and time limits count meanwhile."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ParamSpec, TypeVar

from bench.clock import Clock
from bench.errors import LinkError

WAIT_S = 0.01
P = ParamSpec("P")
T = TypeVar("T")


class Background:
    """One thread that makes requests in the order in which they were asked for.

    A request is made even where its caller stopped waiting, and before any later one: a `run` that was given up on cannot
    come after the `coast` that followed. The thread is a daemon (an executor's would keep the process from ending).
    """

    def __init__(self, clock: Clock, name: str) -> None:
        self._clock, self._ended = clock, False
        self._jobs: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def call(self, function: Callable[..., T], *args: Any) -> T:
        """Its result; raises what it raises, or what sleeping on the clock raises."""
        future = self.submit(function, *args)
        while not future.done():
            self._clock.sleep(WAIT_S)
        return future.result()

    def submit(self, function: Callable[..., T], *args: Any) -> Future[T]:
        """Ask without waiting.

        Raises:
            LinkError: it is closed.
        """
        if self._ended:
            raise LinkError(f"{self._thread.name}: closed")
        future: Future[T] = Future()
        self._jobs.put((future, lambda: function(*args)))
        return future

    def of(self, function: Callable[P, T]) -> Callable[P, T]:
        """The function, made in the background."""

        def asked(*args: P.args, **keys: P.kwargs) -> T:
            return self.call(lambda: function(*args, **keys))

        return asked

    def close(self, timeout_s: float = 1.0) -> None:
        """End once what was asked for is done; a request that is stuck is left behind. Calling it twice is harmless."""
        if not self._ended:
            self._ended = True
            self._jobs.put(None)
        self._thread.join(timeout_s)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            future, function = job
            try:
                future.set_result(function())
            except BaseException as error:  # the caller's to handle, whatever it is
                future.set_exception(error)
