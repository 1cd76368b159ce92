"""`bench trend`: a quantity over the runs of a folder."""

from __future__ import annotations

import json
import sqlite3
import sys
from dataclasses import dataclass
from pathlib import Path

from bench.errors import BenchError, ConfigError
from bench.history.series import one_history
from bench.history.trend import Trend, trend
from bench.run import index
from bench.run.indexrow import MachineKind
from bench.wholefile import write_whole


@dataclass(frozen=True)
class TrendRequest:
    """What was asked for on the command line."""

    quantity: str
    out: Path
    rig: str | None = None
    procedure: str | None = None
    seed: int | None = None
    last: int = 100
    weight: float = 0.2
    baseline: int = 8
    json: bool = False
    figure: Path | None = None
    machine: MachineKind | None = None


def trend_command(asked: TrendRequest) -> int:
    """The trend on standard output, as text or JSON; with `figure` also as a drawing.

    Raises:
        ConfigError: nothing to follow, several things, or an option that cannot be.
        BenchError: the index can neither be read nor rebuilt, or the figure cannot be written.
    """
    if asked.figure is not None and asked.figure.suffix != ".svg":
        raise ConfigError(f"--figure {asked.figure}: found {asked.figure.suffix or 'no ending'}; expected .svg. "
                          f"Next: --figure {asked.figure.with_suffix('.svg')}")  # fmt: skip
    if asked.figure is not None and not asked.figure.parent.is_dir():
        raise ConfigError(f"--figure {asked.figure}: found no folder {asked.figure.parent}; expected one that is there. "
                          "Next: make it, or give another file")  # fmt: skip
    found, older = found_trend(asked)
    if asked.json:
        from bench.history.trendjson import as_data

        sys.stdout.write(json.dumps(as_data(found), indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    else:
        from bench.cli.trend_table import text

        sys.stdout.write(text(found, older))
    if asked.figure is not None:
        try:
            write_whole(asked.figure, drawn(found))
        except OSError as error:
            raise BenchError(
                f"--figure {asked.figure}: cannot be written: {error.strerror or error}. Next: give another"
            ) from error
        sys.stderr.write(f"figure: {asked.figure}\n")
    return 0


def found_trend(asked: TrendRequest) -> tuple[Trend, bool]:
    """The trend, and whether there are older runs than it has."""
    if not asked.out.is_dir():
        raise ConfigError(
            f"--out {asked.out}: found no folder there; expected one of run directories. Next: name it with --out"
        )
    if asked.seed is not None and asked.machine not in (None, "simulated"):
        raise ConfigError(f"--seed {asked.seed}: found --machine {asked.machine} beside it, which has no seed; expected one of "
                          f"them. Next: leave --machine out")  # fmt: skip
    try:
        machine, twins = _followed(asked)
        results = index.results(
            asked.out, quantity=asked.quantity, procedure=asked.procedure, rig=asked.rig, last=asked.last + 1, machine=machine,
            seed=asked.seed,
        )  # fmt: skip
        runs = list(dict.fromkeys(r.run_id for r in results))
        kept = set(runs[-asked.last :])
        history = one_history([r for r in results if r.run_id in kept], asked.quantity, lambda: index.names(asked.out),
                              str(asked.out), twins)  # fmt: skip
    except (sqlite3.Error, OSError) as error:
        raise BenchError(f"{asked.out / index.NAME}: the index cannot be used: {error}") from error
    return trend(history, weight=asked.weight, baseline=asked.baseline), len(runs) > asked.last


def _followed(asked: TrendRequest) -> tuple[MachineKind | None, int]:
    """What machine is followed, and how many runs of others are left out by that: unless something else is asked for a real
    one, where there are runs of it, and never its twin beside it."""
    if asked.machine is not None or asked.seed is not None:
        return asked.machine or "simulated", 0
    found = index.machines(asked.out, asked.quantity, asked.procedure, asked.rig)
    return ("real", found.total() - found["real"]) if found["real"] else (None, 0)


def drawn(found: Trend) -> str:
    """The figure as SVG, in the style of the reports."""
    from bench.history.trendfigure import figure
    from reports.figures import draw

    return draw(figure(found)).svg
