"""How runs look in a notebook, and what is said of a name that is none."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from html import escape

from bench.cli.result_rows import rows
from bench.record.records import Record

MANY = 12  # names that are listed


def of_record(record: Record) -> str:
    """A run in a notebook: what it was, its outcome, its results in the units that its field tells them in, its findings."""
    which = "" if record.seed is None else f", simulated, seed {record.seed}"
    head = f"{record.procedure} on {record.rig}{which}: {record.outcome.value}"
    cells = [(r.name, r.value, r.verdict.value if r.limit else "", r.limit) for r in rows(record, record.measurements)]
    results = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in cells)
    table = f"<table><tr><th>quantity</th><th>value, 95 %</th><th>verdict</th><th>limit</th></tr>{results}</table>"
    found = "".join(f"<li>{escape(f.code)}: {escape(f.text)}</li>" for f in record.findings)
    when = f"{record.run_id}, {record.started}"
    return f"<p><b>{escape(head)}</b><br>{escape(when)}</p>{table if results else ''}<ul>{found}</ul>"


def of_text(text: str) -> str:
    """A line in a notebook."""
    return f"<p>{escape(text)}</p>"


def unknown(what: str, name: str, known: Sequence[str]) -> str:
    """`what` was not found: the nearest names, or all where they are few."""
    near = difflib.get_close_matches(name, known, 5, 0.5) or known[:MANY]
    more = "" if len(near) == len(known) else f" (of {len(known)})"
    return f"{what}; expected one of {', '.join(near) or 'none'}{more}"
