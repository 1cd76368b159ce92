"""From verdicts and findings to the outcome of a run: which of them outranks which."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Protocol

from bench.findings import Effect, Finding
from bench.record.limits import Verdict


class Outcome(StrEnum):
    """The outcome of a run, strongest first. PASS: at least one limit was judged, and all that were are met. DONE:
    measured, and nothing was judged."""

    ABORTED = "ABORTED"
    ERROR = "ERROR"
    FAIL = "FAIL"
    INDETERMINATE = "INDETERMINATE"
    PASS = "PASS"
    DONE = "DONE"

    @property
    def sound(self) -> bool:
        """Nothing speaks against the run: its results may be relied on."""
        return self in SOUND


SOUND = (Outcome.PASS, Outcome.DONE)


class Judged(Protocol):
    """What the outcome asks of a measurement."""

    @property
    def name(self) -> str: ...
    @property
    def where(self) -> str: ...
    @property
    def verdict(self) -> Verdict: ...


class Said(Protocol):
    """What the outcome asks of a finding."""

    @property
    def code(self) -> str: ...
    @property
    def effect(self) -> Effect: ...
    @property
    def concerns(self) -> Sequence[str]: ...


NOTHING_JUDGED = "nothing-judged"


def unjudged(measurements: Iterable[Judged], limits: int) -> Finding | None:
    """The finding of a run that was to give a verdict and gave none; `limits` is how many it had."""
    if any(m.verdict not in (Verdict.NONE, Verdict.MISSING) for m in measurements):
        return None
    why = "none of its limits holds for this plan" if limits else "there is no limit for this procedure"
    text = f"a verdict was asked for, and no acceptance limit was applied: {why}"
    return Finding(NOTHING_JUDGED, text, "spec", Effect.ERROR)


def concerns(finding: Said, m: Judged) -> bool:
    """Whether a finding concerns a measurement: by its name, `name@place` or `@place`; one that names none concerns all.
    What is measured at `inboard, 3000 r/min` is measured at `3000 r/min` too."""
    return not finding.concerns or any(
        quantity in ("", m.name) and (not at or f", {m.where}".endswith(f", {place}"))
        for quantity, at, place in (entry.partition("@") for entry in finding.concerns)
    )


def outranking(m: Judged, findings: Iterable[Said]) -> tuple[str, ...]:
    """Codes of the findings that outrank a verdict of fail: contradicting data support no statement of non-conformity."""
    decisive = (f.code for f in findings if f.effect is Effect.INDETERMINATE and concerns(f, m))
    return tuple(dict.fromkeys(decisive)) if m.verdict is Verdict.FAIL else ()


def outcome_of(measurements: Iterable[Judged], findings: Iterable[Said], stopped: Outcome | None = None) -> Outcome:
    """The strongest of what stopped the run (if anything did), the verdicts and the findings' effects.

    A fail whose quantity an indeterminate finding concerns is indeterminate; one that none touches fails the run.
    """
    measured, said = list(measurements), list(findings)
    found = {stopped, *(_of_effect(f) for f in said), *(_of_verdict(m, said) for m in measured)}
    return next((outcome for outcome in Outcome if outcome in found), Outcome.DONE)


def _of_effect(finding: Said) -> Outcome | None:
    return {Effect.ERROR: Outcome.ERROR, Effect.INDETERMINATE: Outcome.INDETERMINATE}.get(finding.effect)


def _of_verdict(m: Judged, findings: Iterable[Said]) -> Outcome | None:
    match m.verdict:
        case Verdict.MISSING:
            return Outcome.ERROR
        case Verdict.FAIL:
            return Outcome.INDETERMINATE if outranking(m, findings) else Outcome.FAIL
        case Verdict.INDETERMINATE:
            return Outcome.INDETERMINATE
        case Verdict.PASS:
            return Outcome.PASS
    return None
