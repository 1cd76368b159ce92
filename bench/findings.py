"""Findings: what a record must say beyond its numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NoReturn

SIMULATED_CONTROLLER = "simulated-controller"  # a live run whose controller says that it is a simulated one
CERTIFICATE_OVERDUE = "certificate-overdue"  # past its due date on the day of the run, and results rest on it


class Effect(StrEnum):
    """What a finding does to the outcome of its run. PASS and DONE are only possible when every finding is a NOTE."""

    NOTE = "note"
    INDETERMINATE = "indeterminate"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """A code (kebab-case, stable), a sentence for the reader, where it was seen, and its effect on the outcome.

    `concerns` are the quantities whose data or influences it puts in doubt: `name`, `name@place` or `@place` (all that is
    measured there); empty is all of the run. Their verdict of fail is no statement of non-conformity. A finding that says of
    a quantity what a limit says too does not put that quantity in doubt.
    """

    code: str
    text: str
    where: str = ""
    effect: Effect = Effect.NOTE
    concerns: tuple[str, ...] = ()


class Ended(Exception):
    """An evaluation ends here: what would come next rests on data that a finding says are wrong. `so_far` is what there is to
    be drawn of it, if anything."""

    def __init__(self, so_far: Any = None) -> None:
        super().__init__()
        self.so_far = so_far


class Findings:
    """The findings of an evaluation, in the order in which they are told."""

    def __init__(self) -> None:
        self.told: list[Finding] = []

    def add(self, found: Iterable[Finding]) -> None:
        """Tell them; the evaluation goes on."""
        self.told += found

    def gate(self, found: Iterable[Finding], codes: Collection[str] | None = None, so_far: Any = None) -> None:
        """Tell them; the evaluation ends here if one of them is an error, or with `codes` only if one has such a code. What
        there is `so_far` is drawn then.

        Raises:
            Ended: one is.
        """
        found = list(found)
        self.told += found
        if any(f.effect is Effect.ERROR if codes is None else f.code in codes for f in found):
            raise Ended(so_far)

    @property
    def wrong(self) -> bool:
        """Whether one of them is an error."""
        return any(f.effect is Effect.ERROR for f in self.told)

    def end(self, finding: Finding) -> NoReturn:
        """Tell why there is no result, and end the evaluation.

        Raises:
            Ended: always.
        """
        self.told.append(finding)
        raise Ended
