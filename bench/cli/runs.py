"""`bench runs`: the runs in a folder, with results of theirs."""

from __future__ import annotations

import difflib
import json
import sqlite3
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import repeat
from json.encoder import encode_basestring
from pathlib import Path
from typing import Any

from bench.errors import BenchError, ConfigError
from bench.progress_text import columns
from bench.run import index
from bench.run.indexrow import Kind, MachineKind

Shown = dict[str, dict[int, str]]
"""Results by name and number of the run, as they are printed."""
Listed = list[tuple[Any, ...]]
"""Of each run its name, its number, that of its kind and, for JSON, when it began and ended."""
FEW = 1000  # runs whose results are looked for one by one


@dataclass(frozen=True)
class RunsRequest:
    """What is to be listed: of which procedure, rig and machine, those that did not pass, the newest
    so many, with which results."""

    out: Path
    procedure: str | None = None
    rig: str | None = None
    failed: bool = False
    last: int | None = None
    show: tuple[str, ...] = field(default=())
    as_json: bool = False
    machine: MachineKind | None = None


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
    told, kinds = [], index.kinds(request.out)
    for asked, known in (
        (request.procedure, {kind.procedure for kind in kinds}),
        (request.rig, {kind.rig for kind in kinds}),
    ):
        if asked is not None and known and asked not in known:
            near = difflib.get_close_matches(asked, known, 1)
            told.append(f" of {asked}; there are some of {', '.join(near or sorted(known)[:8])}")
    filtered = any((request.procedure, request.rig, request.failed, request.machine))
    return ";".join(told) or (" that are as asked for" if filtered else "")


def _told(request: RunsRequest) -> int:
    """How many runs are as asked for, which are printed."""
    out = request.out
    try:
        found, kinds = index.listing(
            out, procedure=request.procedure, rig=request.rig, failed=request.failed, last=request.last,
            machine=request.machine, timed=request.as_json,
        )  # fmt: skip
        shown = _shown(request, found)
    except (sqlite3.Error, OSError) as error:
        raise BenchError(f"{out / index.NAME}: the index cannot be used: {error}") from error
    with suppress(BrokenPipeError):  # whoever reads has seen enough, as `head` has
        if request.as_json:
            sys.stdout.writelines(_as_json(found, kinds, out, shown))
        else:
            width = columns() if sys.stdout.isatty() else None
            sys.stdout.writelines(_lines(found, kinds, out, shown, width))
    return len(found)


def _shown(request: RunsRequest, found: Listed) -> Shown:
    """The results that are to be shown. One word may mean several names: a kind, all that is measured of it.

    Raises:
        ConfigError: no run has measured it.
    """
    out: Shown = {}
    few = [run[1] for run in found] if len(found) <= FEW else None
    for word in request.show:
        results = index.shown(request.out, word, as_json=request.as_json, runs=few)
        if not results and not index.results(request.out, quantity=word, last=1):
            known = index.names(request.out)
            near = difflib.get_close_matches(word, known, 3) or known[:8]
            raise ConfigError(
                f"--show {word}: found no run in {request.out} that has measured it; expected a quantity of a record, such as "
                f"{', '.join(near) or 'K_i'}"
            )
        for name, texts in results.items():
            out.setdefault(name, {}).update(texts)
    return out


def _lines(found: Listed, kinds: Mapping[int, Kind], out: Path, shown: Shown, width: int | None) -> Iterator[str]:
    """A line each: outcome, what is shown of it, rig, which virtual one, the run directory. On a terminal that is too narrow
    the directory goes by its name, then which rig it was is left out, and at last what is shown gets a line of its own.

    Very many runs are of few kinds: what is the same in all runs of one is put together once."""
    of = {n: kinds[n] for n in {run[2] for run in found}}
    ends = {n: [kind.rig, which_machine(kind.served, kind.seed, kind.visit)] for n, kind in of.items()}
    cells = [[*map(texts.get, [run[1] for run in found], repeat("-"))] for texts in shown.values()]
    outcomes = max((len(kind.outcome) for kind in of.values()), default=0)
    sizes = [max(len(name), *map(len, column), 1) for name, column in zip(shown, cells, strict=True)]
    tails = [max((len(end[k]) for end in ends.values()), default=0) for k in (0, 1)]
    longest = max((len(run[0]) for run in found), default=0)
    folder = f"{out}/"

    def wide() -> int:
        return 1 + outcomes + sum(sizes) + sum(tails) + len(sizes) + len(tails) + len(folder) + longest

    if width is not None and wide() > width:
        folder = ""
        while tails and wide() > width:
            tails.pop()
    below = width is not None and bool(shown) and wide() > width
    start = {n: kind.outcome.ljust(outcomes) for n, kind in of.items()}
    end = {
        n: "".join(f"{text:{k}} " for text, k in zip(texts, tails, strict=False)) + folder for n, texts in ends.items()
    }
    if not shown or below:
        whole = {n: f"{start[n]} {end[n]}" for n in of}
        for run_id, number, kind in found:
            yield f"{whole[kind]}{run_id}\n"
            if below:
                yield from (f"  {name} {texts[number]}\n" for name, texts in shown.items() if number in texts)
        return
    yield " ".join([" " * outcomes, *(name.ljust(n) for name, n in zip(shown, sizes, strict=True))]).rstrip() + "\n"
    padded = ([text.ljust(n) for text in column] for column, n in zip(cells, sizes, strict=True))
    for (run_id, _, kind), values in zip(found, map(" ".join, zip(*padded, strict=True)), strict=True):
        yield f"{start[kind]} {values} {end[kind]}{run_id}\n"


def which_machine(served: bool, seed: int | None, visit: int | None) -> str:
    """Which virtual machine it was; "" is a real one."""
    if served:
        return "served simulation"
    return "" if seed is None else f"seed {seed}, visit {visit}" if visit else f"seed {seed}"


def _as_json(found: Listed, kinds: Mapping[int, Kind], out: Path, shown: Shown) -> Iterator[str]:
    """A line for each run. Of very many what is the same in all of a kind is encoded once."""
    own = {n: _encoded(_kind_as_data(kind))[1:-1] for n, kind in kinds.items()}
    folder = encode_basestring(f"{out}/")[:-1]
    named = [(f"{encode_basestring(name)}: ", texts) for name, texts in shown.items()]
    before = "[\n"
    for run_id, number, kind, started, ended in found:
        name, end = encode_basestring(run_id), "null" if ended is None else encode_basestring(ended)
        results = ", ".join([name + texts[number] for name, texts in named if number in texts]) if named else ""
        yield (f'{before}{{"run_id": {name}, {own[kind]}, "started": {encode_basestring(started)}, "ended": {end}, '
               f'"path": {folder}{name[1:]}, "results": {{{results}}}}}')  # fmt: skip
        before = ",\n"
    yield "\n]\n" if found else "[\n\n]\n"


def _encoded(data: Mapping[str, Any]) -> str:
    return json.dumps(data, ensure_ascii=False)


def _kind_as_data(kind: Kind) -> dict[str, Any]:
    return {**kind._asdict(), "served": bool(kind.served), "machine": kind.machine}
