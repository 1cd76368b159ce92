"""Rows of the index of runs, tuples with names, as they are read by the hundred thousand; and its tables."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

MachineKind = Literal["real", "served", "simulated"]
"""What was measured: a machine, its twin that is served in real time, or a virtual one of a seed."""


def machine_kind(seed: int | None, served: bool) -> MachineKind:
    """By what a record says of its run."""
    return "simulated" if seed is not None else "served" if served else "real"


class Kind(NamedTuple):
    """What many runs have in common, as the index keeps it once. `served`: live, on a controller that says that it is a
    simulated one; `uut` is the machine's serial number, else its model."""

    procedure: str
    rig: str
    outcome: str
    seed: int | None
    visit: int | None
    served: bool
    uut: str

    @property
    def machine(self) -> MachineKind:
        """Real, served or simulated."""
        return machine_kind(self.seed, self.served)


class IndexEntry(NamedTuple):
    """One run, as `bench runs` lists it, with what it has of its `Kind`."""

    run_id: str
    procedure: str
    rig: str
    outcome: str
    started: str
    ended: str | None
    seed: int | None
    visit: int | None
    served: bool
    uut: str

    @property
    def machine(self) -> MachineKind:
        """Real, served or simulated."""
        return machine_kind(self.seed, self.served)

    @property
    def kind(self) -> Kind:
        """What other runs may have in common with it."""
        return Kind(self.procedure, self.rig, self.outcome, self.seed, self.visit, self.served, self.uut)


class MadeWith(NamedTuple):
    """What a run was made with, as `Result` has it."""

    settings: str
    parameters: str
    firmware: str
    calibrations: str


class Row(NamedTuple):
    """A run as its record goes into the tables. Of each result what it is called (name, that by kind and place, kind, place,
    unit) and the rest of its row (as text, as JSON, digest of its certificates, those that were overdue)."""

    entry: IndexEntry
    made_with: MadeWith
    results: list[tuple[tuple[str, ...], tuple[str | None, ...]]]


class Result(NamedTuple):
    """One measured quantity of one run. `name` is that of the record, with its place where that is not in it (`K_i`, or
    `K@inboard` on a rig without an own name); `quantity` and `where` are kind and place.

    Value, u, U and the limits are in `unit`; None is missing, an infinite dof, or an open limit. `settings` is a digest of the
    plan, `parameters` of those of the controller (bias currents, gains), `certificates` of what the rig file says of the
    numbers that this result rests on, `calibrations` of the runs adopted that it used; `firmware` is a text.
    Each is "" where the record does not say it. `overdue` are the keys of the certificates that it rests on and that were past
    their due dates on the day of the run, with commas between; None where the record does not say it.
    """

    run_id: str
    procedure: str
    rig: str
    uut: str
    started: str
    seed: int | None
    visit: int | None
    outcome: str
    name: str
    quantity: str
    where: str
    unit: str
    value: float | None
    u: float | None
    U: float | None
    dof: float | None
    p: float
    lower: float | None
    upper: float | None
    verdict: str
    settings: str
    firmware: str
    calibrations: str
    parameters: str
    certificates: str
    served: bool
    overdue: str | None
    root: Path

    @property
    def machine(self) -> MachineKind:
        """Real, served or simulated."""
        return machine_kind(self.seed, self.served)

    @property
    def path(self) -> Path:
        """The run directory."""
        return self.root / self.run_id

    def changed(self, before: Result) -> tuple[str, ...]:
        """What makes another series of measurements of it than `before` was: none of them is drawn as one line. What one of the
        two does not say is taken as it was."""
        both = {
            "plan": (self.settings, before.settings),
            "parameters": (self.parameters, before.parameters),
            "firmware": (self.firmware, before.firmware),
            "certificates": (self.certificates, before.certificates),
        }
        found = [name for name, (now, then) in both.items() if now and then and now != then]
        return (*found, *(("calibrations",) if self.calibrations != before.calibrations else ()))

    def filled(self, before: Result) -> Result:
        """With what it does not say of how it was made as `before` has it."""
        silent = {
            name: getattr(before, name)
            for name in ("parameters", "firmware", "certificates")
            if not getattr(self, name)
        }
        return self._replace(**silent) if silent else self


RUN_COLUMNS = ", ".join(IndexEntry._fields)
NUMBERS = (
    "value",
    "standard_uncertainty",
    "expanded_uncertainty",
    "dof",
    "coverage_probability",
    "low",
    "high",
    "verdict",
)
"""Of a `Result`, in its order, by their keys in JSON."""
KIND = ", ".join(Kind._fields)
MADE = ", ".join(MadeWith._fields)
CALLED = "name, full, quantity, place, unit"
TABLES = f"""
    CREATE TABLE runs (run INTEGER PRIMARY KEY, run_id, started, ended, kind INTEGER, made INTEGER, UNIQUE (run_id));
    CREATE TABLE kinds (kind INTEGER PRIMARY KEY, {KIND}, UNIQUE ({KIND}));
    CREATE TABLE made_with (made INTEGER PRIMARY KEY, {MADE}, UNIQUE ({MADE}));
    CREATE INDEX runs_by_time ON runs (started, run_id, kind, ended);
    CREATE TABLE names (number INTEGER PRIMARY KEY, {CALLED}, UNIQUE ({CALLED}));
    CREATE TABLE results (number INTEGER, run INTEGER, ordinal INTEGER, told, data, certificates, overdue,
                          PRIMARY KEY (number, run, ordinal)) WITHOUT ROWID;
    CREATE INDEX results_by_run ON results (run);
"""
"""Results lie together by name, and refer to runs by number; runs refer to what many have in common: so a series or a listing
of very many is read in a fraction of a second. A result is kept as it is shown: `told` as text, `data` as JSON with all its
numbers to the last bit. To round and write those of 10^5 results takes a second, to read what was written a tenth of one."""
