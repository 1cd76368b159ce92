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
    try:
        found = index.entries(
            out, procedure=request.procedure, rig=request.rig, failed=request.failed, last=request.last
        )
        shown = _shown(request)
    except (sqlite3.Error, OSError) as error:
        raise BenchError(f"{out / index.NAME}: the index cannot be used: {error}") from error
    if request.as_json:
        json.dump([_as_data(e, out, shown) for e in found], sys.stdout, indent=2, ensure_ascii=False)
        sys.stdout.write("\n")
    else:
        sys.stdout.writelines(_lines(found, out, shown, columns() if sys.stdout.isatty() else None))
    if not found:
        asked = any((request.procedure, request.rig, request.failed))
        sys.stderr.write(f"no runs in {out}{' that are as asked for' if asked else ''}\n")
    return 0


def _shown(request: RunsRequest) -> Shown:
    """The results that are to be shown. One word may mean several names: a kind, all that is measured of it.

    Raises:
        ConfigError: no run has measured it.
    """
    out: Shown = {}
    for word in request.show:
        found = index.results(
            request.out,
            quantity=word,
            procedure=request.procedure,
            rig=request.rig,
            failed=request.failed,
            last=request.last,
        )
        if not found and word not in (known := index.names(request.out)):
            near = difflib.get_close_matches(word, known, 3) or known[:8]
            raise ConfigError(
                f"--show {word}: found no run in {request.out} that has measured it; expected a quantity of a record, such as "
                f"{', '.join(near) or 'K_i'}"
            )
        for result in found:
            out.setdefault(result.name, {})[result.run_id] = result
    return out


def _lines(found: Sequence[IndexEntry], out: Path, shown: Shown, width: int | None) -> Iterator[str]:
    """A line each: outcome, what is shown of it, rig, which virtual one, the run directory. On a terminal that is too narrow
    the directory goes by its name, then which rig it was is left out, and at last what is shown gets a line of its own."""
    values = {name: {run: _value(r) for run, r in by_run.items()} for name, by_run in shown.items()}
    told = [[by_run.get(e.run_id, "-") for by_run in values.values()] for e in found] if shown else []
    paths = [f"{out / e.run_id}" for e in found] if width else [f"{out}/{e.run_id}" for e in found]
    table = [
        [e.outcome for e in found],
        *map(list, zip(*told, strict=True)),
        [e.rig for e in found],
        [_which(e) for e in found],
    ]
    heads = ["", *shown, "", ""]
    sizes = [max(len(head), max(map(len, column), default=0)) for head, column in zip(heads, table, strict=True)]
    last = max(map(len, paths), default=0)
    if width is not None and sum(sizes) + len(sizes) + last > width:
        paths = [e.run_id for e in found]
        last = max(map(len, paths), default=0)
        while len(sizes) > 1 + len(shown) and sum(sizes) + len(sizes) + last > width:
            table.pop()
            sizes.pop()
    below = bool(shown) and width is not None and sum(sizes) + len(sizes) + last > width
    if shown and not below:
        yield " ".join(head.ljust(size) for head, size in zip(heads, sizes, strict=False)).rstrip() + "\n"
    for k, path in enumerate(paths):
        cells = [column[k].ljust(size) for column, size in zip(table, sizes, strict=True)]
        if below:
            yield f"{cells[0]} {path}\n"
            yield from (f"  {name} {text[k]}\n" for name, text in zip(shown, table[1:], strict=False) if text[k] != "-")
        else:
            yield f"{' '.join(cells)} {path}\n"


def _which(e: IndexEntry) -> str:
    if e.served:
        return "served simulation"
    return "" if e.seed is None else f"seed {e.seed}, visit {e.visit}" if e.visit else f"seed {e.seed}"


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
