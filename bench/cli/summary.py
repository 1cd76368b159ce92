"""A finished run on the terminal: its outcome, what decided it, what was judged, where to look. With `whole` every result and
finding; the report is where digits and units are set with care."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bench.cli.result_rows import Row, rows, spread, titled
from bench.findings import Effect
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome, outranking
from bench.record.records import FindingEntry, Record
from bench.record.specs import NOT_APPLIED

SHOWN = 12  # results, unless all are asked for
LABEL = 9  # columns of "judged", "report" and their like
REPORTS = ("report.html", "report.pdf")


def summary(record: Record, directory: Path, *, whole: bool = False, width: int = 80) -> str:
    """Lines of text, each with its end."""
    ended = record.outcome in (Outcome.ABORTED, Outcome.ERROR)
    measured = [m for m in record.measurements if not (ended and m.value is None)]
    deciding = [f for f in record.findings if f.effect is not Effect.NOTE]
    notes = [f for f in record.findings if f.effect is Effect.NOTE]
    results = rows(record, measured)
    shown = results if whole else _first(results)
    lines = [f"{record.outcome.value.upper()}: {record.procedure} on {record.rig}"]
    lines += _labelled("decided", _decided(record, deciding), width)
    if missing := len(record.measurements) - len(measured):
        lines += _labelled("missing", [f"nothing was measured of {missing} declared quantities"], width)
    lines += _labelled("results", _table(shown, width - LABEL - 2), None)
    if whole:
        lines += _labelled("notes", [_finding(f) for f in notes], width)
    left = [_count(len(results) - len(shown), "more result"), "" if whole else _count(len(notes), "note")]
    if any(left):
        lines += _labelled("", [f"{' and '.join(x for x in left if x)}: -v, or the report"], width)
    there = [str(directory / name) for name in REPORTS if (directory / name).is_file()]
    return "\n".join([*lines, *_labelled("see", there[:1] or [str(directory)], None)]) + "\n"


def _first(results: Sequence[Row]) -> Sequence[Row]:
    """The judged ones; where nothing was judged, the first of each quantity."""
    judged = [r for r in results if r.verdict is not Verdict.NONE]
    return judged[:SHOWN] if judged else spread(results, SHOWN)


def _decided(record: Record, deciding: Sequence[FindingEntry]) -> list[str]:
    """Why the outcome is what it is. What lies outside its limit stands first, also where a finding outranks that."""
    failed: dict[tuple[str, ...], list[str]] = {}
    for m in record.measurements:
        if m.verdict is Verdict.FAIL:
            failed.setdefault(outranking(m, record.findings), []).append(titled(m.name, m.where))
    lines = [_some("outside its limit" + (f", but outranked by {', '.join(codes)}" if codes else ""), names)
             for codes, names in sorted(failed.items())]  # fmt: skip
    lines += [_finding(f) for f in deciding]
    crossing = [titled(m.name, m.where) for m in record.measurements if m.verdict is Verdict.INDETERMINATE]
    lines += [_some("crosses a limit", crossing)] if crossing else []
    if record.outcome is Outcome.DONE:
        lines = ["no acceptance limit was applied", *(f.text for f in record.findings if f.code == NOT_APPLIED)]
    return lines


def _some(words: str, names: Sequence[str]) -> str:
    return f"{words}: {'; '.join(names[:3])}" + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _table(results: Sequence[Row], width: int) -> list[str]:
    """A line each: name with its place, value, verdict, limit. Where that is wider than `width`, limits that were met are left
    to the report, and the others stand on lines of their own."""
    told_of = [(r.name, r.value, "" if r.verdict is Verdict.NONE else r.verdict.value, r.limit) for r in results]
    widths = [max((len(row[k]) for row in told_of), default=0) for k in range(3)]
    lines = ["  ".join(text.ljust(w) for text, w in zip(row, [*widths, 0], strict=True)).rstrip() for row in told_of]
    if max(map(len, lines), default=0) <= width:
        return lines
    told: list[str] = []
    for r, row in zip(results, told_of, strict=True):
        told.append("  ".join(text.ljust(w) for text, w in zip(row[:3], widths, strict=True)).rstrip())
        if row[3] and r.verdict is not Verdict.PASS:
            told.append(f"  {row[3]}")
    return told


def _finding(f: FindingEntry) -> str:
    return f"{f.code}{f' ({f.where})' if f.where else ''}: {f.text}"


def _labelled(label: str, texts: Iterable[str], width: int | None) -> Iterator[str]:
    """Texts beside a label; broken between words at `width`."""
    first = label
    for text in texts:
        indent = " " * (LABEL + 2)
        start = f"  {first:{LABEL}}"
        yield (
            start + text
            if width is None
            else textwrap.fill(text, width, initial_indent=start, subsequent_indent=indent)
        )
        first = ""


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' if n > 1 else ''}" if n > 0 else ""
