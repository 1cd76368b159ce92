"""What the first data of a run show: where its analysis would call them an error, nobody need wait for the rest.

The judgement is the analysis' own function, of the means of the samples as they come. A person is asked whether to go on;
without one the run ends, and its recording is analysed as far as it goes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding, Findings
from bench.procedure.rig import Rig
from bench.recording import Recording
from bench.recording.recorder import Recorder

ENDED = "ended-by-first-look"  # event: the findings by which the run ended


def goes_on(rig: Rig, found: Iterable[Finding]) -> bool:
    """Whether the run goes on: nothing that was found is an error, or the operator says that it shall."""
    wrong = [f.text for f in found if f.effect is Effect.ERROR]
    return not wrong or rig.operator.goes_on("\n".join(wrong))


def passes(rig: Rig, record: Recorder, found: Iterable[Finding]) -> bool:
    """As `goes_on`; where the run ends, what it ended by is put into the recording."""
    found = list(found)
    if goes_on(rig, found):
        return True
    ends(record, found)
    return False


def ends(record: Recorder, found: Iterable[Finding]) -> None:
    """The run ends by what was found: it is put into the recording."""
    told = [{"code": f.code, "text": f.text, "where": f.where} for f in found if f.effect is Effect.ERROR]
    record.event(ENDED, findings=told)


def with_first(recording: Recording[Any], found: Iterable[Finding]) -> Iterator[Finding]:
    """What was found in the steps, and what the run ended by if they do not show it."""
    known = set()
    for finding in found:
        known.add((finding.code, finding.where))
        yield finding
    for event in recording.events(ENDED):
        for f in event["findings"]:
            if (f["code"], f["where"]) not in known:
                yield Finding(f["code"], f["text"], f["where"], Effect.ERROR)


def gate(recording: Recording[Any], findings: Findings, found: Iterable[Finding]) -> None:
    """Where the run ended by its first data, what was found in them ends the evaluation too.

    Raises:
        Ended: the run ended so.
    """
    if recording.events(ENDED):
        findings.gate(with_first(recording, found))


def watched(rig: Rig, record: Recorder, names: Sequence[str], seconds: float) -> dict[str, float]:
    """Means of the samples that come while the clock sleeps for some time, SI; the newest where none comes."""
    return {name: float(x.mean()) for name, x in samples(rig, record, names, seconds).items()}


def samples(rig: Rig, record: Recorder, names: Sequence[str], seconds: float) -> dict[str, npt.NDArray[np.float64]]:
    """The samples (n,) that come while the clock sleeps for some time, SI; the newest where none comes."""
    with record.watching(names) as seen:
        rig.clock.sleep(seconds)
    return {name: seen[name] if name in seen else np.array([rig.levitation.reading(name)]) for name in names}
