"""Limits against the procedure that they are for: names, units and settings, before anything is measured."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

from bench.errors import ConfigError, Problem
from bench.procedure import Procedure
from bench.procedure.plans import field_of
from bench.record.limited import unknown_parts
from bench.record.limits import Limit, Setting


def wrong_limits(
    limits: Mapping[str, Limit], of: Procedure, path: str, words: Collection[str] = ()
) -> Iterator[Problem]:
    """What would judge nothing, each with its key in the file at `path` and with what was expected. `words` are those that
    places may have; without any, places are not looked at."""
    units = {q.name: q.unit for q in (*of.measures, *of.kinds)}
    fields = {name: field.annotation for name, field in of.plan.model_fields.items()}
    for stated_for, limit in limits.items():
        key = f"limits.{of.name}.{stated_for}"
        name, at, place = stated_for.partition("@")
        if name not in units:
            close = difflib.get_close_matches(name, units, 1)
            hint = f". Did you mean {close[0]}{at}{place}?" if close else ""
            yield Problem(path, key, name, f"one of {', '.join(units)}{hint}")
            continue
        for part, expected in unknown_parts(place, words) if at and words else ():
            yield Problem(path, key, repr(part), expected)
        if limit.unit != units[name]:
            yield Problem(path, f"{key}.unit", repr(limit.unit), f"{units[name]!r}, the unit of {name}")
        for setting, stated in limit.at.items():
            try:
                field, _ = field_of(setting, tuple(fields))
            except ConfigError as error:
                yield Problem(path, f"{key}.at.{setting}", repr(stated), str(error))
                continue
            if expected := _unlike(stated, fields[field]):
                yield Problem(path, f"{key}.at.{setting}", repr(stated), expected)


def _unlike(stated: Setting, annotation: Any) -> str:
    """What a plan's field of this type takes, where a stated value is none of that: it would never apply. Else ""."""
    kinds, words = _taken(annotation)
    if isinstance(stated, Mapping):
        return "" if float in kinds else f"{_told(kinds, words)}: it has no range"
    values = stated if isinstance(stated, list) else [stated]
    fit = all(_kind(v) in kinds and (not isinstance(v, str) or not words or v in words) for v in values)
    return "" if fit or not kinds else _told(kinds, words)


def _kind(value: Any) -> type:
    return float if isinstance(value, int | float) and not isinstance(value, bool) else type(value)


def _taken(annotation: Any) -> tuple[set[type], set[str]]:
    """Kinds of single values (float, bool, str) that a field takes, alone or in a list, and the words if only some."""
    if get_origin(annotation) is Literal:
        values = get_args(annotation)
        return {_kind(v) for v in values}, {v for v in values if isinstance(v, str)}
    if annotation in (int, float, bool, str):
        return {float if annotation is int else annotation}, set()
    parts = [_taken(part) for part in get_args(annotation)]
    return {k for kinds, _ in parts for k in kinds}, {w for _, words in parts for w in words}


def _told(kinds: set[type], words: set[str]) -> str:
    named = {float: "a number", bool: "true or false", str: f"one of {', '.join(sorted(words))}" if words else "a word"}
    return " or ".join(text for kind, text in named.items() if kind in kinds)
