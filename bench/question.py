"""What a person is asked and what they answer: texts, with what a page needs beside them.

A question is asked at the terminal, and may be asked somewhere else at the same time: the first answer wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

CONSOLE = "console"
"""Who answered at the terminal."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A button: what it says, and the answer that stands behind it."""

    label: str
    answer: str


class Question(str):
    """The text as a terminal shows it. `asks` is that text without the last line, which says what to type there; a page has
    buttons for the `choices` instead, and, if any text may be an answer, a field with `field` beside it ("": no field)."""

    asks: str
    choices: tuple[Choice, ...]
    field: str

    def __new__(cls, asks: str, hint: str = "", choices: Sequence[Choice] = (), field: str = "Answer") -> Question:
        made = super().__new__(cls, f"{asks}\n{hint}" if hint else asks)
        made.asks, made.choices, made.field = asks, tuple(choices), field
        return made


class Answer(str):
    """What was answered, and by whom."""

    by: str

    def __new__(cls, text: str, by: str = CONSOLE) -> Answer:
        made = super().__new__(cls, text)
        made.by = by
        return made


class Elsewhere(Protocol):
    """Another place where one question is open."""

    def look(self) -> Answer | None:
        """What was answered there or by `offer`, None as long as nobody has."""
        ...

    def offer(self, answer: Answer) -> Answer:
        """An answer from here; the first that there is, which is this one unless somebody was faster."""
        ...
