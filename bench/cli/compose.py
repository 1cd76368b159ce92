"""The composition root: from names on the command line to a procedure, a rig file, a plan and an open rig.

The only module that knows every room. What is simulated is imported only when a simulated rig is opened, so that
stored runs are analysed without it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench import catalogue, faults, linkurl, plans
from bench.cli.opening import live, simulated
from bench.envelope import Envelope
from bench.errors import ConfigError
from bench.lock import rig_lock
from bench.opened import Connect, Job
from bench.procedure import Procedure
from bench.rigfile import RigFile, load_rig
from bench.specs import load_spec


@dataclass(frozen=True)
class Request:
    """A run as it was asked for."""

    procedure: str
    rig: str
    backend: str = "sim"
    seed: int | None = None
    plan: tuple[str, ...] = ()
    plan_file: Path | None = None
    truth: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    clear_fault: bool = False
    out: Path = Path("runs")
    operator: str | None = None
    report: bool = True


def load_procedure(name: str) -> Procedure:
    """The procedure of that name in the catalogue.

    Raises:
        ConfigError: there is none.
    """
    found: Procedure = importlib.import_module(catalogue.entry(name).module).procedure
    return found


def prepare(request: Request) -> tuple[Job, Connect]:
    """Everything that can be wrong before a machine is touched, found out.

    Raises:
        ConfigError: usage, rig file, plan or spec; every problem of the first of them that has one.
    """
    _refuse_mixed_backends(request)
    procedure = load_procedure(request.procedure)
    rig = with_links(load_rig(request.rig), request.links)
    defaults = (f"{rig.path} [plans.{procedure.name}]", rig.plans.get(procedure.name, {}))
    plan = plans.assemble(procedure.plan, defaults, request.plan_file, request.plan)
    problems = [*procedure.check(rig, plan), *Envelope(rig).problems_of(dict(procedure.settings(plan)))]
    if problems:
        raise ConfigError("\n  ".join(["the plan does not fit the rig; nothing was started:", *problems]))
    limits = load_spec(rig.name, procedure.name, [q.name for q in procedure.measures])
    injected = [faults.parse(text) for text in request.faults]
    if request.backend == "live":
        kind = request.operator or ("console" if sys.stdin.isatty() else "auto")
        job = Job(procedure, rig, plan, limits, "live", None, rig_lock(rig.link.url.partition("?")[0]))
        return job, live(rig, kind, injected, request.clear_fault)
    seed = 0 if request.seed is None else request.seed
    overrides = dict(plans.assignment(text) for text in request.truth)
    _refuse_words(overrides)
    connect = simulated(rig, seed, overrides, request.operator or "auto", procedure.settings(plan), injected)
    return Job(procedure, rig, plan, limits, request.backend, seed), connect


def _refuse_mixed_backends(request: Request) -> None:
    if request.backend == "live":
        given = [name for name, value in (("--truth", request.truth), ("--seed", request.seed is not None)) if value]
        if given:
            raise ConfigError(
                f"{' and '.join(given)}: a real rig has no seed and no truth to set; expected --backend sim, or none of these"
            )
    elif request.links:
        raise ConfigError("--link: the simulated rig runs in this process; expected --backend live, or leave it out")


def with_links(rig: RigFile, assignments: Sequence[str]) -> RigFile:
    """The rig with other link URLs: NAME=URL.

    Raises:
        ConfigError: no such link, or no such URL.
    """
    links = dict(rig.links)
    for text in assignments:
        name, equals, url = text.partition("=")
        if not equals or name not in links:
            raise ConfigError(f"--link {text}: expected NAME=URL with NAME one of {', '.join(links)}")
        try:
            parsed = linkurl.parse(url)
            if parsed.scheme in linkurl.TCP_SCHEMES:
                parsed.address  # noqa: B018 (raises when it is none)
        except ConfigError as error:
            raise ConfigError(f"--link {text}: {error}") from error
        links[name] = links[name].model_copy(update={"url": url})
    return rig.model_copy(update={"links": links})


def _refuse_words(overrides: Mapping[str, Any]) -> None:
    for key, value in overrides.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"--truth {key}: found {value!r}; expected a number, SI")
