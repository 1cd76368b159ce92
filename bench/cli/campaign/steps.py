"""The steps of a campaign against the procedures and the rig: whole plans, what is adopted, and every problem at once."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bench.calibration import Need, settings_differ
from bench.campaign import Campaign, Step
from bench.campaign.file import Equation
from bench.cli.loading import load_procedure
from bench.errors import ConfigError, Problem
from bench.procedure import BenchPlan, Procedure, plans
from bench.rigfile import RigFile
from bench.rigfile.aliases import by_names, names_meant
from bench.rigfile.envelope import Envelope


@dataclass(frozen=True)
class Planned:
    """A step that can be run. `assignments` are its plan as `bench run --plan` takes them."""

    number: int
    procedure: Procedure
    plan: BenchPlan
    assignments: tuple[str, ...]
    adopt: bool
    judged: tuple[str, ...]
    needs: tuple[Need, ...]


def planned(campaign: Campaign, path: str, rig: RigFile, short: bool) -> tuple[Planned, ...]:
    """The steps, ready to run; with their `virtual_plan` if `short`.

    Raises:
        ConfigError: with every plan that cannot be used, every quantity and equation that is not there, every need
            that no earlier step meets.
    """
    problems: list[Problem] = []
    found: list[Planned] = []
    for number, step in enumerate(campaign.step, 1):
        procedure = load_procedure(step.procedure).on(rig)
        try:
            plan, assignments = _plan(procedure, step, rig, short)
        except ConfigError as error:
            listed = error.problems or (Problem(path, "plan", "a plan", str(error)),)
            problems += [Problem(path, f"step.{number}.{p.key}", p.found, p.expected) for p in listed]
            continue
        problems += [
            Problem(path, f"step.{number}.plan", "a plan that does not fit the rig", text)
            for text in (
                *procedure.problems(rig, plan),
                *Envelope(rig).problems_of(dict(procedure.settings(rig, plan))),
            )
        ]
        names = tuple(q.name for q in procedure.measures)
        judged = names if step.judged is None else names_meant(rig.aliases, step.judged)
        problems += [
            Problem(path, f"step.{number}.judged", repr(name), f"one of {', '.join(names)}")
            for name in judged
            if name not in names
        ]
        before = {earlier.procedure.name for earlier in found}
        needs = tuple(n for n in procedure.needs(plan) if not n.optional or n.procedure in before)
        found.append(Planned(number, procedure, plan, assignments, bool(step.adopt), judged, needs))
    problems += _unmet(found, path)
    problems += _unknown_equations(by_names(rig.aliases, campaign.equations), len(campaign.step), found, path)
    if problems:
        raise ConfigError(f"campaign {campaign.name} cannot be run; nothing was started:", tuple(problems))
    return tuple(_adopting(found, campaign))


def _plan(procedure: Procedure, step: Step, rig: RigFile, short: bool) -> tuple[BenchPlan, tuple[str, ...]]:
    tables = [step.plan, step.virtual_plan] if short else [step.plan]
    assignments = tuple(f"{key}={_literal(value)}" for table in tables for key, value in table.items())
    return plans.assemble(procedure.plan, procedure.defaults(rig), None, assignments), assignments


def _literal(value: Any) -> str:
    """A TOML value as TOML text.

    Raises:
        ConfigError: a date, which no plan has.
    """
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {_literal(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_literal, value)) + "]"
    try:
        return json.dumps(value)
    except TypeError:
        raise ConfigError(f"found {value!r}; expected a number, a string, true, false, a list or a table") from None


def _unmet(steps: list[Planned], path: str) -> Iterator[Problem]:
    """Needs that no earlier step meets, or only at other settings."""
    before: dict[str, Planned] = {}
    for step in steps:
        for need in step.needs:
            key, found = f"step.{step.number}.procedure", f"{step.procedure.name}, which needs {need.procedure}"
            source = before.get(need.procedure)
            if source is None:
                yield Problem(path, key, found, f"a [[step]] with {need.procedure} before it")
                continue
            for text in settings_differ(source.procedure.holds_for(source.plan), need.settings):
                yield Problem(path, key, f"{found} at other settings than step {source.number} has", text)
        before[step.procedure.name] = step


def _unknown_equations(
    equations: Mapping[str, Equation], count: int, steps: list[Planned], path: str
) -> Iterator[Problem]:
    known = {q.name for s in steps for q in s.procedure.measures}
    for name in equations:
        if name not in known and len(steps) == count:
            yield Problem(path, f"equations.{name}", "one", f"a quantity of the steps: {', '.join(sorted(known))}")


def _adopting(steps: list[Planned], campaign: Campaign) -> Iterator[Planned]:
    """A step whose `adopt` is not given is adopted if a later one needs it."""
    for step, given in zip(steps, campaign.step, strict=True):
        needed = any(step.procedure.name == need.procedure for later in steps[step.number :] for need in later.needs)
        adopt = needed if given.adopt is None else given.adopt
        yield Planned(step.number, step.procedure, step.plan, step.assignments, adopt, step.judged, step.needs)
