"""The composition root: from names on the command line to a procedure, a rig file, a plan and an open rig.

The only module that knows every room. What is simulated is imported only when a simulated rig is opened, so that
stored runs are analysed without it.
"""

from __future__ import annotations

import difflib
import importlib
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from bench.calibration import Need, number
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store
from bench.cli.console import Asking, quietly
from bench.cli.loading import load_procedure
from bench.cli.opening import live, simulated
from bench.errors import ConfigError
from bench.link import fault_injection
from bench.lock import rig_lock
from bench.procedure import BenchPlan, Procedure, plans
from bench.record.specs import load_spec, misnamed
from bench.rigfile import RigFile, linkurl, load_rig
from bench.rigfile.envelope import Envelope
from bench.run.job import Connect, Job

NUMERICS = ("fft", "interpolate", "linalg", "ndimage", "optimize", "signal", "special")


@dataclass(frozen=True)
class Request:
    """A run as it was asked for."""

    procedure: str
    rig: str
    backend: str = "sim"
    seed: int | None = None
    visit: int | None = None
    plan: tuple[str, ...] = ()
    plan_file: Path | None = None
    truth: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    clear_fault: bool = False
    out: Path = Path("runs")
    operator: str | None = None
    report: bool = True
    calibrations: Path | None = None
    allow_expired: bool = False
    spec: Path | None = None
    require_verdict: bool = False


def planned(request: Request) -> tuple[Procedure, RigFile, BenchPlan]:
    """The procedure, the rig, and the plan, of which the rig can do what it asks.

    Raises:
        ConfigError: usage, rig file or plan; every problem of the first of them that has one.
    """
    _refuse_mixed_backends(request)
    procedure = load_procedure(request.procedure)
    rig = with_links(load_rig(request.rig), request.links)
    procedure = procedure.on(rig)
    if lacking := procedure.lacking(rig):
        raise ConfigError("\n  ".join([f"{rig.name} cannot run {procedure.name}; nothing was started:", *lacking]))
    defaults = (f"{rig.path} [plans.{procedure.name}]", rig.plans.get(procedure.name, {}))
    plan = plans.assemble(procedure.plan, defaults, request.plan_file, request.plan)
    problems = [*procedure.check(rig, plan), *Envelope(rig).problems_of(dict(procedure.settings(rig, plan)))]
    if problems:
        raise ConfigError("\n  ".join(["the plan does not fit the rig; nothing was started:", *problems]))
    return procedure, rig, plan


def prepare(request: Request, asking: Asking = quietly) -> tuple[Job, Connect]:
    """Everything that can be wrong before a machine is touched, found out. `asking` shows a question while a person answers it.

    Raises:
        ConfigError: usage, rig file, plan, spec or calibrations; every problem of the first of them that has one.
    """
    procedure, rig, plan = planned(request)
    if unknown := tuple(misnamed(rig.name, file=request.spec)):
        raise ConfigError("the spec cannot be used; nothing was started:", unknown)
    limits = load_spec(rig.name, procedure.name, procedure, file=request.spec, rig=rig)
    judged = request.require_verdict or request.spec is not None
    seed = None if request.backend == "live" else request.seed or 0
    lookup = Lookup(
        Store.of(rig, seed, request.calibrations),
        rig,
        datetime.now(UTC),
        partial(remedy, request),
        request.allow_expired,
    )
    used = lookup.found(procedure.name, procedure.needs(plan))
    procedure.refuse_by(rig, plan, used)
    injected = [fault_injection.parse(text) for text in request.faults]
    if seed is None:
        _load_numerics()
        kind = request.operator or ("console" if sys.stdin.isatty() else "auto")
        job = Job(procedure, rig, plan, limits, "live", None, rig_lock(rig.link.url.partition("?")[0]), used,
                  judged)  # fmt: skip
        return job, live(rig, kind, injected, request.clear_fault, asking)
    overrides = dict(plans.assignment(text) for text in request.truth)
    _refuse_words(overrides)
    visit = request.visit or 0
    connect = simulated(
        rig, seed, overrides, request.operator or "auto", procedure.settings(rig, plan), injected, asking, visit=visit
    )
    return Job(procedure, rig, plan, limits, request.backend, seed, None, used, judged, visit), connect


def _load_numerics() -> None:
    """Procedures import scipy where they compute. In a live run that would take up to a second while the machine moves, as
    long as the heartbeat's lease."""
    for name in NUMERICS:
        importlib.import_module(f"scipy.{name}")


def assignments_of(need: Need) -> list[str]:
    """What a plan of the needed procedure takes, KEY=VALUE, so that its calibration holds at the settings that are needed."""
    fields = load_procedure(need.procedure).plan.model_fields
    return [
        f"{name}={str(bool(value)).lower() if fields[name].annotation is bool else number(value)}"
        for name, value in need.settings.items()
        if name in fields
    ]


def remedy(request: Request, need: Need) -> str:
    """The command lines that make the calibration that a run lacks."""
    words = ["bench", "run", need.procedure, "--rig", request.rig]
    if request.backend == "live":
        words += ["--backend", "live"]
    which = (("--seed", request.seed), ("--visit", request.visit))
    words += [word for option, given in which if given is not None for word in (option, str(given))]
    more = (("--link", request.links), ("--truth", request.truth), ("--plan", assignments_of(need)))
    words += [word for option, values in more for value in values for word in (option, value)]
    where = [] if request.calibrations is None else ["--calibrations", str(request.calibrations)]
    run, adopt = shlex.join([*words, *where]), shlex.join(["bench", "adopt", "RUN", *where])
    return f"`{run}`, then `{adopt}` with the folder that it prints"


def _refuse_mixed_backends(request: Request) -> None:
    if request.backend == "live":
        asked = {"--truth": request.truth, "--seed": request.seed is not None, "--visit": request.visit is not None}
        if given := [name for name, value in asked.items() if value]:
            raise ConfigError(
                f"{' and '.join(given)}: a real rig has no seed, no visit and no truth to set; "
                "expected --backend sim, or none of these"
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
            close = difflib.get_close_matches(name, links, 1)
            hint = f". Did you mean {close[0]}?" if close and name not in links else ""
            raise ConfigError(f"--link {text}: expected NAME=URL with NAME one of {', '.join(links)}{hint}")
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
