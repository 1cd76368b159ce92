"""What a person, or who stands in for one, may answer: numbers with their units, words that leave something out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from bench import units
from bench.question import Choice

T = TypeVar("T")
YES, NO, STOP = ("y", "yes"), ("n", "no"), ("stop", "abort", "quit")
DONE = ("", *YES, "ok", "done")


def after(said: str, what: str) -> str:
    """What is asked, after what is told of the machine."""
    return f"{said}\n{what}" if said else what


def degrees_of(answer: str) -> float | None:
    """rad of an answer in degrees, None where it is none."""
    try:
        degrees = float(answer.removesuffix("°"))
    except ValueError:
        return None
    return math.radians(degrees) if math.isfinite(degrees) else None


def skipped(answer: str) -> bool | None:
    """False where something is left out, None where the answer says something else."""
    return False if answer == "skip" else None


class Misunderstood(Exception):
    """Why an answer asks for another."""


def unknown(answer: str) -> str:
    return f"{answer!r} is no answer here." if answer else "An empty line is no answer here."


def reading_of(text: str, unit: str) -> float | None:
    """SI of a number with its unit, or in `unit` where it has none; None where it is none, or one of another kind."""
    number, _, symbol = text.strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        return None
    found, expected = units.UNITS.get(symbol.strip() or unit), units.UNITS[unit]
    if found is None or found.si != expected.si or not math.isfinite(value):
        return None
    return value * found.factor + found.offset


@dataclass(frozen=True)
class Other(Generic[T]):
    """What a person may say that was done instead: how they say it, what makes something of their answer, and the buttons of a
    page for it."""

    more: str = ""
    read: Callable[[str], T | None] = lambda _: None
    choices: tuple[Choice, ...] = ()
