"""Command lines of `bench runs` and `bench trend` as they are typed most often, understood by the standard library alone: the
library that understands them all takes longer to load than the index to answer. Every other line is left to that one, which
tells what is wrong with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from bench.run.indexrow import MachineKind

Read = Callable[[str], Any]


def _whole(least: int) -> Read:
    return lambda text: int(text) if text.isdecimal() and len(text) < 10 and int(text) >= least else None


def _machine(text: str) -> str | None:
    return text if text in get_args(MachineKind) else None


OF_BOTH: Mapping[str, tuple[str, Read | None]] = {
    "--out": ("out", Path), "--procedure": ("procedure", str), "--rig": ("rig", str), "--machine": ("machine", _machine),
}  # fmt: skip
OF_RUNS = {
    **OF_BOTH,
    "--failed": ("failed", None),
    "--last": ("last", _whole(1)),
    "--show": ("show", str),
    "--json": ("as_json", None),
}
OF_TREND = {**OF_BOTH, "--seed": ("seed", _whole(0)), "--last": ("last", _whole(2)), "--json": ("json", None)}
"""What is given, and how its value is read, where it has one; None is not understood."""
REPEATED = "show"


def plain(arguments: Iterable[str]) -> Callable[[], int] | None:
    """What to do; None where the line is not plain."""
    match [*arguments]:
        case ["runs", *rest] if (given := _given(rest, OF_RUNS)) is not None:
            from bench.cli.runs import RunsRequest, runs_command

            runs = RunsRequest(**given)
            return lambda: runs_command(runs)
        case ["trend", quantity, *rest] if _is_value(quantity) and (given := _given(rest, OF_TREND)) is not None:
            from bench.cli.trend import TrendRequest, trend_command

            trend = TrendRequest(quantity, **given)
            return lambda: trend_command(trend)
    return None


def _given(words: Iterable[str], options: Mapping[str, tuple[str, Read | None]]) -> dict[str, Any] | None:
    """The values of a request by their names."""
    found: dict[str, Any] = {}
    left = iter(words)
    for word in left:
        name, read = options.get(word, ("", None))
        text = next(left, "") if read else "given"
        value = (read(text) if _is_value(text) else None) if read else True
        if not name or value is None or (name in found and name != REPEATED):
            return None
        found[name] = (*found.get(name, ()), value) if name == REPEATED else value
    return {"out": Path("runs"), **found}


def _is_value(text: str) -> bool:
    return text.isascii() and text != "" and not text.startswith("-")
