"""Rows of the results table from the measurements of a record."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from reports import tables, text
from reports.view import ResultRow, Tone

Content = Mapping[str, Any]
TONES: dict[str, Tone] = {"pass": "pass", "fail": "fail", "indeterminate": "indeterminate", "error": "error"}
TONES |= {"aborted": "error", "missing": "error"}


def row(m: Content, definitions: Mapping[str, str], titles: Mapping[str, str]) -> ResultRow:
    """The row of one measurement of record.json."""
    name, unit = str(m.get("name", "")), str(m.get("unit") or "")
    expanded, verdict = m.get("expanded_uncertainty"), str(m.get("verdict") or "none")
    limit, untold = m.get("limit"), m.get("method") == "monte-carlo" or m.get("value") is None
    return ResultRow(
        symbol=tables.symbol_of(name, titles),
        about=text.prose(tables.called(definitions.get(name, ""), titles, definitions)),
        where=text.prose(tables.place(m)),
        result=text.result(m.get("value"), expanded, unit),
        interval=_telling_interval(m, unit),
        k=text.factor(m.get("coverage_factor")),
        dof=text.DASH if untold else text.degrees_of_freedom(m.get("dof")),
        probability=text.probability(m.get("coverage_probability")),
        limit=_limit(limit, unit, text.shift_of(m.get("value"), expanded)),
        limit_source=text.prose(_limit_source(limit)),
        verdict="no limit" if verdict.lower() == "none" else verdict.lower(),
        tone=TONES.get(verdict.lower(), "none"),
    )


def _telling_interval(m: Content, unit: str) -> str:
    """The interval where it came from Monte Carlo or is not value ± U to the printed digits."""
    low, high = m.get("interval") or (None, None)
    value, expanded = m.get("value"), m.get("expanded_uncertainty")
    if low is None or high is None or value is None:
        return ""
    middle = abs((low + high) / 2 - value) > 0.05 * (high - low)
    if not middle and m.get("method") != "monte-carlo":
        return ""
    how = " by Monte Carlo" if m.get("method") == "monte-carlo" else ""
    return f"{text.interval(low, high, expanded, unit)}{how}"


def told_once(rows: Sequence[ResultRow]) -> tuple[ResultRow, ...]:
    """Neighbours of one quantity with its definition, and the source of their limit, at the first of them only."""
    out = list(rows[:1])
    for before, one in pairwise(rows):
        same = one.symbol == before.symbol
        out.append(
            dataclasses.replace(
                one,
                about="" if same and one.about == before.about else one.about,
                limit_source="" if same and (one.limit, one.limit_source) == (before.limit, before.limit_source)
                else one.limit_source,
            )
        )  # fmt: skip
    return tuple(out)


def _limit(limit: Content | None, unit: str, shift: int) -> str:
    """The range, with the power of ten of the result that it is held against."""
    if not limit:
        return text.DASH
    low, high = limit.get("low"), limit.get("high")
    if low is not None and high is not None:
        return text.at_power(f"{text.shifted(low, shift)} to {text.shifted(high, shift)}", shift, unit)
    if low is not None:
        return f"≥ {text.at_power(text.shifted(low, shift), shift, unit)}"
    return text.DASH if high is None else f"≤ {text.at_power(text.shifted(high, shift), shift, unit)}"


def _limit_source(limit: Content | None) -> str:
    if not limit:
        return ""
    source = str(limit.get("source") or "source not stated")
    return source if limit.get("verified") else f"{source} (limit not verified against its source)"
