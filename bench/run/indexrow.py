"""Rows of the index of runs: tuples with names, as they are read by the hundred thousand."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple


class IndexEntry(NamedTuple):
    """One run, as `bench runs` lists it; `uut` is the machine's serial number, else its model."""

    run_id: str
    procedure: str
    rig: str
    outcome: str
    started: str
    ended: str | None
    seed: int | None
    visit: int | None
    served: bool  # live, on a controller that says that it is a simulated one
    uut: str


class MadeWith(NamedTuple):
    """What a run was made with, as `Result` has it."""

    settings: str
    parameters: str
    firmware: str
    calibrations: str


class Row(NamedTuple):
    """A run as its record goes into the tables. Of each result what it is called (name, that by kind and place, kind, place,
    unit) and its numbers (value, u, U, dof, coverage probability, limits, verdict, digest of its certificates)."""

    entry: IndexEntry
    made_with: MadeWith
    results: list[tuple[tuple[str, ...], tuple[float | str | None, ...]]]


class Result(NamedTuple):
    """One measured quantity of one run. `name` is that of the record, with its place where that is not in it (`K_i`, or
    `K@inboard` on a rig without an own name); `quantity` and `where` are kind and place.

    Value, u, U and the limits are in `unit`; None is missing, an infinite dof, or an open limit. `settings` is a digest of the
    plan, `parameters` of those of the controller (bias currents, gains), `certificates` of what the rig file says of the
    numbers that this result rests on, `calibrations` of the runs adopted that it used; `firmware` is a text.
    Each is "" where the record does not say it.
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
    root: Path

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
