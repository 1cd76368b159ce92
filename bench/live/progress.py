"""The progress display of a run that is shown on a page as well: everything goes to both."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from bench.findings import Effect, Finding
from bench.live.hub import Hub
from bench.live.questions import Questions
from bench.progress import Progress
from bench.question import CONSOLE, Elsewhere, Question

logger = logging.getLogger("bench.live")
MOST = 500  # findings that a page is told


class LiveProgress:
    """What the terminal shows, and the hub is told."""

    def __init__(
        self, shown: Progress, hub: Hub, questions: Questions, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._shown, self._hub, self._questions, self._now = shown, hub, questions, now
        self._stage = self._step = ""
        self._total = self._begun = 0
        self._started = now()
        self._found: dict[str, Finding] = {}

    def stage(self, text: str) -> None:
        self._shown.stage(text)
        self._stage, self._step = text, ""
        self._tell()

    @contextmanager
    def busy(self, text: str) -> Iterator[None]:
        self._stage, self._step = text, ""
        self._tell()
        with self._shown.busy(text):
            yield

    def total(self, steps: int) -> None:
        self._shown.total(steps)
        self._total, self._begun, self._started, self._step = steps, 0, self._now(), ""

    def step(self, text: str) -> None:
        self._shown.step(text)
        self._begun, self._step = self._begun + 1, text
        self._tell()

    def line(self, text: str) -> None:
        self._shown.line(text)
        self._hub.tell("log", {"text": text})

    @contextmanager
    def asking(self, question: Question) -> Iterator[Elsewhere]:
        with self._shown.asking(question), self._questions.ask(question) as opened:
            yield opened
        answer = opened.look()
        if answer is not None and answer.by != CONSOLE:
            self._shown.line(f"{answer.by} answered {answer.strip()!r}")

    def found(self, look: Callable[[], Iterable[Finding]]) -> None:
        """One of the same code and place as before takes its place: its count has grown. Raises nothing."""
        try:
            for key, finding in _keyed(look()):
                self._tell_finding(key, finding)
        except Exception:
            logger.debug("findings could not be shown", exc_info=True)

    def settle(self, findings: Iterable[Finding]) -> None:
        """These stand in the record; what was told on the way and does not is said to have passed."""
        standing = dict(_keyed(findings))
        for key, finding in list(self._found.items()):
            if key not in standing:
                text = f"{finding.text} (for a while: it does not stand in the record)"
                self._tell_finding(key, replace(finding, text=text, effect=Effect.NOTE))

    def _tell_finding(self, key: str, finding: Finding) -> None:
        if self._found.get(key) != finding and (key in self._found or len(self._found) < MOST):
            self._found[key] = finding
            told = {"code": finding.code, "text": finding.text, "where": finding.where, "effect": finding.effect.value}
            self._hub.tell("finding", {"id": key, **told}, key)

    def _tell(self) -> None:
        done, elapsed = max(0, self._begun - 1), self._now() - self._started
        left = elapsed / done * max(0, self._total - done) if self._total and done else None
        self._hub.tell("progress", {"stage": self._stage, "step": self._step, "done": done, "total": self._total or None,
                                    "elapsed_s": elapsed, "left_s": left})  # fmt: skip


def _keyed(findings: Iterable[Finding]) -> Iterator[tuple[str, Finding]]:
    """Each with what it is known by: its code, its place, and which of those it is."""
    seen: Counter[tuple[str, str]] = Counter()
    for finding in findings:
        seen[finding.code, finding.where] += 1
        yield f"{finding.code}/{finding.where}/{seen[finding.code, finding.where]}", finding
