"""The question that is open on the page. Several may watch and answer; the first answer is the one that counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from bench.question import Answer, Question

Tell = Callable[[str, Mapping[str, Any] | None], None]
"""As `bench.live.hub.Hub.tell`."""


class Questions:
    """Of one run, a question at a time. `ask` is for the run's thread, `answer` for those of clients; neither waits for the
    other, as the first answer is what a dictionary has first."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._number = 0
        self._open: _Open | None = None

    @contextmanager
    def ask(self, question: Question) -> Iterator[_Open]:
        """Show a question for the length of the block; who answered it is told afterwards."""
        self._number += 1
        opened = self._open = _Open(self._number)
        choices = [{"label": c.label, "answer": c.answer} for c in question.choices]
        self._tell("prompt", {"id": opened.number, "question": question.asks, "hint": question.field, "choices": choices,
                              "free": bool(question.field)})  # fmt: skip
        try:
            yield opened
        finally:
            self._open = None
            self._tell("prompt", None)
            found = opened.look()
            told = {"answer": None, "by": ""} if found is None else {"answer": str(found), "by": found.by}
            self._tell("answered", {"id": opened.number, **told})

    def answer(self, number: int, answer: Answer) -> Answer | None:
        """The first answer of that question: this one, or that of somebody who was faster; None where it is not open."""
        opened = self._open
        return opened.offer(answer) if opened is not None and opened.number == number else None


class _Open:
    """A question that is open, with its first answer."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._first: dict[int, Answer] = {}

    def look(self) -> Answer | None:
        return self._first.get(self.number)

    def offer(self, answer: Answer) -> Answer:
        return self._first.setdefault(self.number, answer)  # one step of the interpreter: nobody comes between
