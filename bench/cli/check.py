"""`bench list` and `bench check`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from bench import catalogue

if TYPE_CHECKING:
    from bench.busload import BusLoad

PASS, USAGE = 0, 2


def show_list() -> int:
    """Procedures, rigs and campaigns, one a line. Imports nothing heavy."""
    found = [(r.name, r.title) for r in catalogue.rigs()]
    campaigns = [(c.name, c.title) for c in catalogue.campaigns()]
    _table("procedures", [(p.name, p.about) for p in catalogue.PROCEDURES])
    _table("rigs", found or [("(none found)", "")])
    _table("campaigns", campaigns or [("(none found)", "")])
    return PASS


def _table(title: str, rows: list[tuple[str, str]]) -> None:
    width = max(len(name) for name, _ in rows)
    sys.stdout.write(f"{title}\n")
    for name, about in rows:
        sys.stdout.write(f"  {name:{width}}  {about}".rstrip() + "\n")


def _load_line(load: BusLoad) -> str:
    from bench.busload import WARN

    largest = max(load.by_message, key=lambda name: load.by_message[name])
    text = f"bus load {load.total:.1%} worst case ({largest} {load.by_message[largest]:.1%})"
    return f"{text}, high: above {WARN:.0%}\n" if load.total > WARN else f"{text}\n"


def check_rig_file(rig: str) -> int:
    """Every problem of a rig file with file, key, found and expected, on standard error; 2 if there is one."""
    from bench.rigcheck import check_rig

    path = catalogue.rig_path(rig)
    problems, load = check_rig(rig)
    for problem in problems:
        sys.stderr.write(f"{problem}\n")
    if load is not None:
        sys.stdout.write(_load_line(load))
    if problems:
        noun = "problem" if len(problems) == 1 else "problems"
        sys.stderr.write(f"bench: {path}: {len(problems)} {noun}\n")
        return USAGE
    sys.stdout.write(f"{path}: no problems\n")
    return PASS
