"""A run's record against its recording: what both say must agree.

The record is text that anybody can change, by a slip too. The recording is held against its digest in the record and holds
the data, the limits, the end of the run and its times: where the two differ, it is the recording that is believed.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from bench import __version__
from bench.errors import ConfigError, Problem
from bench.findings import Effect
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome
from bench.record.records import Measurement, Record

SAME = 1e-3  # of the standard uncertainty: other processors round differently
EXACT = 1e-9  # of a value without uncertainty
RANK = list(Outcome)  # strongest first


def require_agreement(path: Path, record: Record, again: Record, levbench: str) -> None:
    """See that the record of a run says what `again`, the analysis of its recording, finds.

    Args:
        path: the run directory, for the message.
        levbench: the version that made the run.

    Raises:
        ConfigError: they contradict each other; every contradiction is in it.
    """
    problems = (*_facts(record, again), *_outcomes(record, again), *_values(record, again))
    if problems:
        older = "" if levbench == __version__ else f", or adopt it with Levbench {levbench}"
        analyse = f"bench analyse {shlex.quote(str(path))}"
        title = (f"{path}: the record contradicts its recording; nothing was adopted. Next: `{analyse}` writes what the "
                 f"recording gives, `bench run {again.procedure}` makes a new run{older}")  # fmt: skip
        raise ConfigError(title, problems)


def outcome_of_both(record: Record, again: Record) -> Outcome:
    """The stronger of two outcomes that agree: that an analysis or a report was interrupted is known to the record alone."""
    return min(record.outcome, again.outcome, key=RANK.index) if not _sound(record, again) else again.outcome


def _sound(record: Record, again: Record) -> bool:
    return record.outcome.sound and again.outcome.sound


def _facts(record: Record, again: Record) -> Iterator[Problem]:
    """Whose run it is, and when it was."""
    for name in ("run_id", "procedure", "rig", "seed", "visit", "started", "ended"):
        said, found = getattr(record, name), getattr(again, name)
        if said != found:
            yield _problem(name, said, found, "which the recording has")


def _outcomes(record: Record, again: Record) -> Iterator[Problem]:
    """A record may be worse than its recording, never better. Schema 1 says PASS where nothing was judged: that is DONE."""
    before_done = record.schema == 1 and _sound(record, again)
    better = RANK.index(record.outcome) > RANK.index(again.outcome)
    unfounded = record.outcome.sound and record.outcome is not again.outcome
    if (better or unfounded) and not before_done:
        yield _problem("outcome", record.outcome.value, again.outcome.value, f"which the recording gives{_why(again)}")


def _why(again: Record) -> str:
    judged = [f"{m.name} {m.verdict.value}" for m in again.measurements
              if m.verdict not in (Verdict.PASS, Verdict.NONE)]  # fmt: skip
    said = [f.code for f in again.findings if f.effect is not Effect.NOTE]
    return f" ({', '.join(dict.fromkeys([*said, *judged]))})" if said or judged else ""


def _values(record: Record, again: Record) -> Iterator[Problem]:
    """Values that this version does not find. One that only this version finds contradicts nothing."""
    found = {(m.name, m.where): m for m in again.measurements}
    for m in record.measurements:
        if m.value is None:
            continue
        here = found.get((m.name, m.where))
        name = m.name + (f"@{m.where}" if m.where else "")
        if here is None or here.value is None:
            yield _problem(name, f"{m.value:.8g}", "no value", "which is all that this version finds in the recording")
        elif abs(here.value - m.value) > _rounding(here):
            yield _problem(name, f"{m.value:.8g}", f"{here.value:.8g}", "which this version finds in the recording")


def _rounding(m: Measurement) -> float:
    """By how much a value may differ that another processor computes."""
    return SAME * (m.standard_uncertainty or m.expanded_uncertainty or 0.0) or EXACT * abs(m.value or 0.0)


def _problem(key: str, said: object, found: object, why: str) -> Problem:
    return Problem("record.json", key, f"{said}", f"{found}, {why}")
