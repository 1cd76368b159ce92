"""The table in docs/reference/rig-file.md of what procedures need of a machine and its controller, made from their `requires`.

    python -m bench.cli.capabilities_page docs/reference/rig-file.md

A procedure asks by the names of a rig, so it is asked on each rig of `rigs/` and `examples/` that can run it: what it needs on
all of them is needed, what on some, or in its `uses`, is used.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from bench import catalogue
from bench.cli.loading import load_procedure
from bench.procedure import Procedure
from bench.procedure.requires import Requires
from bench.rigfile import RigFile, load_rig
from bench.rigfile.capabilities import parameters_named
from bench.rigfile.roles import STATUS

ROOT = Path(__file__).resolve().parents[2]
BEGIN = "<!-- made by: python -m bench.cli.capabilities_page docs/reference/rig-file.md -->\n"
END = "<!-- end -->\n"
COLUMNS = ("set_points", "path", "injection", "loop_injection", "bias", "settings.law", "settings.compensation", "gains",
           "flatness", "model", "current_limit", "current_steps", "coil_map", "hold", "force_currents",
           "angle", "motion", "positioning", "reference", "motor", "status", "mark", "turned", "capture", "masses")  # fmt: skip
NOTE = """\

`turned` is a motor or a drive in the role `rotation` or `drive`, `masses` are certified ones to hang, `capture` is the
controller's own memory; the others are keys of `[capabilities]`, and the table `[mark]`.
"""


def rigs() -> tuple[RigFile, ...]:
    """The rig files of `rigs/` and of `examples/`."""
    paths = [*sorted((ROOT / "rigs").glob("*.toml")), *sorted((ROOT / "examples").glob("*/*.toml"))]
    paths = [path for path in paths if path.name != "pyproject.toml"]
    return tuple(load_rig(str(path)) for path in paths)


def table(on: Iterable[RigFile]) -> str:
    """The table's text: a line for each procedure that one of the rigs can run."""
    rows, stands = [], tuple(on)
    for entry in catalogue.PROCEDURES:
        row = _row(load_procedure(entry.name), stands)
        rows.append(f"| [{entry.name}]({entry.name}.md) | {' | '.join(row)} |\n")
    head = "| procedure | " + " | ".join(f"`{key}`" for key in COLUMNS) + " |\n"
    return head + "|---" * (len(COLUMNS) + 1) + "|\n" + "".join(rows) + NOTE


def _row(procedure: Procedure, on: Iterable[RigFile]) -> list[str]:
    able = [(rig, procedure.requires(rig)) for rig in on if not procedure.lacking(rig)]
    needs = [_needed(rig, requires) for rig, requires in able]
    always = set.intersection(*needs) if needs else set()
    some = set().union(*needs, *(_used(requires) for _, requires in able))
    return ["needed" if key in always else "used" if key in some else "–" for key in COLUMNS]


def _needed(rig: RigFile, requires: Requires) -> set[str]:
    """The columns of what is needed on a rig."""
    bound = {parameter: key for key, parameter in parameters_named(rig.capabilities)}
    keys = {*requires.capabilities, *(bound[name] for name in requires.parameters if name in bound)}
    keys |= {role for role in requires.channels if "." in role and role != STATUS}
    found = {*map(_column, keys)} & {*COLUMNS}
    found |= {"turned"} if {"rotation", "drive"} & {*requires.roles} else set()
    return found | ({"capture"} if requires.capture else set()) | ({"masses"} if requires.masses else set())


def _used(requires: Requires) -> set[str]:
    """The columns of what is merely used: bits that no channel tells are none that stand."""
    return {*map(_column, requires.uses)} | ({"status"} if STATUS in requires.channels else set())


def _column(key: str) -> str:
    """The column of a capability's key, or of a role of the mark."""
    kind, _, _ = key.partition(".")
    return next((c for c in COLUMNS if key == c or key.startswith(f"{c}.")), kind)


def written(page: str) -> str:
    """The page with its table made anew.

    Raises:
        ValueError: it has no place for it.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"found no lines {BEGIN!r} and {END!r}")
    return before + BEGIN + table(rigs()) + END + after


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.write_text(written(target.read_text(encoding="utf-8")), encoding="utf-8")
