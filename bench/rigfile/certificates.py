"""Certificates against a day: those that were overdue by then, and those of a later date."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import date

from bench.rigfile.elements import Certificate
from bench.rigfile.model import RigFile
from bench.rigfile.numbers import numbers_in
from bench.rigfile.places import Places
from bench.rigfile.toleranced import Toleranced

RESTS = "; the results rest on it: "


@dataclass(frozen=True)
class OutOfDate:
    """A certificate by its key in [certificates], and the identities of the numbers that go by it. `ahead`: it is dated after
    the day; else it was due before it."""

    name: str
    certificate: Certificate
    ahead: bool
    numbers: tuple[str, ...]

    def __str__(self) -> str:
        c = self.certificate
        which = f"certificate {self.name}" + (f" ({c.number}" + (f", {c.laboratory})" if c.laboratory else ")"))
        return f"{which} is dated {c.date}, which is in the future" if self.ahead else f"{which} was due on {c.due}"

    @property
    def told(self) -> str:
        """With the numbers, as a finding says it."""
        return f"{self}{RESTS}{', '.join(self.numbers)}"


def numbers_told(said: str) -> frozenset[str]:
    """The identities of the numbers that a finding names; none where it names none."""
    return frozenset(filter(None, said.rpartition(RESTS)[2].split(", "))) if RESTS in said else frozenset()


def certified_numbers(rig: RigFile) -> Mapping[str, Toleranced]:
    """Every number that may go by a certificate, by its identity: those of the machine, and of the instruments beside it (load
    cells, a reference, what holds it)."""
    return {**Places(rig).known, **dict(numbers_in(rig.capabilities, ("capabilities",)))}


def out_of_date(rig: RigFile, day: date, numbers: Collection[str] | None = None) -> Iterator[OutOfDate]:
    """Certificates that do not hold on a day, of the `numbers` with these identities alone, or of all: that have no due date
    hold for ever."""
    by_certificate: dict[str, list[str]] = {}
    for identity, number in certified_numbers(rig).items():
        if number.certificate in rig.certificates and (numbers is None or identity in numbers):
            by_certificate.setdefault(number.certificate, []).append(identity)
    for name, identities in by_certificate.items():
        c = rig.certificates[name]
        ahead = bool(c.date) and date.fromisoformat(c.date) > day
        if ahead or (c.due and date.fromisoformat(c.due) < day):
            yield OutOfDate(name, c, ahead, tuple(identities))
