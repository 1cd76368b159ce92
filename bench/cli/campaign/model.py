"""The model that a campaign on one rig ends in: `model.json`, and the summary."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any

from bench.campaign import model as campaign_model
from bench.campaign.directory import CampaignDirectory
from bench.campaign.model import Model, Source
from bench.cli.campaign.chain import Done, outcome_of
from bench.errors import BenchError
from bench.figures import Figure
from bench.record.records import Record, read_record
from bench.recording import Recording
from bench.rigfile.aliases import by_names
from bench.rigfile.toleranced import Toleranced
from bench.run import provenance
from bench.rundir import RunDirectory
from bench.wholefile import write_whole

if TYPE_CHECKING:
    from bench.cli.campaign.asked import Asked

FIGURES = 2  # of each run, its first ones


def write(directory: CampaignDirectory, asked: Asked, done: Sequence[Done], report: bool) -> None:
    """`model.json`, and the summary if wanted.

    Raises:
        BenchError: a record cannot be read, or a file cannot be made.
    """
    records = [(d, read_record(directory.path / d.run / "record.json")) for d in done if d.run]
    sources = [
        Source(r, {q.name: q.about for q in d.step.procedure.measures}, d.step.procedure.holds_for(d.step.plan))
        for d, r in records
        if d.passed
    ]
    model = _model(asked, sources, [r for _, r in records], done)
    text = json.dumps(campaign_model.to_content(model), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(directory.model, text)
    if report:
        _summary(directory, asked, model, done, {d.step.number: r for d, r in records})


def _model(asked: Asked, sources: Sequence[Source], records: Sequence[Record], done: Sequence[Done]) -> Model:
    c, rig = asked.campaign, asked.rig
    tables: dict[str, Toleranced] = dict(c.given)
    for name in ("geometry", "machine"):
        tables |= {f"{name}.{key}": value for key, value in (getattr(rig, name, None) or {}).items()}
    told = any(f.code == "simulated-controller" for r in records for f in r.findings)
    seed, visit = (c.seed or 0, c.visit or 0) if c.backend == "sim" else (None, None)
    return Model(
        schema=1, name=c.name, title=c.title, rig=rig.name, uut=rig.uut.model_dump(), rig_sha256=rig.digest,
        simulated=c.backend == "sim" or told, seed=seed, visit=visit, created=provenance.now(),
        complete=len(done) == len(asked.steps) and all(d.passed for d in done),
        constants=campaign_model.constants_of(sources, by_names(rig.aliases, c.equations)),
        correlations=campaign_model.correlations_of(sources), given=campaign_model.given(tables),
    )  # fmt: skip


def _summary(
    directory: CampaignDirectory, asked: Asked, model: Model, done: Sequence[Done], records: dict[int, Record]
) -> None:  # fmt: skip
    from reports import campaign as summary
    from reports import campaign_model as page

    shares = {
        campaign_model.label(m): campaign_model.shares_by_kind(m)
        for r in records.values()
        for m in r.measurements
        if m.value is not None
    }
    content = page.ChainContent(
        campaign=directory.path.name, file=asked.request.campaign, model=model, outcome=outcome_of(done).value,
        steps=tuple(_line(directory, d, records.get(d.step.number)) for d in done), shares=shares,
        versions=provenance.versions(),
    )  # fmt: skip
    summary.build(directory.path, page.view_of(content), model.created)


def _line(directory: CampaignDirectory, d: Done, record: Record | None) -> Any:
    from reports.campaign_model import StepLine

    return StepLine(
        number=d.step.number, procedure=d.step.procedure.name, title=d.step.procedure.title,
        outcome=None if d.outcome is None else d.outcome.value, run=d.run.rpartition("/")[2],
        started=record.started if record else "", wall_s=d.wall_s, uses=tuple(n.procedure for n in d.step.needs),
        adopted=d.adopted, reason=d.reason,
        findings=tuple((f.effect.value, f.code, f.text) for f in record.findings) if record else (),
        figures=_figures(directory, d),
    )  # fmt: skip


def _figures(directory: CampaignDirectory, d: Done) -> tuple[Figure, ...]:
    """The first figures of a run; none where its recording gives none."""
    run = RunDirectory(directory.path / d.run)
    if not d.passed or not run.recording.is_file():
        return ()
    try:
        recording: Recording[Any] = Recording.open(run.recording, d.step.procedure.plan)
        shown = (s for s in d.step.procedure.drawn(recording) if isinstance(s, Figure))
        return tuple(islice(shown, FIGURES))
    except BenchError:
        return ()
