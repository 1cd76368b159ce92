"""How well a campaign used the cores, from its journal alone.

Efficiency is T1 n / (jobs T): n rigs took the wall time T on `jobs` processes, and T1 is what one rig takes while it
is alone on the machine, the mean over the first rigs of the same session (the very first, which pays for imports, left
out). 100 % is n rigs on `jobs` cores in 1/jobs of the time that one core takes. `busy` is the share of jobs x T that the
processes spent in rigs, `cpu` the share that they spent computing: other programs on the machine lower it. `own` is what
the efficiency is without them: `busy` times the processor time of a rig alone over that of a rig among others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Speed:
    """Sums over the sessions that have both phases; times in s."""

    rigs: int
    jobs: int
    wall_s: float
    alone_s: float
    efficiency: float
    busy: float
    cpu: float
    own: float


def speed(entries: Iterable[Mapping[str, Any]]) -> Speed | None:
    """The figures, or None where no session had rigs alone and rigs together."""
    sessions: dict[Any, list[Mapping[str, Any]]] = {}
    for entry in entries:
        if entry.get("kind") == "rig":
            sessions.setdefault(entry["session"], []).append(entry)
    parts = [part for rigs in sessions.values() if (part := _of_session(rigs))]
    if not parts:
        return None
    room = sum(p.jobs * p.wall_s for p in parts)
    n = sum(p.rigs for p in parts)
    return Speed(
        n, max(p.jobs for p in parts), sum(p.wall_s for p in parts), sum(p.alone_s * p.rigs for p in parts) / n,
        sum(p.alone_s * p.rigs for p in parts) / room, sum(p.busy * p.jobs * p.wall_s for p in parts) / room,
        sum(p.cpu * p.jobs * p.wall_s for p in parts) / room, sum(p.own * p.rigs for p in parts) / n,
    )  # fmt: skip


def _of_session(rigs: Sequence[Mapping[str, Any]]) -> Speed | None:
    alone = [r for r in rigs if r["alone"] == "measured"]
    together = [r for r in rigs if r["alone"] == "no"]
    jobs = max(r["jobs"] for r in rigs)
    if not alone or not together:
        return None
    t1 = sum(r["ended"] - r["began"] for r in alone) / len(alone)
    wall = max(r["ended"] for r in together) - min(r["began"] for r in together)
    if wall <= 0:
        return None
    room = jobs * wall
    busy = sum(r["ended"] - r["began"] for r in together) / room
    cpu = sum(r["cpu_s"] for r in together)
    cpu_alone = sum(r["cpu_s"] for r in alone) / len(alone)
    own = busy * cpu_alone * len(together) / cpu if cpu > 0 else 0.0
    return Speed(len(together), jobs, wall, t1, t1 * len(together) / room, busy, cpu / room, own)
