"""Procedures as tests of one machine: each is run with what it needs, and a calibration that is missing is made first.

What is made here goes to a store of its own, which begins as a copy of the rig's: the rig's is left as it is.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from bench.calibration import Need, settings_differ
from bench.calibration.store import Store, machine
from bench.cli.adopt import adopt
from bench.cli.compose import Request, assignments_of, planned
from bench.cli.loading import known, load_procedure
from bench.cli.run import execute
from bench.errors import BenchError, ConfigError
from bench.procedure import Procedure
from bench.procedure.plans import assignment, field_of
from bench.record.records import Measurement
from bench.rigfile import load_rig
from bench.run.runner import RunResult


class NotCalibrated(BenchError):
    """What a procedure needs could not be measured on this machine."""


@dataclass
class Suite:
    """One machine, as `asked` says (its procedure and plan apart), under test.

    `plans` are the assignments of the command line, `folder` takes the calibrations that are made; with `adopting` those go
    to the rig's own store too. `results` are the runs so far by procedure: the last of each.
    """

    asked: Request
    folder: Path
    plans: Sequence[str] = ()
    adopting: bool = False
    results: dict[str, RunResult] = field(default_factory=dict)
    _seed: int | None = field(init=False)
    _of: dict[str, tuple[str, ...]] = field(init=False)

    def __post_init__(self) -> None:
        """Raises ConfigError: the rig file, or an assignment that suits no procedure."""
        rig = load_rig(self.asked.rig)
        self._seed = None if self.asked.backend == "live" else self.asked.seed or 0
        self._of = by_procedure(self.plans, self.asked.rig)
        known = Store.of(rig, self._seed, self.asked.calibrations).folder
        if known.is_dir():
            shutil.copytree(known, self.folder / machine(self._seed), dirs_exist_ok=True)

    @property
    def seed(self) -> int | None:
        """The seed in force; None for a real rig."""
        return self._seed

    @property
    def visit(self) -> int | None:
        """The visit in force; None for a real rig."""
        return None if self._seed is None else self.asked.visit or 0

    def lacking(self, procedure: str) -> tuple[str, ...]:
        """What the rig lacks to run a procedure at all; nothing where it can."""
        return load_procedure(procedure).lacking(load_rig(self.asked.rig))

    def run(self, procedure: str) -> RunResult:
        """Run a procedure, and before it what it needs and nobody has calibrated yet.

        Raises:
            ConfigError: the plan, or a calibration in the rig's store that does not fit; it was not started.
            NotCalibrated: what it needs ended neither PASS nor DONE; it was not started.
        """
        return self._run(self._request(procedure), with_faults=True)

    def made_for(self, procedure: str) -> dict[str, Path]:
        """Runs of this session that a procedure's run rests on, by procedure."""
        used = {c.run_id for c in self.results[procedure].record.calibrations}
        return {name: r.directory for name, r in self.results.items() if r.record.run_id in used}

    def _request(self, procedure: str, settings: Sequence[str] = ()) -> Request:
        plan = (*self._of.get(procedure, ()), *settings)
        return replace(self.asked, procedure=procedure, plan=plan, calibrations=self.folder)

    def _run(self, request: Request, with_faults: bool = False) -> RunResult:
        procedure, _, plan = planned(request)
        for need in procedure.needs(plan):
            self._meet(procedure.name, need)
        result = execute(request if with_faults else replace(request, faults=()))
        self.results[procedure.name] = result
        if self.adopting and result.outcome.sound:
            for folder in (self.asked.calibrations, self.folder):
                adopt(result.directory, self.asked.rig, folder)
        return result

    def _meet(self, procedure: str, need: Need) -> None:
        """See that the store holds what is needed, by a run of this session if nobody has calibrated it before."""
        ran = self.results.get(need.procedure)
        if ran is not None and not ran.outcome.sound and not need.optional:
            raise _not_calibrated(procedure, need.procedure, ran)
        known = Store.of(load_rig(self.asked.rig), self._seed, self.folder).current(need.procedure)
        own = known is None or known.run_id in (r.record.run_id for r in self.results.values())
        if not own or (known is not None and not settings_differ(known.settings, need.settings)):
            return
        if known is None and ran is not None and ran.outcome.sound and self._fits(need):
            adopt(ran.directory, self.asked.rig, self.folder)
        elif not need.optional:
            self._make(procedure, need)

    def _fits(self, need: Need) -> bool:
        """Whether the run of this session was made at the settings that are needed."""
        done, _, plan = planned(self._request(need.procedure))
        return not settings_differ(done.holds_for(plan), need.settings)

    def _make(self, procedure: str, need: Need) -> None:
        result = self._run(self._request(need.procedure, assignments_of(need)))
        if not result.outcome.sound:
            raise _not_calibrated(procedure, need.procedure, result)
        if not self.adopting:
            adopt(result.directory, self.asked.rig, self.folder)


def _not_calibrated(procedure: str, needed: str, result: RunResult) -> NotCalibrated:
    return NotCalibrated(
        f"{procedure} needs {needed}, which ended {result.outcome}: {result.reason}; it was not started\n{result.directory}"
    )


def by_procedure(assignments: Sequence[str], rig: str) -> dict[str, tuple[str, ...]]:
    """Assignments of plans, by procedure: `PROCEDURE:KEY=VALUE` is for that one, `KEY=VALUE` for each that the rig can run
    and that has the key.

    Raises:
        ConfigError: no such procedure, or a key that none has.
    """
    found: dict[str, tuple[str, ...]] = {}
    able: dict[str, Procedure] = {}
    for text in assignments:
        name, colon, rest = text.partition(":")
        given = name if colon and "=" not in name else ""
        setting = rest if given else text
        key, _ = assignment(setting)
        if not given and not able:
            able = {p.name: p for p in known() if not p.lacking(load_rig(rig))}
        procedures = {given: load_procedure(given)} if given else able
        suited = [n for n, p in procedures.items() if _has(key, tuple(p.plan.model_fields))]
        if not suited:
            whose = f"of {given}" if given else f"of a procedure that {rig} can run"
            raise ConfigError(f"--plan {text}: found {key}; expected a setting {whose}. Next: `bench list`")
        found |= {n: (*found.get(n, ()), setting) for n in suited}
    return found


def _has(key: str, fields: tuple[str, ...]) -> bool:
    try:
        field_of(key, fields)
    except ConfigError:
        return False
    return True


def properties(result: RunResult) -> list[tuple[str, str]]:
    """A run as named texts, each name once: of a quantity `name.value` and so on, with its place as `name@place.value`."""
    record = result.record
    named = [("run", str(result.directory)), ("outcome", result.outcome.value.lower())]
    named += [] if record.seed is None else [("seed", str(record.seed)), ("visit", str(record.visit))]
    if record.findings:
        named.append(("findings", ", ".join(dict.fromkeys(f.code for f in record.findings))))
    for m in record.measurements:
        at = f"{m.name}@{m.where}" if m.where else m.name
        named += [(f"{at}.{what}", str(value)) for what, value in _facts(m).items() if value not in (None, "")]
    return named


def _facts(m: Measurement) -> dict[str, object]:
    limit = m.limit
    return {
        "value": m.value, "expanded_uncertainty": m.expanded_uncertainty, "unit": m.unit, "where": m.where,
        "limit_low": limit and limit.low, "limit_high": limit and limit.high, "verdict": m.verdict.value,
    }  # fmt: skip
