"""The composition root: from names on the command line to a procedure, a rig file, a plan and an open rig.

The only module that knows every room. What is simulated is imported only when a simulated rig is opened, so that
stored runs are analysed without it.
"""

from __future__ import annotations

import difflib
import importlib
import pkgutil
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

from bench.calibration import Calibration, Need, number
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store
from bench.cli import continuing
from bench.cli.console import Asking, quietly
from bench.cli.loading import load_procedure
from bench.cli.opening import live, simulated
from bench.cli.request import Request
from bench.cli.unfit import unfit
from bench.errors import ConfigError
from bench.link import fault_injection
from bench.lock import rig_lock
from bench.procedure import BenchPlan, Procedure, plans
from bench.record.specs import load_spec, misnamed
from bench.recording.earlier import Earlier
from bench.rigfile import RigFile, linkurl, load_rig
from bench.run import stopped
from bench.run.adoption import due
from bench.run.job import Connect, Job

__all__ = ["Request", "planned", "prepare", "simulated", "with_links"]
NUMERICS = ("fft", "interpolate", "linalg", "ndimage", "optimize", "signal", "special")


def planned(request: Request, earlier: Earlier | None = None) -> tuple[Procedure, RigFile, BenchPlan]:
    """The procedure, the rig, and the plan, of which the rig can do what it asks; rig and plan of a stopped run, if it is
    one that goes on.

    Raises:
        ConfigError: usage, rig file or plan; every problem of the first of them that has one.
    """
    if not (request.procedure and request.rig):
        raise ConfigError(
            "bench run: expected PROCEDURE and --rig RIG, or --continue RUN. Next: `bench list` shows both"
        )
    _refuse_mixed_backends(request)
    procedure = load_procedure(request.procedure)
    rig = with_links(load_rig(request.rig), request.links)
    if earlier is not None:
        stopped.require_same_rig(earlier.recording, rig)
    procedure = procedure.on(rig)
    if lacking := procedure.lacking(rig):
        raise ConfigError("\n  ".join([f"{rig.name} cannot run {procedure.name}; nothing was started:", *lacking]))
    if earlier is None or request.plan or request.plan_file is not None:
        plan = plans.assemble(procedure.plan, procedure.defaults(rig), request.plan_file, request.plan)
    else:
        plan = earlier.recording.plan_as(procedure.plan)
    if earlier is not None:
        stopped.require_same_plan(earlier.recording, plan.model_dump(mode="json"))
    problems = list(unfit(procedure, rig, plan))
    if problems:
        raise ConfigError("\n  ".join(["the plan does not fit the rig; nothing was started:", *problems]))
    return procedure, rig, plan


def prepare(request: Request, asking: Asking = quietly) -> tuple[Job, Connect]:
    """Everything that can be wrong before a machine is touched, found out. `asking` shows a question while a person answers it.

    Raises:
        ConfigError: usage, rig file, plan, spec or calibrations; every problem of the first of them that has one.
    """
    if request.continues is not None:
        return _going_on(*continuing.resolved(request, request.continues), asking)
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
        of_model(request, rig, seed, procedure.needs(plan)),
    )
    used = lookup.found(procedure.name, procedure.needs(plan))
    procedure.refuse_by(rig, plan, used)
    return _job(request, Job(procedure, rig, plan, limits, request.backend, seed, None, used, judged), asking)


def of_model(request: Request, rig: RigFile, seed: int | None, needs: Sequence[Need]) -> dict[str, Calibration]:
    """What the model of `--model` has of that which the controller is told, by procedure.

    Raises:
        ConfigError: no model, of another machine or rig file, or without that; or the plan has the controller told nothing.
    """
    from bench.campaign import told as campaign_told

    path, told = request.model, [n.procedure for n in needs if n.told]
    if path is None:
        return {}
    if not told:
        raise ConfigError(
            f"--model {path}: with this plan {request.procedure} tells the controller nothing of it. Next: a procedure and a "
            "plan that do, such as `bench run decoupling --plan 'model=\"inductance-map\"'`"
        )
    model, sha256 = campaign_told.read(path)
    found = {name: campaign_told.calibration(model, name, sha256) for name in told}
    problems = campaign_told.refusals(model, rig, seed) or [
        f"found no constants by {name}; expected those that the controller is to be told"
        for name, c in found.items() if c is None
    ]  # fmt: skip
    if problems:
        raise ConfigError("\n  ".join([f"--model {path} cannot be used; nothing was started:", *problems]))
    return {name: replace(c, due=due(rig, name, datetime.fromisoformat(c.date))) for name, c in found.items() if c}


def _going_on(request: Request, earlier: Earlier, asking: Asking) -> tuple[Job, Connect]:
    """As `prepare`, for a run that goes on with what a stopped one left."""
    procedure, rig, plan = planned(request, earlier)
    limits, used, judged = continuing.as_stored(earlier)
    job = Job(procedure, rig, plan, limits, request.backend, request.seed, None, used, judged, earlier=earlier)
    return _job(request, job, asking)


def _job(request: Request, job: Job, asking: Asking) -> tuple[Job, Connect]:
    """The job with its lock, and how its rig is opened."""
    rig, injected = job.rig, [fault_injection.parse(text) for text in request.faults]
    if job.procedure.continues:
        job = replace(job, asked=continuing.asked(request, rig))
    if job.seed is None:
        load_all_of(job.procedure)
        kind = request.operator or ("console" if sys.stdin.isatty() else "auto")
        job = replace(job, lock=rig_lock(rig.link.url.partition("?")[0]))
        return job, live(rig, kind, injected, request.clear_fault, asking)
    overrides = dict(plans.assignment(text) for text in request.truth)
    _refuse_words(overrides)
    visit = request.visit or 0
    settings = job.procedure.settings(rig, job.plan)
    again = {} if job.earlier is None else {
        "stretch": job.earlier.stretch, "start_ns": continuing.switched_on_ns(job.earlier)}  # fmt: skip
    connect = simulated(
        rig, job.seed, overrides, request.operator or "auto", settings, injected, asking, visit=visit, **again
    )
    return replace(job, visit=visit), connect


def load_all_of(procedure: Procedure) -> None:
    """Procedures import what evaluates where they evaluate, and scipy where they compute. In a live run that would take up to a
    second while the machine moves, as long as the heartbeat's lease."""
    for name in NUMERICS:
        importlib.import_module(f"scipy.{name}")
    room = procedure.plan.__module__.rpartition(".")[0]
    if room.startswith("procedures."):  # what somebody else's package has beside its procedure is not known
        for module in pkgutil.iter_modules(importlib.import_module(room).__path__, f"{room}."):
            importlib.import_module(module.name)


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
