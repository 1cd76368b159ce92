"""The page of all finding codes, docs/reference/findings.md, made from the registers of the engine and of the rooms.

python -m bench.cli.findings_page docs/reference/findings.md
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from collections.abc import Iterator
from pathlib import Path

import procedures
from bench import finding_codes
from bench.findings import Codes

HEAD = """\
# Findings

Every code that a record may have, with the effects that it may have on the outcome. A PASS or DONE has notes alone. The pages
of the procedures say when each is told, and what to look at. Codes are stable: a record's reader may go by them.

| code | told by | effect | says |
|---|---|---|---|
"""


def registers() -> Iterator[tuple[str, Codes]]:
    """The name of each register's room, and its codes: the engine's first."""
    yield "engine", finding_codes.CODES
    for room in sorted(m.name for m in pkgutil.iter_modules(procedures.__path__) if m.ispkg):
        if "findings" in {m.name for m in pkgutil.iter_modules([str(Path(procedures.__path__[0]) / room)])}:
            yield room, importlib.import_module(f"procedures.{room}.findings").CODES


def page() -> str:
    """The page's text."""
    rows = sorted((code, room, *meant) for room, codes in registers() for code, meant in codes.items())
    return HEAD + "".join(
        f"| `{code}` | {room.replace('_', ' ')} | {effect} | {text} |\n" for code, room, effect, text in rows
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
