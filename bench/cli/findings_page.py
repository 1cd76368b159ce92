"""The page of all finding codes, docs/reference/findings.md, made from the registers: `findings.toml` of the engine and of each
room, a code with the effects that it may have and what it says in a line.

    python -m bench.cli.findings_page docs/reference/findings.md

With a package's name behind it, a page of the codes of that package:

    python -m bench.cli.findings_page findings.md levbench_ball
"""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
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


def registers_of(package: str) -> Iterator[tuple[str, Mapping[str, tuple[str, str]]]]:
    """As `registers`, of an installed package.

    Raises:
        ValueError: it has none, or gives a code of ours another meaning.
    """
    spec = importlib.util.find_spec(package)
    folders = [] if spec is None else [Path(f) for f in spec.submodule_search_locations or ()]
    files = [path for folder in folders for path in sorted(folder.rglob("findings.toml"))]
    if not files:
        raise ValueError(f"package {package}: found no findings.toml; expected one beside what tells the codes")
    ours = {code: meant for _, codes in registers() for code, meant in codes.items()}
    for path in files:
        codes = {code: (effects, text) for code, (effects, text) in tomllib.loads(path.read_text("utf-8")).items()}
        if taken := [code for code, meant in codes.items() if ours.get(code, meant) != meant]:
            raise ValueError(
                f"{path}: {', '.join(taken)}: found another meaning than Levbench's; expected a code of its own"
            )
        yield path.parent.name, codes


def page(found: Iterable[tuple[str, Mapping[str, tuple[str, str]]]] | None = None) -> str:
    """The page's text, of our registers or of those that are given."""
    listed = registers() if found is None else found
    rows = sorted((code, room, *meant) for room, codes in listed for code, meant in codes.items())
    return HEAD + "".join(
        f"| `{code}` | {room.replace('_', ' ')} | {effect} | {text} |\n" for code, room, effect, text in rows
    )


if __name__ == "__main__":
    try:
        text = page(registers_of(sys.argv[2]) if len(sys.argv) > 2 else None)
    except ValueError as error:
        sys.exit(str(error))
    Path(sys.argv[1]).write_text(text, encoding="utf-8")
