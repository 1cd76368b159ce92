"""What a rig can run: each procedure against the rig file, its default plan and its acceptance limits."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial

from bench import catalogue
from bench.cli.broken import forgiven
from bench.cli.loading import beside, load_procedure, of_entry, requires_of
from bench.cli.unfit import unfit
from bench.errors import ConfigError, Lacking, Problem
from bench.procedure import BenchPlan, Procedure
from bench.procedure.plans import assemble
from bench.procedure.requires import lacking
from bench.record.specs import limited, load_spec
from bench.rigfile import RigFile

WIDTH = 80
UNTOLD = "it cannot be told until the problems of the rig file are mended"
NAMED = 3  # names of a table, where all procedures are listed


@dataclass(frozen=True)
class Ability:
    """A procedure on a rig: `lacking` is what the rig has not, `unfit` what its default plan asks too much of; `problems` are
    wrong entries of the rig file and of the spec."""

    procedure: str
    lacking: tuple[str, ...] = ()
    unfit: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def able(self) -> bool:
        return not self.lacking and not self.unfit and not self.problems


def abilities(rig: RigFile, only: str = "", *, wrong: bool = False) -> list[Ability]:
    """Of every procedure of the catalogue, or of one, by its name or its file. Where all are asked for, one of a package that
    cannot be used is told like one that the rig cannot run. `wrong`: problems of the rig file are told already, and what a
    procedure trips over follows from them.

    Raises:
        ConfigError: there is no such procedure, or the one that is asked for cannot be used.
    """
    if only:
        asked = load_procedure(only)
        return [_as_far(wrong, asked.name, partial(_ability, rig, asked))]
    twice, stated = dict(catalogue.taken_twice()), _stated(rig)
    entries = [entry for entry in catalogue.procedures() if entry.name not in twice]
    able = [_as_far(wrong, entry.name, partial(_of_entry, rig, entry, stated)) for entry in entries]
    return [*able, *(Ability(name, unfit=(why,)) for name, why in twice.items())]


def _as_far(wrong: bool, procedure: str, look: Callable[[], Ability]) -> Ability:
    with forgiven(wrong):
        return look()
    return Ability(procedure, unfit=(UNTOLD,))


def _of_entry(rig: RigFile, entry: catalogue.Entry, stated: Collection[str]) -> Ability:
    if entry.point is None:
        missing = lacking(requires_of(entry), rig)
        return Ability(entry.name, missing) if missing and entry.name not in stated else _ability(rig, of_entry(entry))
    try:
        return _ability(rig, of_entry(entry))
    except ConfigError as error:
        return Ability(entry.name, unfit=(str(error),))


def _stated(rig: RigFile) -> Collection[str]:
    """Procedures of which the rig file or its limits say something: that is held against the procedure itself."""
    try:
        return {*rig.plans, *limited(rig.name)}
    except ConfigError:  # that each of them tells
        return {entry.name for entry in catalogue.procedures()}


def _ability(rig: RigFile, procedure: Procedure) -> Ability:
    lacking = procedure.lacking(rig)
    problems: list[Problem] = []
    plan: BenchPlan | None = None
    try:
        if not lacking or procedure.name in rig.plans:
            plan = assemble(procedure.plan, procedure.defaults(rig))
    except ConfigError as error:
        problems += error.problems or (Problem(rig.path, f"plans.{procedure.name}", str(error), "a plan"),)
    try:
        load_spec(rig.name, procedure.name, procedure, rig=rig)
    except ConfigError as error:
        problems += error.problems or (Problem("specs", f"limits.{procedure.name}", str(error), "limits"),)
    if plan is None or lacking:
        return Ability(procedure.name, lacking, problems=tuple(problems))
    try:
        too_much = tuple(unfit(procedure, rig, plan))
    except Lacking as error:  # a part whose place nobody can tell, which `bench check` names by itself
        return Ability(procedure.name, error.lines, problems=tuple(problems))
    return Ability(procedure.name, unfit=too_much, problems=tuple(problems))


def unknown_plans(rig: RigFile) -> Iterator[Problem]:
    """Tables of default plans that are no procedure's, of the catalogue or in a file beside the rig's."""
    names = [*(entry.name for entry in catalogue.procedures()), *(name for _, name in beside(rig))]
    for name in rig.plans:
        if name not in names:
            close = difflib.get_close_matches(name, names, 1)
            hint = f", such as {close[0]}" if close else ""
            yield Problem(rig.path, f"plans.{name}", name, f"the name of a procedure{hint}")


def told(found: list[Ability], rig: str) -> str:
    """What the rig can run and what it cannot and why, in short, as lines of at most 80 columns."""
    able = [a.procedure for a in found if a.able]
    lines = textwrap.wrap(f"can run: {', '.join(able) or 'nothing'}", WIDTH, subsequent_indent="  ",
                          break_on_hyphens=False)  # fmt: skip
    unable = [a for a in found if not a.able]
    lines += ["cannot run:"] if unable else []
    reasons: dict[str, list[str]] = {}
    for a in unable:
        reasons.setdefault(_why(a), []).append(a.procedure)
    for why, names in reasons.items():
        lines += textwrap.wrap(f"{', '.join(names)}: {why}", WIDTH, initial_indent="  ",
                               subsequent_indent="    ", break_on_hyphens=False)  # fmt: skip
    if any(a.lacking for a in unable):
        lines.append(f"all that a procedure lacks: `bench check {rig} PROCEDURE`")
    return "\n".join(lines) + "\n"


def listed(found: list[Ability], rig: str) -> str:
    """Each procedure with yes or what is missing, as lines of at most 80 columns."""
    wide = max(len(a.procedure) for a in found)
    lines = []
    for a in found:
        said = "yes" if a.able else f"no: {_why(a)}"
        lines += textwrap.wrap(said, WIDTH, initial_indent=f"  {a.procedure:{wide}}  ",
                               subsequent_indent=" " * (wide + 8), break_on_hyphens=False)  # fmt: skip
    if any(a.lacking for a in found):
        lines.append(f"all that a procedure lacks: `bench check {rig} PROCEDURE`")
    return "\n".join(lines) + "\n"


def _why(a: Ability) -> str:
    return "; ".join([*_short(a.lacking), *a.unfit, *(str(p) for p in a.problems)])


def _short(lacking: tuple[str, ...]) -> tuple[str, ...]:
    """The first line with its first names, and the tables of the others."""
    if not lacking:
        return ()
    names = lacking[0].split(", ")
    some = ", ".join(names) if len(names) <= NAMED + 1 else f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    first = lacking[0].partition(":")[0]
    others = [table for table in dict.fromkeys(line.partition(":")[0] for line in lacking[1:]) if table != first]
    return (f"{some}; also {', '.join(others)}" if others else some,)
