"""Which limit judges a measurement: that of its quantity at its place, else that of its quantity."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, get_args

from bench.procedure import Procedure
from bench.record.limits import Limit
from bench.rigfile import RigFile
from bench.rigfile.aliases import SEPARATOR
from bench.rigfile.placenames import places_named


def limit_of(limits: Mapping[str, Limit], name: str, where: str) -> Limit | None:
    """The limit of `name@place` where each part of the place is one of `where`'s: what is measured at `inboard, 3000 r/min` is
    measured at `inboard`. The one with most parts judges, of several the first of the file; else that of `name` alone."""
    parts = set(where.split(SEPARATOR))
    best, most = limits.get(name), 0
    for key, limit in limits.items():
        quantity, at, place = key.partition("@")
        asked = place.split(SEPARATOR)
        if at and quantity == name and parts.issuperset(asked) and len(asked) > most:
            best, most = limit, len(asked)
    return best


def never_measured(limits: Mapping[str, Limit], name: str, wheres: Iterable[str]) -> Iterator[tuple[str, Limit]]:
    """Place and limit of each `name@place` that nothing was measured at."""
    measured = [set(where.split(SEPARATOR)) for where in wheres]
    for key, limit in limits.items():
        quantity, at, place = key.partition("@")
        if at and quantity == name and not any(parts.issuperset(place.split(SEPARATOR)) for parts in measured):
            yield place, limit


def words_of(rig: RigFile, of: Procedure) -> tuple[str, ...]:
    """The words that a place of a procedure's measurement may have beside numbers: what the rig file calls its places and its
    controller's settings, words of the plan, and the procedure's own."""
    settings = (name for kind in rig.capabilities.settings.values() for name in kind)
    planned = [rig.plans.get(of.name, {}), *((f.annotation, f.default) for f in of.plan.model_fields.values())]
    words = [*places_named(rig), *settings, *of.places, *_texts(planned)]
    return tuple(dict.fromkeys(word for word in words if word))


def _texts(found: Any) -> Iterator[str]:
    """Every text in settings of a plan, and in the choices of their types."""
    if isinstance(found, str):
        yield found
    elif isinstance(found, Mapping):
        yield from (text for value in found.values() for text in _texts(value))
    elif isinstance(found, tuple | list):
        yield from (text for value in found for text in _texts(value))
    else:
        yield from (text for value in get_args(found) for text in _texts(value))


def unknown_parts(place: str, words: Collection[str]) -> Iterator[tuple[str, str]]:
    """Parts of a limit's place that nothing is called, each with what is expected. One with a figure is a speed or a size,
    which a run alone knows, unless it is nearly a name."""
    for part in place.split(SEPARATOR):
        tokens, close = part.split(), difflib.get_close_matches(part, words, 3)
        figure = any(c.isdigit() for c in part) and not (close and len(tokens) == 1)
        if part not in words and not figure and _strange(tokens, words):
            told = f", such as {' or '.join(close)}" if close else f": one of {', '.join(words)}"
            yield part, f"a place by the rig's name{told}"


def _strange(tokens: Collection[str], words: Collection[str]) -> bool:
    """Whether a part of several words has none that something is called: `weight inboard` has one."""
    return len(tokens) < 2 or not any(token in words for token in tokens)
