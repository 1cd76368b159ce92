"""`bench runs`: the runs in a folder, with results of theirs."""

from __future__ import annotations

import difflib
import json
import sqlite3
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.errors import BenchError, ConfigError
from bench.progress_text import columns
from bench.run import index
from bench.run.indexrow import IndexEntry, Result

Shown = dict[str, dict[str, Result]]
"""Results by name and run."""
FEW = 1000  # runs whose results are looked for one by one


@dataclass(frozen=True)
class RunsRequest:
    """What is to be listed: of which procedure and rig, those that did not pass, the newest so many, with which results."""

    out: Path
    procedure: str | None = None
    rig: str | None = None
    failed: bool = False
    last: int | None = None
    show: tuple[str, ...] = field(default=())
    as_json: bool = False


def runs_command(request: RunsRequest) -> int:
    """The runs in a folder, oldest first.

    Raises:
        ConfigError: it is not a folder, or nothing in it has measured what is to be shown.
        BenchError: the index can neither be read nor rebuilt.
    """
    out = request.out
    if out.exists() and not out.is_dir():
        raise ConfigError(f"--out {out}: found a file; expected a folder of run directories")
    with index.uncollected():
        found = _told(request)
    if not found:
        sys.stderr.write(f"no runs in {out}{_none_such(request)}\n")
    return 0


def _none_such(request: RunsRequest) -> str:
    """Of what that is asked for there is none, and what there is."""
    told = []
    for asked, known in (
        (request.procedure, {e.procedure for e in index.entries(request.out)}),
        (request.rig, {e.rig for e in index.entries(request.out)}),
    ):
        if asked is not None and known and asked not in known:
            near = difflib.get_close_matches(asked, known, 1)
            told.append(f" of {asked}; there are some of {', '.join(near or sorted(known)[:8])}")
    filtered = any((request.procedure, request.rig, request.failed))
    return ";".join(told) or (" that are as asked for" if filtered else "")


def _told(request: RunsRequest) -> list[IndexEntry]:
    """The runs that are asked for, printed."""
    out = request.out
    try:
        found = index.entries(
            out, procedure=request.procedure, rig=request.rig, failed=request.failed, last=request.last
        )
        shown = _shown(request, found)
    except (sqlite3.Error, OSError) as error:
        raise BenchError(f"{out / index.NAME}: the index cannot be used: {error}") from error
    if request.as_json:
        json.dump([_as_data(e, out, shown) for e in found], sys.stdout, indent=2, ensure_ascii=False)
        sys.stdout.write("\n")
    else:
        sys.stdout.writelines(_lines(found, out, shown, columns() if sys.stdout.isatty() else None))
    return found


def _shown(request: RunsRequest, found: Sequence[IndexEntry]) -> Shown:
    """The results that are to be shown. One word may mean several names: a kind, all that is measured of it.

    Raises:
        ConfigError: no run has measured it.
    """
    out: Shown = {}
    few = [e.run_id for e in found] if len(found) <= FEW else None
    for word in request.show:
        results = index.results(request.out, quantity=word, of=few)
        if not results and not index.results(request.out, quantity=word, last=1):
            known = index.names(request.out)
            near = difflib.get_close_matches(word, known, 3) or known[:8]
            raise ConfigError(
                f"--show {word}: found no run in {request.out} that has measured it; expected a quantity of a record, such as "
                f"{', '.join(near) or 'K_i'}"
            )
        for result in results:
            out.setdefault(result.name, {})[result.run_id] = result
    return out


def _lines(found: Sequence[IndexEntry], out: Path, shown: Shown, width: int | None) -> Iterator[str]:
    """A line each: outcome, what is shown of it, rig, which virtual one, the run directory. On a terminal that is too narrow
    the directory goes by its name, then which rig it was is left out, and at last what is shown gets a line of its own.

    Very many runs are of few kinds: what is the same in all runs of one is put together once."""
    kinds = [(e.outcome, e.rig, e.served, e.seed, e.visit) for e in found]
    ends = {kind: [kind[1], which_machine(*kind[2:])] for kind in set(kinds)}
    values = [{run: _value(r) for run, r in by_run.items()} for by_run in shown.values()]
    outcomes = max((len(kind[0]) for kind in ends), default=0)
    sizes = [max(len(name), *map(len, column.values()), 1) for name, column in zip(shown, values, strict=True)]
    tails = [max((len(end[k]) for end in ends.values()), default=0) for k in (0, 1)]
    paths = [f"{out}/{e.run_id}" for e in found]
    longest = max(map(len, paths), default=0)

    def wide() -> int:
        return 1 + outcomes + sum(sizes) + sum(tails) + len(sizes) + len(tails) + longest

    if width is not None and wide() > width:
        paths = [e.run_id for e in found]
        longest = max(map(len, paths), default=0)
        while tails and wide() > width:
            tails.pop()
    below = width is not None and bool(shown) and wide() > width
    start = {kind: kind[0].ljust(outcomes) for kind in ends}
    end = {kind: "".join(f"{text:{n}} " for text, n in zip(texts, tails, strict=False)) for kind, texts in ends.items()}
    if not shown:
        whole = {kind: f"{start[kind]} {end[kind]}" for kind in ends}
        yield from [f"{whole[kind]}{path}\n" for kind, path in zip(kinds, paths, strict=True)]
        return
    if below:
        for kind, path, e in zip(kinds, paths, found, strict=True):
            yield f"{start[kind]} {end[kind]}{path}\n"
            yield from (f"  {name} {v[e.run_id]}\n" for name, v in zip(shown, values, strict=True) if e.run_id in v)
        return
    yield " ".join([" " * outcomes, *(name.ljust(n) for name, n in zip(shown, sizes, strict=True))]).rstrip() + "\n"
    for kind, path, e in zip(kinds, paths, found, strict=True):
        cells = " ".join(v.get(e.run_id, "-").ljust(n) for v, n in zip(values, sizes, strict=True))
        yield f"{start[kind]} {cells} {end[kind]}{path}\n"


def which_machine(served: bool, seed: int | None, visit: int | None) -> str:
    """Which virtual machine it was; "" is a real one."""
    if served:
        return "served simulation"
    return "" if seed is None else f"seed {seed}, visit {visit}" if visit else f"seed {seed}"


def _value(r: Result) -> str:
    from bench.cli.told import with_unit

    return "missing" if r.value is None or r.U is None else with_unit(r.value, r.U, r.unit)


def _as_data(e: IndexEntry, out: Path, shown: Shown) -> dict[str, Any]:
    results = {name: _result_as_data(by_run[e.run_id]) for name, by_run in shown.items() if e.run_id in by_run}
    return {**e._asdict(), "served": bool(e.served), "path": str(out / e.run_id), "results": results}


def _result_as_data(r: Result) -> dict[str, Any]:
    return {
        "value": r.value, "unit": r.unit, "standard_uncertainty": r.u, "expanded_uncertainty": r.U, "dof": r.dof,
        "coverage_probability": r.p, "low": r.lower, "high": r.upper, "verdict": r.verdict,
    }  # fmt: skip
