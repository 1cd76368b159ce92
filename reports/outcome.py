"""The sentence beside the outcome: what decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from bench.findings import Effect, Finding
from bench.record.limits import Verdict
from bench.record.outcomes import outranking
from reports.view import FindingRow, ResultRow

Content = Mapping[str, Any]


class _Judged(NamedTuple):
    name: str
    where: str
    verdict: Verdict


def outcome_text(record: Content, rows: Sequence[ResultRow], findings: Sequence[FindingRow]) -> str:
    """What decided. Quantities outside their limits stand first, also where a finding outranks that."""
    outcome = str(record.get("outcome", "ERROR"))
    fail, undecided = (_named(rows, tone) for tone in ("fail", "indeterminate"))
    outside = f"Outside the limits with the whole 95 % interval: {fail}. " if fail else ""
    said = [f for f in findings if f.effect]  # all but our own remark on a truncated recording
    affecting = [f for f in said if f.loud]
    # A limit that is crossed explains itself; only where nothing else does may a note be the reason.
    told = affecting or ([] if outcome == "INDETERMINATE" and undecided else said)
    loud = ", ".join(dict.fromkeys(f.code for f in told))
    match outcome:
        case "PASS" if any(r.tone == "pass" for r in rows):
            return f"{_measured(record)}, and every limit is met by the whole 95 % interval."
        case "PASS" | "DONE":  # a record of schema 1 says PASS of both
            return f"{_measured(record)}. No acceptance limit was applied."
        case "FAIL":
            return (outside + (f"Findings that prevent other decisions: {loud}." if affecting else "")).strip()
        case "INDETERMINATE":
            if outranked := ", ".join(_outranked(record)):
                outside += f"This is no statement of non-conformity: the data are contradicted ({outranked}). "
            crossed = f"The 95 % interval crosses a limit: {undecided}. " if undecided else ""
            return (outside + crossed + (f"Findings that prevent a decision: {loud}." if loud else "")).strip()
        case "ABORTED":
            return "The run was stopped before its end." + (f" See the finding {loud}." if loud else "")
        case _:
            return (outside + "The bench could not tell." + (f" See the finding {loud}." if loud else "")).strip()


def _measured(record: Content) -> str:
    """That all was measured, but for what a note says is not told at a place."""
    told = {(m.get("name"), m.get("where")) for m in record.get("measurements") or () if isinstance(m, Mapping)}
    untold: dict[str, None] = {}
    codes: dict[str, None] = {}
    for f in record.get("findings") or ():
        for concern in (f.get("concerns") or ()) if isinstance(f, Mapping) else ():
            name, at, where = str(concern).partition("@")
            if at and (name, where) not in told:
                untold[name.replace("_", " ")] = codes[str(f.get("code", ""))] = None
    every = "Every declared quantity was measured"
    return f"{every}, but not {', '.join(untold)} everywhere ({', '.join(codes)})" if untold else every


def _named(rows: Sequence[ResultRow], tone: str) -> str:
    return ", ".join(dict.fromkeys(r.symbol.plain for r in rows if r.tone == tone))


def _outranked(record: Content) -> Sequence[str]:
    """Codes of the findings that outrank a verdict of fail."""
    said = [
        Finding(str(f.get("code", "")), "", "", Effect(f.get("effect") or "note"), tuple(f.get("concerns") or ()))
        for f in record.get("findings") or ()
        if isinstance(f, Mapping)
    ]
    judged = [
        _Judged(str(m.get("name", "")), str(m.get("where") or ""), Verdict(m.get("verdict") or "none"))
        for m in record.get("measurements") or ()
        if isinstance(m, Mapping)
    ]
    return tuple(dict.fromkeys(code for m in judged for code in outranking(m, said)))
