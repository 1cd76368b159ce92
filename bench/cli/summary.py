"""A finished run on the terminal: its outcome, what decided it, what was judged, where to look. With `whole` every result and
finding; the report is where digits and units are set with care."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bench import display_units
from bench.findings import Effect
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome, outranking
from bench.record.records import FindingEntry, LimitEntry, Measurement, Record
from bench.record.specs import NOT_APPLIED
from bench.uncertainty import stated

SHOWN = 12  # results, unless all are asked for
ORDER = (Verdict.FAIL, Verdict.INDETERMINATE, Verdict.MISSING, Verdict.PASS, Verdict.NONE)
LABEL = 9  # columns of "judged", "report" and their like
REPORTS = ("report.html", "report.pdf")


def summary(record: Record, directory: Path, *, whole: bool = False, width: int = 80) -> str:
    """Lines of text, each with its end."""
    ended = record.outcome in (Outcome.ABORTED, Outcome.ERROR)
    measured = [m for m in record.measurements if not (ended and m.value is None)]
    deciding = [f for f in record.findings if f.effect is not Effect.NOTE]
    notes = [f for f in record.findings if f.effect is Effect.NOTE]
    results = sorted(measured, key=lambda m: ORDER.index(m.verdict))
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


def _first(results: Sequence[Measurement]) -> Sequence[Measurement]:
    """The judged ones; where nothing was judged, the first."""
    judged = [m for m in results if m.verdict is not Verdict.NONE]
    return (judged or results)[:SHOWN]


def _decided(record: Record, deciding: Sequence[FindingEntry]) -> list[str]:
    """Why the outcome is what it is. What lies outside its limit stands first, also where a finding outranks that."""
    failed: dict[tuple[str, ...], list[str]] = {}
    for m in record.measurements:
        if m.verdict is Verdict.FAIL:
            failed.setdefault(outranking(m, record.findings), []).append(_name(m))
    lines = [_some("outside its limit" + (f", but outranked by {', '.join(codes)}" if codes else ""), names)
             for codes, names in sorted(failed.items())]  # fmt: skip
    lines += [_finding(f) for f in deciding]
    crossing = [_name(m) for m in record.measurements if m.verdict is Verdict.INDETERMINATE]
    lines += [_some("crosses a limit", crossing)] if crossing else []
    if record.outcome is Outcome.DONE:
        lines = ["no acceptance limit was applied", *(f.text for f in record.findings if f.code == NOT_APPLIED)]
    return lines


def _some(words: str, names: Sequence[str]) -> str:
    return f"{words}: {'; '.join(names[:3])}" + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _table(results: Sequence[Measurement], width: int) -> list[str]:
    """A line each: name with its place, value, verdict, limit. Where that is wider than `width`, limits that were met are left
    to the report, and the others stand on lines of their own."""
    rows = [
        (_name(m), _value(m), "" if m.verdict is Verdict.NONE else m.verdict.value, _limit(m.limit)) for m in results
    ]
    widths = [max((len(row[k]) for row in rows), default=0) for k in range(3)]
    lines = ["  ".join(text.ljust(w) for text, w in zip(row, [*widths, 0], strict=True)).rstrip() for row in rows]
    if max(map(len, lines), default=0) <= width:
        return lines
    told: list[str] = []
    for m, row in zip(results, rows, strict=True):
        told.append("  ".join(text.ljust(w) for text, w in zip(row[:3], widths, strict=True)).rstrip())
        if row[3] and m.verdict is not Verdict.PASS:
            told.append(f"  {row[3]}")
    return told


def _name(m: Measurement) -> str:
    return f"{m.name} ({m.where})" if m.where else m.name


def _value(m: Measurement) -> str:
    if m.value is None or m.expanded_uncertainty is None:
        return "not measured"
    symbol, one = display_units.of_result(m.unit, max(abs(m.value), m.expanded_uncertainty))
    return f"{stated(m.value / one, m.expanded_uncertainty / one)}{_unit(symbol)}".replace("+-", "±")


def _limit(limit: LimitEntry | None) -> str:
    """Its range in the unit in which its ends are told."""
    if limit is None:
        return ""
    symbol, one = display_units.of_result(limit.unit, max(abs(x) for x in (limit.low, limit.high) if x is not None))
    unit = _unit(symbol)
    low, high = (None if x is None else f"{x / one:.4g}" for x in (limit.low, limit.high))
    if low is None:
        return f"at most {high}{unit}"
    return f"at least {low}{unit}" if high is None else f"{low} to {high}{unit}"


def _unit(symbol: str) -> str:
    return "" if symbol == "1" else f" {symbol}".replace(" u", " µ")


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
