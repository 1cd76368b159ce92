"""Calibrations: past results adopted as facts of a rig, with their elementary influences by identity.

An influence that stands in the rig file (a span, gravity, a sensor's gain) is the same in every run, so that it keeps
its identity: a later run that uses it again adds to it or cancels it, as it does in the machine. One that a run invents
(its scatter, its hysteresis) happened once, in that run: at adoption its identity gets the run's in front.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict

from bench.rigfile import RigFile
from bench.rigfile.certificates import certified_numbers
from bench.rigfile.toleranced import Toleranced
from bench.schema import STRICT
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.forms import Number, by_numbers, form

Backend = Literal["sim", "live", "served"]  # served: a live link with a simulated controller behind it
State = Literal["current", "expired"]
CLOCKS_DIFFER = timedelta(minutes=1)  # at most: the clock of the run's host, and of the one that uses it
RIG_TABLES = ("site", "geometry", "masses", "sensors", "machine", "hook")
"""First parts of the identities of influences that stand in the rig file, whatever else is known of it."""
OF_A_DAY = frozenset({"site/air_density"})
"""Numbers of the rig file that state a range for every day, within which each has its own."""
WANDERS = (
    "drift"  # last part of the identity of a number that states how fast a zero may wander: another way in each run
)


@dataclass(frozen=True)
class Need:
    """A calibration that a run uses: of which procedure, the settings that it must have been made at, and the values that it
    must have, by name. Without an `optional` one the run does; one that is there and does not fit is refused all the same. Of
    one that is `told` the controller is told values, which no budget has: the model of a campaign will do."""

    procedure: str
    settings: Mapping[str, float] = field(default_factory=dict)
    optional: bool = False
    facts: tuple[str, ...] = ()
    told: bool = False


@dataclass(frozen=True)
class Certificate:
    """What the rig file said of an influence when a calibration was made: value, standard uncertainty, source; SI."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    value: float
    u: float
    unit: str
    distribution: str
    source: str

    def same_as(self, other: Certificate) -> bool:
        """The numbers are the same; another wording of the source does not make another certificate."""
        return (self.value, self.u, self.unit, self.distribution) == (
            other.value, other.u, other.unit, other.distribution,
        )  # fmt: skip

    def __str__(self) -> str:
        return f"{self.value:.8g} {self.unit} with u = {self.u:.3g} ({self.distribution})"


@dataclass(frozen=True)
class Used:
    """A calibration that another one rests on, in short."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    procedure: str
    run_id: str
    date: str
    due: str
    sha256: str
    state: State


@dataclass(frozen=True)
class Calibration:
    """The values of one run, adopted as facts of one rig.

    `values` by name, SI, with influences by identity. `settings` are those they hold for. `date` is when the run began
    (ISO 8601, UTC), `due` the last day on which it may be used. A virtual rig is named by its `seed`: seed n + 1 is another
    machine. `sha256` is the recording's digest. `used` are the calibrations that the run itself used.
    `sealed`: its file carries the digest of its content, as every adopted one does; a file that was written by hand may
    have none. `expired` is not of the file: it says that the calibration was overdue in the run that used it.
    """

    procedure: str
    values: Mapping[str, Estimate]
    settings: Mapping[str, float] = field(default_factory=dict)
    run_id: str = ""
    date: str = "2026-01-01T00:00:00+00:00"
    due: str = "9999-12-31"
    rig: str = ""
    uut: str = ""
    backend: Backend = "sim"
    seed: int | None = None
    outcome: str = "PASS"
    sha256: str = ""
    levbench: str = ""
    used: tuple[Used, ...] = ()
    certificates: Mapping[str, Certificate] = field(default_factory=dict)
    sealed: bool = True
    expired: bool = False

    @property
    def state(self) -> State:
        return "expired" if self.expired else "current"

    @property
    def summary(self) -> Used:
        """What a record says of a calibration that a run used."""
        return Used(self.procedure, self.run_id, self.date, self.due, self.sha256, self.state)

    @property
    def influences(self) -> dict[str, Influence]:
        """Every influence of the values by identity."""
        return {i.id: i for e in self.values.values() for i in e.sensitivities}

    def overdue(self, now: datetime) -> bool:
        """Whether the due day is over."""
        return now.astimezone(UTC).date() > date.fromisoformat(self.due)

    def ahead(self, now: datetime) -> bool:
        """Whether it is dated in the future, by more than clocks differ: one of the two clocks is wrong, or the date is."""
        return datetime.fromisoformat(self.date) > now + CLOCKS_DIFFER

    def used_at(self, now: datetime) -> Calibration:
        """This calibration as a run that begins now uses it: `expired` says whether it is overdue."""
        return dataclasses.replace(self, expired=self.overdue(now))


def of_the_rig(identity: str) -> bool:
    """Whether an influence is of a table of the rig file, so that it is the same in every run."""
    return identity.partition("/")[0] in RIG_TABLES


def stands(influence: Influence, numbers: Mapping[str, Number]) -> bool:
    """Whether an influence is one of the rig file's `numbers`, by identity, whole and in whatever form, and the same in every
    run. What a run makes of a number (a part of its error, a bound where it is exact) is that run's own."""
    number = numbers.get(influence.id)
    return number is not None and not of_a_day(influence.id) and form(influence, number) is not None


def of_a_day(identity: str) -> bool:
    """Whether a number of the rig file is another one in every run, though it is stated once."""
    return identity in OF_A_DAY or identity.rpartition("/")[2] == WANDERS


def adopted(
    values: Mapping[str, Estimate],
    run_id: str,
    known: Collection[str] = (),
    numbers: Mapping[str, Number] | None = None,
) -> dict[str, Estimate]:
    """Values as facts: influences of this run alone get the identity `<run_id>/...` and say in their name whose they are.

    `known` are the identities that came with the calibrations that the run used: they keep theirs, and so do the `numbers` of
    the rig file, each in its own unit. A value that is not linear in its influences is kept with its linear part.
    """
    numbers = numbers or {}

    def renamed(influence: Influence) -> Influence:
        if of_the_rig(influence.id) or influence.id in known or stands(influence, numbers):
            return influence
        return dataclasses.replace(influence, id=f"{run_id}/{influence.id}", name=f"{influence.name} [{run_id}]")

    told = {name: by_numbers(e, numbers) for name, e in values.items()}
    return {
        name: Estimate(e.value, e.unit, {renamed(i): c for i, c in e.sensitivities.items() if c * i.u != 0})
        for name, e in told.items()
    }


def certificate(rig: RigFile, identity: str) -> Certificate | None:
    """What the rig file says of an influence; None if it says nothing."""
    table, _, rest = identity.partition("/")
    name, _, part = rest.partition("/")
    found: Any = None
    if table == "site":
        found = getattr(rig.site, name, None)
    elif table == "masses" and name in ("density", "hanger"):
        found = rig.mass_density if name == "density" else rig.hanger
    elif table == "hook":
        found = rig.hook_seat
    elif table == "sensors":
        found = getattr(rig.sensors.get(name), part, None)
    elif table in ("geometry", "masses", "machine"):
        found = (getattr(rig, table, None) or {}).get(name)
    else:
        found = certified_numbers(rig).get(identity)
    if not isinstance(found, Toleranced):
        return None
    return Certificate(found.value, found.standard_uncertainty, found.unit, found.distribution, found.source)


def certificates_of(rig: RigFile, identities: Iterable[str]) -> dict[str, Certificate]:
    """The rig file's certificates of those of the influences that it has."""
    found = {i: certificate(rig, i) for i in sorted(set(identities))}
    return {i: c for i, c in found.items() if c is not None}


def changed_certificates(stored: Mapping[str, Certificate], rig: RigFile) -> list[str]:
    """What the rig file says otherwise today, one line for each influence."""
    lines = []
    for identity, then in stored.items():
        now = certificate(rig, identity)
        if now is None:
            lines.append(f"{identity}: was {then}; the rig file has none any more")
        elif not then.same_as(now):
            lines.append(f"{identity}: was {then}; is {now}")
    return lines


def settings_differ(found: Mapping[str, float], needed: Mapping[str, float]) -> list[str]:
    """Settings that a calibration was not made at, one line for each."""
    lines = []
    for name, value in needed.items():
        if name not in found:
            lines.append(f"{name}: not stated; {number(value)} is needed")
        elif not math.isclose(found[name], value, rel_tol=1e-9, abs_tol=1e-15):
            lines.append(f"{name} = {number(found[name])}; {number(value)} is needed")
    return lines


def number(value: float) -> str:
    """A setting as it is typed: a whole number without a point."""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
