"""The supervisor: whatever stops a run ends in the same ordered make-safe.

Signals only set a flag while the machine moves; the clock's pump asks `check` after each slice of a sleep (at most
0.1 s of bench time), so a stop takes effect in the middle of a sleep and never inside a half-sent command. Where
nothing moves (start-up, analysis) a signal raises at once.

During make-safe nothing is raised: a second signal is logged and ignored, a first one waits until the machine is safe
(`checkpoint`). A person at the live page stops a run the same way (`stop`). A step that takes too long, or whose link is dead,
is logged and the next one still runs. What a step calls must not block outside of `clock.sleep`; links never do (`receive`
never waits).
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

from bench import os_signals
from bench.errors import LinkError, SignalAbort, StopAsked
from bench.findings import Effect, Finding

logger = logging.getLogger("bench.run.supervisor")


@dataclass(frozen=True, slots=True)
class SafeStep:
    """One step of make-safe: what it does, in bench time of at most `timeout_s`."""

    name: str
    action: Callable[[], None]
    timeout_s: float = math.inf  # one that watches its own time has no other


class _Mode(Enum):
    AT_ONCE = "a signal raises where the program stands"
    AT_CHECK = "a signal raises at the next check"
    LATER = "a signal raises at the next checkpoint"


class Supervisor:
    """Owns the stopping of one run. Use within `with supervisor.watching():`."""

    def __init__(self) -> None:
        self._mode = _Mode.AT_ONCE
        self._stop: tuple[str, type[SignalAbort]] | None = None  # what stops the run, first come
        self._heard = threading.Lock()  # while it is held the main thread goes on hearing its signals
        self._hearing = self._waking = False
        self._answered = False  # the signal has ended what it was to end
        self._unanswered: list[
            tuple[str, bool]
        ] = []  # signals and whether each is the first; handlers do not log: a signal
        # may arrive inside a write to the same stream
        self._deadline_ns: int | None = None
        self._step = ""

    @property
    def stopped_by(self) -> str | None:
        """The name of the signal that stops this run, or who asked for it, if that came in time to do so."""
        return self._stop[0] if self._stop is not None else None

    @contextmanager
    def watching(self) -> Iterator[Supervisor]:
        """SIGINT, SIGTERM and SIGHUP come here within the block and go where they went before after it."""
        with os_signals.delivered_to(self._received):
            self._hearing = os_signals.are_heard()
            try:
                yield self
            finally:
                with self._heard:
                    self._hearing = False
        self._answer()

    def stop(self, who: str) -> None:
        """Stop the run as a signal does, at the wish of a person, from any thread: at the next check while the machine moves,
        at once where nothing does and signals are heard. Returns at once."""
        if not self._noted(f"STOP ({who})", StopAsked):
            return
        with self._heard:
            if self._hearing and self._mode is _Mode.AT_ONCE:
                self._waking = True
                os_signals.wake_main_thread()

    @contextmanager
    def moving(self) -> Iterator[None]:
        """The machine may move within the block: signals wait for `check`, or for the end of the block.

        Raises:
            SignalAbort: a signal has arrived.
        """
        try:
            with self._in(_Mode.AT_CHECK):
                yield
            self.checkpoint()
        except SignalAbort:
            self._answered = True
            raise

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Nothing moves and nothing half done is lost within the block: signals raise at once.

        Raises:
            SignalAbort: a signal has arrived, now or before the block, that has not yet ended anything.
        """
        try:
            with self._in(_Mode.AT_ONCE):
                self.checkpoint()
                yield
        except SignalAbort:
            self._answered = True
            raise

    @contextmanager
    def finishing(self) -> Iterator[None]:
        """What is done within the block must be whole: a signal waits for the next checkpoint."""
        with self._in(_Mode.LATER):
            yield
        self._answer()

    @contextmanager
    def _in(self, mode: _Mode) -> Iterator[None]:
        before, self._mode = self._mode, mode
        try:
            yield
        finally:
            self._mode = before

    def check(self, now_ns: int) -> None:
        """Called by the clock's pump.

        Raises:
            SignalAbort: a signal asks the run to stop.
            LinkError: the present step of make-safe has run out of time.
        """
        if self._mode is _Mode.LATER:
            self._answer()
            if self._deadline_ns is not None and now_ns > self._deadline_ns:
                raise LinkError(f"make-safe step {self._step!r} did not end within its time")
            return
        self.checkpoint()

    def make_safe(self, steps: Sequence[SafeStep], now_ns: Callable[[], int]) -> tuple[Finding, ...]:
        """Do every step in order, whatever happens to the ones before; returns a finding per reason that steps failed."""
        failed: dict[str, list[str]] = {}
        with self.finishing():
            for step in steps:
                logger.info("make safe: %s", step.name)
                limited = math.isfinite(step.timeout_s)
                self._step, self._deadline_ns = step.name, now_ns() + round(step.timeout_s * 1e9) if limited else None
                try:
                    step.action()
                except Exception as error:
                    # Anything at all: the next step must run.
                    text = str(error) or type(error).__name__
                    if text not in failed:
                        logger.warning("make safe: %s failed: %s", step.name, text)
                    failed.setdefault(text, []).append(step.name)
                finally:
                    self._deadline_ns, self._step = None, ""
        return tuple(
            Finding("make-safe-failed", f"make-safe failed ({', '.join(names)}): {text}", names[0], Effect.ERROR)
            for text, names in failed.items()
        )

    def _received(self, name: str) -> None:
        if self._waking:  # it is no signal: `stop` wants this thread to look
            self._waking = False
            if self._mode is _Mode.AT_ONCE:
                self.checkpoint()
            return
        if self._noted(name, SignalAbort) and self._mode is _Mode.AT_ONCE:
            self.checkpoint()

    def _noted(self, name: str, kind: type[SignalAbort]) -> bool:
        """Whether it is the first that stops the run; one that changes nothing now is answered with a line."""
        first = self._stop is None
        if not first or self._mode is _Mode.LATER:
            self._unanswered.append((name, first))
        if first:
            self._stop = name, kind
        return first

    def checkpoint(self) -> None:
        """End here if a signal has asked for it.

        Raises:
            SignalAbort: one has, and nothing has been ended for it yet.
        """
        if self._stop is not None and not self._answered:
            name, kind = self._stop
            raise kind(f"stopped by {name}")

    def _answer(self) -> None:
        """A line for each signal that changes nothing now: whoever sent it sees that it came."""
        while self._unanswered:
            name, first = self._unanswered.pop(0)
            doing = (
                f"the machine is being made safe ({self._step})"
                if self._step
                else "what is begun is brought to its end"
            )
            if first:
                logger.warning("%s: %s; the run ends after that", name, doing)
            else:
                logger.warning("%s ignored: %s", name, doing if self._step else "the run is already being stopped")
