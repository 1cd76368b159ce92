"""What a run holds as pandas tables, in SI."""

from __future__ import annotations

import math
import os
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.errors import BenchError, ConfigError
from bench.record.records import Record
from bench.recording import Recording
from bench.run import columns, index

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (
    "name",
    "value",
    "U",
    "unit",
    "where",
    "verdict",
    "u",
    "k",
    "dof",
    "p",
    "low",
    "high",
    "limit_low",
    "limit_high",
    "method",
)
NUMBERS = ("value", "U", "u", "k", "dof", "p", "low", "high", "limit_low", "limit_high")


def results_of(record: Record) -> pd.DataFrame:
    """A row for each quantity by its name: `value`, `U`, `unit`, `where`, `verdict`, `u`, `k`, `dof`, `p`, `low`, `high`,
    `limit_low`, `limit_high`, `method`. [low, high] is the interval of coverage probability p and U half of its width, k u
    where there is a u. Numbers that are not there are NaN; an infinite dof is inf."""
    import pandas as pd

    rows = [
        {
            "name": m.name, "value": m.value, "U": m.expanded_uncertainty, "unit": m.unit, "u": m.standard_uncertainty,
            "k": m.coverage_factor, "dof": math.inf if m.dof is None and m.value is not None else m.dof,
            "p": m.coverage_probability, "low": m.interval[0] if m.interval else None,
            "high": m.interval[1] if m.interval else None, "verdict": str(m.verdict),
            "limit_low": m.limit.low if m.limit else None, "limit_high": m.limit.high if m.limit else None,
            "method": m.method, "where": m.where,
        }
        for m in record.measurements
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=list(RESULTS)).astype(dict.fromkeys(NUMBERS, float)).set_index("name")


def findings_of(record: Record) -> pd.DataFrame:
    """A row for each finding: `code`, `effect`, `text`, `where`, and `concerns`, the quantities it is about, () for all."""
    import pandas as pd

    rows = [(f.code, str(f.effect), f.text, f.where, f.concerns) for f in record.findings]
    return pd.DataFrame(rows, columns=["code", "effect", "text", "where", "concerns"])


def steps_of(recording: Recording[Any]) -> pd.DataFrame:
    """A row for each completed step: `kind`, `start_s`, `end_s`, `start_ns`, `end_ns`, and a column for each label."""
    found: pd.DataFrame = columns.steps_of(recording).to_pandas()
    return found.set_index("step")


def captures_of(recording: Recording[Any]) -> pd.DataFrame:
    """A row for each capture by its number: `rate_hz`, `samples`, `start_s`, `trigger_s`, `channels`, and a column for each
    label that it was taken with."""
    import pandas as pd

    origin = columns.origin_ns(recording)
    rows = [
        {
            "rate_hz": c.rate_hz, "samples": c.samples, "start_s": (c.start_ns - origin) / 1e9,
            "trigger_s": (c.trigger_ns - origin) / 1e9, "channels": c.channels, **c.labels,
        }
        for c in recording.captures()
    ]  # fmt: skip
    return pd.DataFrame(rows, pd.RangeIndex(1, len(rows) + 1, name="capture"))


def channels_of(recording: Recording[Any]) -> pd.DataFrame:
    """A row for each recorded channel by its name: `unit`, `stream`, `rate_hz`."""
    import pandas as pd

    rows = [
        (c.name, c.unit, stream.name, 1e9 / stream.period_ns)
        for stream in recording.streams.values()
        for c in stream.channels
    ]
    return pd.DataFrame(rows, columns=["channel", "unit", "stream", "rate_hz"]).set_index("channel")


def runs_in(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """See `bench.runs`."""
    import pandas as pd

    root = Path(folder)
    if not root.is_dir():
        found = "a file" if root.exists() else "nothing"
        raise ConfigError(f"{root}: found {found}; expected a folder of run directories")
    try:
        found_runs = index.entries(root)
    except (sqlite3.Error, OSError) as error:
        raise BenchError(f"{root / index.NAME}: the index cannot be used: {error}") from error
    rows = [
        (e.run_id, e.procedure, e.rig, e.outcome, e.started, e.ended, e.seed, e.visit, e.served, root / e.run_id)
        for e in found_runs
    ]
    names = ["run", "procedure", "rig", "outcome", "started", "ended", "seed", "visit", "served", "path"]
    table = pd.DataFrame(rows, columns=names).astype({"seed": "Int64", "visit": "Int64"})
    for name in ("started", "ended"):
        table[name] = pd.to_datetime(table[name], utc=True)
    return table.set_index("run")
