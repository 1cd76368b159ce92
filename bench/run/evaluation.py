"""From a closed recording to what a record says: measurements with verdicts, correlations and findings.

The runner and `bench analyse` both come here, and neither hands over anything but the file.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from types import MappingProxyType
from typing import Any

from bench.calibration import Calibration
from bench.errors import AnalysisError, BenchError, RecordingError, SignalAbort
from bench.findings import Effect, Finding
from bench.link.counts import LinkCounts
from bench.procedure import Measured, Procedure
from bench.procedure.names import quantities_on
from bench.record.limited import limit_of, never_measured
from bench.record.limits import Limit
from bench.record.outcomes import SOUND, Outcome, outcome_of, unjudged
from bench.record.records import Correlations, Measurement, Record, correlations_of, findings_of, measurement, missing
from bench.record.setup import Certified, certified_of
from bench.record.sources import ContinuedRun, RecordingFile
from bench.record.specs import applied, in_unit
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile.aliases import by_names
from bench.run import continued
from bench.run.certificates import overdue
from bench.run.step_gaps import incomplete_steps, missing_steps

logger = logging.getLogger("bench.run.evaluation")
ANALYSIS_FAILED = "analysis-failed"
RUN_END = "run-end"
TRUNCATED = "recording-truncated"


@dataclass(frozen=True)
class Ending:
    """How the machine's part of a run ended: what stopped it early, if anything, and what was noticed on the way."""

    stopped: Outcome | None = None
    findings: tuple[Finding, ...] = ()
    link: LinkCounts = field(default_factory=LinkCounts)

    def write(self, recorder: Recorder) -> None:
        """Into the recording, so that a later analysis knows it too."""
        recorder.event(
            RUN_END,
            stopped=None if self.stopped is None else self.stopped.value,
            findings=[asdict(f) for f in self.findings],
            link=asdict(self.link),
        )

    @classmethod
    def read(cls, recording: Recording[Any]) -> Ending:
        """From a recording; one that was cut off says so.

        Raises:
            RecordingError: the entry is there and cannot be understood.
        """
        events = recording.events(RUN_END)
        if recording.truncated or not events:
            text = "the recording was cut off: its process was killed or lost power; what was written before is whole"
            return cls(Outcome.ERROR, (Finding(TRUNCATED, text, recording.path.name, Effect.ERROR),))
        try:
            e = events[-1]
            found = tuple(Finding(f["code"], f["text"], f["where"], Effect(f["effect"]), tuple(f.get("concerns", ())))
                          for f in e["findings"])  # fmt: skip
            return cls(Outcome(e["stopped"]) if e["stopped"] else None, found, LinkCounts(**e["link"]))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"{recording.path}: its event {RUN_END} cannot be read: {error!r}") from error


@dataclass(frozen=True)
class Evaluation:
    """What a record takes from a recording."""

    measurements: tuple[Measurement, ...]
    correlations: Correlations
    findings: tuple[Finding, ...]
    certified: Mapping[str, Certified] = field(default_factory=dict)
    continues: tuple[ContinuedRun, ...] = ()

    def finish(self, record: Record, ending: Ending, ended: str, recording: RecordingFile | None) -> Record:
        """An unfinished record with its end; the outcome follows from what it holds."""
        known = {
            (f.code, f.where) for f in ending.findings
        }  # a channel that stood is seen while it does, and in its steps
        findings = (*ending.findings, *(f for f in self.findings if (f.code, f.where) not in known))
        return replace(
            record, ended=ended, recording=recording, link=ending.link, findings=findings_of(findings),
            measurements=self.measurements, correlations=self.correlations, continues=self.continues,
            setup=None if record.setup is None else replace(record.setup, certified=self.certified),
            outcome=outcome_of(self.measurements, findings, ending.stopped),
        )  # fmt: skip


def evaluate(
    procedure: Procedure, recording: Recording[Any] | None, limits: Mapping[str, Limit], *, stopped: bool
) -> Evaluation:
    """Run `analyse` on the file and judge what it yields; what was declared and not yielded is missing.

    A run that was stopped early is not analysed: its recording is kept, its quantities are missing. An analysis that
    fails is a finding, not an exception. A limit that does not hold for the plan judges nothing, and a note says so.
    A run that was to give a verdict (`bench run --require-verdict`, `--spec`) and gave none is an error.

    Raises:
        SignalAbort: the user stops it.
    """
    if recording is not None:  # there may be none of a run that was stopped
        procedure = procedure.on(recording.rig, recording.plan)
        limits = by_names(recording.rig.aliases, limits)
    if stopped or recording is None:
        before = () if recording is None else continued.continued_runs(recording)
        return Evaluation(_in_order(procedure, {}, limits), Correlations((), ()), (), continues=before)
    left_out = [q.name for q in quantities_on(recording.rig.aliases, procedure.left_out(recording.plan))]
    stated, (limits, notes) = limits, applied(limits, recording.plan, left_out)
    limits, mistaken = in_unit(limits, (*procedure.measures, *procedure.kinds))
    measured: dict[tuple[str, str], Measured] = {}
    findings = [*notes, *mistaken]
    entries: dict[tuple[str, str], Measurement] = {}
    correlations = Correlations((), ())
    try:
        for item in yielded(procedure, recording):
            if isinstance(item, Finding):
                findings.append(item)
            else:
                _accept(procedure, item, measured)
        for key, item in measured.items():
            entries[key] = measurement(item, limit_of(limits, item.quantity.name, item.where), recording.seed)
        correlations = correlations_of(list(measured.values()))
        findings += overdue(recording, measured.values())
    except SignalAbort:
        raise
    except Exception as error:
        findings.append(_failed(error))
        entries, correlations = {}, Correlations((), ())
    measurements = _in_order(procedure, entries, limits, _noted(findings, entries, limits))
    if recording.verdict_required and (nothing := unjudged(measurements, len(stated))) is not None:
        findings.append(nothing)
    certified = certified_of(recording.rig, (e.influence for m in measurements for e in m.budget))
    return Evaluation(measurements, correlations, tuple(findings), certified, continued.continued_runs(recording))


def yielded(procedure: Procedure, recording: Recording[Any]) -> Iterator[Measured | Finding]:
    """What a closed recording says: of the calibrations that the run used, of steps that lack samples, what `analyse` yields,
    and of steps that are missing."""
    explained = False
    for item in chain(
        of_calibrations(recording.calibrations),
        continued.findings(recording),
        incomplete_steps(recording),
        procedure.analyse(recording),
    ):
        explained = explained or (isinstance(item, Finding) and item.effect is not Effect.NOTE)
        yield item
    if not explained:  # else a procedure that ended early has said why
        yield from missing_steps(procedure, recording)


def of_calibrations(calibrations: Sequence[Calibration]) -> Iterator[Finding]:
    """Calibrations that the run used though they were overdue (only --allow-expired lets it), that rest on such, that carry
    no digest, or that were adopted although their run did not pass."""
    for c in calibrations:
        name = f"the calibration {c.procedure} of {c.date[:10]}"
        if c.expired:
            yield Finding("calibration-expired", f"{name} was used though it had expired on {c.due}", c.run_id)
        for used in c.used:
            if used.state == "expired":
                text = f"{name} rests on {used.procedure} of {used.date[:10]}, which had expired on {used.due}"
                yield Finding("calibration-expired", text, c.run_id)
            here = {other.procedure: other.run_id for other in calibrations}
            if here.get(used.procedure, used.run_id) != used.run_id:
                text = f"{name} rests on {used.run_id}; this run uses {here[used.procedure]} beside it"
                yield Finding("calibrations-of-two-runs", text, c.run_id)
        if not c.sealed:
            text = f"{name} carries no digest: whether its file is as it was written cannot be told"
            yield Finding("calibration-without-digest", text, c.run_id)
        if c.outcome not in SOUND:
            yield Finding(
                "calibration-not-passed", f"{name} was adopted although its outcome was {c.outcome}", c.run_id
            )


def _accept(procedure: Procedure, item: Measured, measured: dict[tuple[str, str], Measured]) -> None:
    key = (item.quantity.name, item.where)
    if item.quantity not in (*procedure.measures, *procedure.kinds):
        raise AnalysisError(f"{procedure.name} yields {item.quantity.name}, which it does not declare")
    if key in measured:
        raise AnalysisError(f"{procedure.name} yields {item.quantity.name} {item.where} twice")
    measured[key] = item


def _noted(
    findings: Iterable[Finding], entries: Collection[tuple[str, str]], limits: Mapping[str, Limit]
) -> Mapping[str, list[tuple[str, Limit]]]:
    """By quantity, places at which notes say that it is not told though a limit asks for it: what was measured at others does
    not pass for it. A finding that is more than a note decides by itself."""
    out: dict[str, list[tuple[str, Limit]]] = {}
    measured = {name for name, _ in entries}
    for concern in (c for f in findings if f.effect is Effect.NOTE for c in f.concerns):
        name, at, where = concern.partition("@")
        told = not at or name not in measured or (name, where) in entries
        limit = None if told else limit_of(limits, name, where)
        if limit is not None:
            out.setdefault(name, []).append((where, limit))
    return out


def _in_order(
    procedure: Procedure,
    entries: Mapping[tuple[str, str], Measurement],
    limits: Mapping[str, Limit],
    noted: Mapping[str, list[tuple[str, Limit]]] = MappingProxyType({}),
) -> tuple[Measurement, ...]:
    """As declared, with a missing entry where nothing was yielded that a sound machine has, or that a limit asks for, of a
    quantity or at a place; `noted` are such places by quantity."""
    out: list[Measurement] = []
    for quantity in dict.fromkeys((*procedure.measures, *procedure.kinds)):
        found = [m for (name, _), m in entries.items() if name == quantity.name]
        limit = limits.get(quantity.name)
        placed = [missing(quantity, asked, place)
                  for place, asked in (*never_measured(limits, quantity.name, (m.where for m in found)),
                                       *noted.get(quantity.name, ()))]  # fmt: skip
        declared = quantity in procedure.measures and quantity not in procedure.optional
        if limit is not None or (declared and not placed):
            found = found or [missing(quantity, limit)]
        out += [*found, *placed]
    return tuple(out)


def _failed(error: Exception) -> Finding:
    if isinstance(error, BenchError):
        logger.warning("the analysis failed: %s", error)
        return Finding(ANALYSIS_FAILED, str(error), "analyse", Effect.ERROR)
    logger.error("the analysis failed: %s: %s", type(error).__name__, error, exc_info=error)
    return Finding(ANALYSIS_FAILED, f"{type(error).__name__}: {error}; see the log", "analyse", Effect.ERROR)
