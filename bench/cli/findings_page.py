"""The page of all finding codes, docs/reference/findings.md, made from the registers: `findings.toml` of the engine and of each
room, a code with the effects that it may have and what it says in a line.

    python -m bench.cli.findings_page docs/reference/findings.md
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEAD = """\
# Findings

Every code that a record may have, with the effects that it may have on the outcome. A PASS or DONE has notes alone. The pages
of the procedures say when each is told, and what to look at. Codes are stable: a record's reader may go by them.

| code | told by | effect | says |
|---|---|---|---|
"""


def registers() -> Iterator[tuple[str, Mapping[str, tuple[str, str]]]]:
    """The name of each register's room, and its codes with effects and meaning: the engine's first."""
    for path in (ROOT / "bench" / "findings.toml", *sorted((ROOT / "procedures").glob("*/findings.toml"))):
        codes = tomllib.loads(path.read_text(encoding="utf-8"))
        yield path.parent.name, {code: (effects, text) for code, (effects, text) in codes.items()}


def page() -> str:
    """The page's text."""
    rows = sorted((code, room, *meant) for room, codes in registers() for code, meant in codes.items())
    return HEAD + "".join(
        f"| `{code}` | {room.replace('_', ' ')} | {effect} | {text} |\n" for code, room, effect, text in rows
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
