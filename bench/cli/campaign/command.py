"""`bench campaign`: what was asked for, the directory it goes on in, and the exit status."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench import runlog
from bench.campaign import Campaign, Virtual
from bench.campaign import file as campaign_file
from bench.campaign.directory import CampaignDirectory, opened
from bench.cli.campaign.asked import Asked, CampaignRequest
from bench.cli.campaign.steps import Planned, planned
from bench.cli.campaign.tasks import RigTask, StepTask
from bench.cli.compose import with_links
from bench.cli.run import STATUS
from bench.errors import ConfigError
from bench.progress import Progress, shown_on
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome
from bench.rigfile import load_rig

ABORTED = STATUS[Outcome.ABORTED]
OF_VERDICT = {Verdict.PASS: 0, Verdict.FAIL: 1, Verdict.INDETERMINATE: 5}


def campaign_command(request: CampaignRequest) -> int:
    """Run or go on; the summary's directory is the last line on standard output.

    Raises:
        ConfigError: nothing was started.
    """
    asked = asked_for(request)
    directory, resumed = opened(request.out, asked.campaign.name, identity(asked), request.new)
    with directory.locked(), shown_on(sys.stderr) as progress, runlog.to_lines(progress.line):
        progress.stage(f"{'going on with' if resumed else 'campaign'} {directory.path}")
        directory.journal.repair()
        said, status = (_one if asked.campaign.virtual is None else _many)(asked, directory, progress)
    sys.stderr.write(said)
    sys.stdout.write(f"{directory.path}\n")
    return status


def asked_for(request: CampaignRequest) -> Asked:
    """The campaign file with the options over it, checked in full.

    Raises:
        ConfigError: with every problem of the first of file, options, rig file and plans that has one.
    """
    campaign, path = campaign_file.load(request.campaign)
    campaign = _with_options(campaign, request)
    rig = with_links(load_rig(campaign.rig), request.links)
    if request.short and campaign.backend == "live":
        raise ConfigError("--short: the short plans are for virtual rigs; leave it out with --backend live")
    short = request.short or campaign.virtual is not None
    return Asked(request, campaign, rig, planned(campaign, str(path), rig, short))


def _with_options(c: Campaign, r: CampaignRequest) -> Campaign:
    many = r.count is not None or r.first_seed is not None
    if many and r.seed is not None:
        raise ConfigError("--seed: one virtual rig; --count and --first-seed: many. Expected one or the other")
    changes: dict[str, Any] = {"virtual": _virtual(c, r), "seed": None} if many else {}
    if r.seed is not None:
        changes |= {"virtual": None, "seed": r.seed}
    if r.visit is not None:
        changes["visit"] = r.visit
    if r.backend == "live":
        if many or r.seed is not None or r.visit is not None or c.truth:
            raise ConfigError("--backend live: a real rig has no seed, no visit and no truth to set; leave these out")
        changes |= {"backend": "live", "seed": None, "visit": None, "virtual": None}
    if r.backend == "sim":
        changes["backend"] = "sim"
    if r.rig is not None:
        changes["rig"] = r.rig
    made = c.model_copy(update=changes)
    _refuse_scheduler(made, r)
    if made.backend == "live" and (r.seed is not None or r.visit is not None):
        given = "--seed" if r.visit is None else "--visit"
        raise ConfigError(f"{given}: a real rig has no seed and no visit; expected --backend sim, or leave it out")
    if many and made.backend == "live":
        raise ConfigError("--count: a real rig is one; expected --backend sim, or leave it out")
    if r.links and made.backend != "live":
        raise ConfigError("--link: simulated rigs run in this process; expected --backend live, or leave it out")
    return made


def _virtual(c: Campaign, r: CampaignRequest) -> Virtual:
    """Which virtual rigs: what is not asked for is the file's."""
    count = r.count if r.count is not None else c.virtual.count if c.virtual else None
    first = r.first_seed if r.first_seed is not None else c.virtual.first_seed if c.virtual else 0
    if count is None:
        raise ConfigError("--first-seed: found no number of rigs; expected --count too, or [virtual] in the file")
    return Virtual(first_seed=first, count=count)


def _refuse_scheduler(c: Campaign, r: CampaignRequest) -> None:
    if not r.scheduler:
        return
    if c.virtual is None:
        raise ConfigError("--scheduler: for many virtual rigs; expected --count, or [virtual] in the file")
    if r.jobs is not None:
        raise ConfigError("--jobs: the scheduler's workers are the processes; leave it out with --scheduler")
    if r.keep not in (None, "none"):
        raise ConfigError(f"--keep {r.keep}: recordings stay where they are made; expected none with --scheduler")


def identity(asked: Asked) -> dict[str, Any]:
    """What a campaign must be gone on with: all that decides its numbers. How many rigs may grow."""
    c = asked.campaign
    which: dict[str, Any] = {"seed": c.seed or 0} if c.backend == "sim" else {"links": list(asked.request.links)}
    which = {"first_seed": c.virtual.first_seed} if c.virtual else which
    which |= {"visit": c.visit or 0} if c.backend == "sim" else {}
    return {
        "schema": 2, "name": c.name, "rig": {"name": asked.rig.name, "sha256": asked.rig.digest},
        "backend": c.backend, **which, "truth": dict(c.truth),
        "steps": [
            {"procedure": s.procedure.name, "plan": s.plan.model_dump(mode="json"), "adopt": s.adopt,
             "judged": list(s.judged)}
            for s in asked.steps
        ],
    }  # fmt: skip


def _many(asked: Asked, directory: CampaignDirectory, progress: Progress) -> tuple[str, int]:
    from bench.cli.campaign import coverage
    from bench.cli.campaign.dask import workers_of
    from bench.cli.campaign.fleet import cores, pool, run_fleet, task_folder

    virtual = asked.campaign.virtual
    assert virtual is not None
    seeds = list(range(virtual.first_seed, virtual.first_seed + virtual.count))
    task = RigTask(
        rig=str(Path(asked.rig.path).resolve()), rig_sha256=asked.rig.digest, steps=step_tasks(asked.steps),
        truth=dict(asked.campaign.truth), keep=asked.request.keep or "missed", folder=str(task_folder(directory)),
        visit=asked.campaign.visit or 0,
    )  # fmt: skip
    scheduler, wanted = asked.request.scheduler, asked.request.jobs or cores()
    with workers_of(scheduler, asked.rig) if scheduler else pool(wanted) as (executor, jobs):
        stopped = run_fleet(directory, task, seeds, jobs, executor, progress)
    entries = [e for e in directory.journal.entries() if e["kind"] == "rig" and e["seed"] in set(seeds)]
    result = coverage.judged(asked.campaign, asked.steps, entries)
    progress.stage("summary")
    coverage.write(directory, asked, result, asked.request.report)
    if stopped:
        return result.text(), ABORTED
    directory.journal.append({"kind": "done"})
    return result.text(), OF_VERDICT[result.verdict]


def step_tasks(steps: Sequence[Planned]) -> tuple[StepTask, ...]:
    """The steps as plain data, for other processes."""
    return tuple(
        StepTask(
            s.procedure.name, s.plan.model_dump(), s.judged, s.adopt, tuple(dict.fromkeys(n.procedure for n in s.needs))
        )
        for s in steps
    )  # fmt: skip


def _one(asked: Asked, directory: CampaignDirectory, progress: Progress) -> tuple[str, int]:
    from bench.cli.campaign import chain, model

    done = chain.run_chain(asked, directory, progress)
    progress.stage("summary")
    model.write(directory, asked, done, asked.request.report)
    if all(d.passed for d in done):
        directory.journal.append({"kind": "done"})
    return chain.text(done), STATUS[chain.outcome_of(done)]
