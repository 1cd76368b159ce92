"""`bench compare`: two runs of one procedure, on the terminal or as JSON."""

from __future__ import annotations

import json
import math
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.cli.loading import load_procedure
from bench.display_units import of_result
from bench.errors import AnalysisError, BenchError
from bench.findings import SIMULATED_CONTROLLER
from bench.history.compare import Comparison, Difference, Found, Part, Side, compare
from bench.history.differ import Differs, differing
from bench.history.naming import pair_named
from bench.progress_text import columns
from bench.quantity import Measured
from bench.record.records import Measurement, Record, read_record
from bench.record.told import unit_text
from bench.recording import Recording
from bench.run.evaluation import yielded
from bench.run.indexrow import MachineKind, machine_kind
from bench.rundir import RunDirectory
from bench.uncertainty import PROBABILITY, stated

SCHEMA = 1
SHOWN, PARTS = 12, 3
HEADS = ("", "A", "B", "B - A", "E_n", "shared")
SOURCES = {
    "recording": "by draws, from the recordings",
    "apart": "not linear, and no recordings: nothing is taken as shared",
}


@dataclass(frozen=True)
class CompareRequest:
    """Which two runs, by words; the folder in which names are looked for."""

    words: tuple[str, str]
    out: Path
    whole: bool = False
    as_json: bool = False


def compare_command(request: CompareRequest) -> int:
    """Compare, on standard output; 0, whatever the difference.

    Raises:
        ConfigError: no such runs, or two that cannot be compared.
    """
    a, b = (Side(run.path, read_record(run.record)) for run in pair_named(request.words, request.out))
    found = compare(a, b, _anew)
    differ = differing(a.record, b.record)
    if request.as_json:
        json.dump(as_data(found, differ), sys.stdout, indent=2, ensure_ascii=False)
        sys.stdout.write("\n")
    else:
        sys.stdout.write("\n".join(lines(found, differ, columns(), request.whole)) + "\n")
    return 0


def _anew(path: Path) -> Found:
    """A run's estimates from its recording, by this version."""
    try:
        run = RunDirectory(path)
        procedure = load_procedure(read_record(run.record).procedure)
        recording: Recording[Any] = Recording.open(run.recording, procedure.plan)
        made = yielded(procedure.on(recording.rig, recording.plan), recording)
        return {(m.quantity.name, m.where): m.estimate for m in made if isinstance(m, Measured)}
    except (BenchError, OSError):
        raise
    except Exception as error:  # as in an evaluation: data that an analysis does not foresee
        raise AnalysisError(f"{path}: {type(error).__name__}: {error}") from error


def lines(found: Comparison, differ: Sequence[Differs], width: int, whole: bool = False) -> Iterator[str]:
    """The comparison as text of that width: the runs, what differs, the differences, and of those beyond 1 what could make
    them."""
    yield f"{found.a.record.procedure}: B - A, ± with 95 % coverage"
    for letter, side in (("A", found.a), ("B", found.b)):
        yield from _folded(f"  {letter}  ", _run(side), width)
    yield from _differ(found, differ, width, whole)
    if not found.one_machine:
        a, b = _machine(found.a.record), _machine(found.b.record)
        which = "two machines: they share what goes by one certificate, and nothing else"
        twin = f"a {a} machine and a {b} one: nothing that is certified is the same in both"
        yield from _folded("  ", which if a == b else twin, width)
    for caution in found.cautions:
        yield from _folded("  caution: ", caution, width)
    ordered = sorted(found.differences, key=lambda d: -_size(d))
    shown = (
        found.differences if whole else [d for d in ordered if d.beyond] + [d for d in ordered if not d.beyond][:SHOWN]
    )
    yield from _table(shown, width)
    beyond = [d for d in ordered if d.beyond]
    left = len(found.differences) - len(shown)
    chance = ": by chance it is 1 in 20" if found.one_machine else ""
    more = f"; {left} more: -v" if left else ""
    yield from _folded("  ", f"|E_n| beyond 1 in {len(beyond)} of {len(found.differences)}{chance}{more}", width)
    perhaps = sum(d.perhaps for d in found.differences) - len(beyond)
    if perhaps:
        told = f"{perhaps} more would be, if the bounds that each run found for itself had one cause in both: -v has that U"
        yield from _folded("  ", told, width)
    if found.only:
        yield from _folded("  ", f"measured by one of them alone: {', '.join(found.only)}", width)
    for d in shown if whole else beyond:
        yield from _explained(d, width)


def _size(d: Difference) -> float:
    return math.inf if d.en is None else abs(d.en)


def _run(side: Side) -> str:
    r = side.record
    kind = _machine(r)
    which = {"real": "", "served": ", served simulation"}.get(kind, f", seed {r.seed}, visit {r.visit}")
    serial = f" {r.uut['serial']}" if r.uut.get("serial") else ""
    return f"{r.outcome.value:4} {r.started[:16].replace('T', ' ')}  {r.rig}{serial}{which}  {side.path.name}"


def _machine(r: Record) -> MachineKind:
    return machine_kind(r.seed, any(f.code == SIMULATED_CONTROLLER for f in r.findings))


def _differ(found: Comparison, differ: Sequence[Differs], width: int, whole: bool) -> Iterator[str]:
    told = [d for d in differ if (d.what, d.key) not in (("rig", "seed"), ("rig", "visit"))]  # in the lines above
    if not told:
        said = found.a.record.setup is not None and found.b.record.setup is not None
        yield f"  all else is the same: plan, rig, {'parameters, firmware, certificates, ' if said else ''}versions"
    for d in told if whole else told[:SHOWN]:
        yield from _folded("  differs  ", f"{d.what}{f' {d.key}' if d.key else ''}: {d.a}, then {d.b}", width)
    if len(told) > SHOWN and not whole:
        yield f"  and {len(told) - SHOWN} more: -v"


def _table(shown: Sequence[Difference], width: int) -> Iterator[str]:
    """Numbers of a line in one unit, which stands with the name; a name that leaves them no room has a line of its own."""
    rows = [HEADS, *(_row(d) for d in shown)]
    sizes = [max(len(row[k]) for row in rows) for k in range(len(HEADS))]
    apart = sum(sizes) + 2 * len(sizes) > width
    for k, row in enumerate(rows):
        name = "" if apart else row[0].ljust(sizes[0])
        if apart and row[0]:
            yield from _folded("  ", row[0], width)
        yield "  " + "  ".join([name, *(text.ljust(n) for text, n in zip(row[1:], sizes[1:], strict=True))]).rstrip()
        if k and (said := SOURCES.get(shown[k - 1].source)):
            yield f"      {said}"


def _row(d: Difference) -> tuple[str, ...]:
    symbol, one = _unit_of(d)
    numbers = ((d.a.value, d.a.expanded_uncertainty), (d.b.value, d.b.expanded_uncertainty), (d.value, d.U))
    told = (stated((x or 0.0) / one, (U or 0.0) / one).replace("+-", "±") for x, U in numbers)
    en = "none" if d.en is None else f"{d.en:.2f}"
    return (
        titled(d) + (f",{unit_text(symbol)}" if symbol != "1" else ""),
        *told,
        en,
        f"{100 * max(d.removed, 0.0):.0f} %",
    )


def _unit_of(d: Difference) -> tuple[str, float]:
    """Of A's value, so that the three are told in one."""
    return of_result(d.unit, max(abs(d.a.value or 0.0), d.a.expanded_uncertainty or 0.0))


def titled(d: Difference) -> str:
    """Name with its place."""
    return f"{d.name} ({d.where})" if d.where else d.name


def _explained(d: Difference, width: int) -> Iterator[str]:
    """What could make a difference: influences that a run has of its own, and those of both that would have to have changed."""
    _, one = _unit_of(d)
    causes = sorted(_causes(d), key=lambda c: c.alone)
    own, same = ([c for c in causes if c.shared is shared][:PARTS] for shared in (False, True))
    of_own = "; ".join(f"{c.name}, {c.size / one:.2g}: off by {c.alone:.2g} u" for c in own)
    of_both = "; ".join(f"{c.name}: by {c.alone:.2g} u" for c in same)
    yield f"  {titled(d)}, what could make the difference by itself"
    if d.least < d.U:
        yield f"    U is {d.U / one:.2g}, and {d.least / one:.2g} if bounds of both have one cause"
    yield from _folded("    its own in a run: ", of_own, width) if own else ()
    yield from _folded("    the same in both, had it changed: ", of_both, width) if same else ()


@dataclass(frozen=True)
class _Cause:
    """An influence, or all parts of one covariance together: what one u of it makes of a difference, and how many it takes."""

    name: str
    shared: bool
    size: float
    alone: float


def _causes(d: Difference) -> Iterator[_Cause]:
    together: dict[str, list[Part]] = {}
    for p in d.parts:
        stem, _, last = p.influence.rpartition("/")
        together.setdefault(stem if last.isdigit() and not p.shared else p.influence, []).append(p)
    for parts in together.values():
        first = parts[0]
        size = math.hypot(*(max(abs(p.in_a), abs(p.in_b)) for p in parts))
        whose = "" if first.shared or d.source == "apart" else f" of {'A' if any(p.in_a for p in parts) else 'B'}"
        name = first.name if len(parts) == 1 else re.sub(r" \(\d+\)", "", first.name)
        if size > 0:
            yield _Cause(name + whose, first.shared, size, abs(d.value) / size)


def _folded(start: str, text: str, width: int) -> Iterator[str]:
    """Words behind a start, on as many lines as they need."""
    yield from textwrap.wrap(text, max(width, 40), initial_indent=start, subsequent_indent=" " * min(len(start), 11),
                             break_on_hyphens=False, break_long_words=False)  # fmt: skip


def as_data(found: Comparison, differ: Sequence[Differs]) -> dict[str, Any]:
    """The comparison as plain data, SI; docs/reference/compare.md describes it."""
    return {
        "schema": SCHEMA, "procedure": found.a.record.procedure, "a": _side(found.a), "b": _side(found.b),
        "coverage_probability": PROBABILITY, "one_machine": found.one_machine, "differs": [vars(d) for d in differ],
        "differences": [_difference_as_data(d) for d in found.differences], "only": list(found.only),
        "cautions": list(found.cautions),
    }  # fmt: skip


def _side(side: Side) -> dict[str, Any]:
    r: Record = side.record
    return {
        "run_id": r.run_id, "path": str(side.path), "rig": r.rig, "uut": dict(r.uut), "outcome": r.outcome.value,
        "started": r.started, "seed": r.seed, "visit": r.visit, "machine": _machine(r),
    }  # fmt: skip


def _difference_as_data(d: Difference) -> dict[str, Any]:
    parts = [vars(p) | {"shared": p.shared} for p in d.parts]
    return {
        "name": d.name, "where": d.where, "unit": d.unit, "a": _end(d.a), "b": _end(d.b), "difference": d.value,
        "standard_uncertainty": d.u, "expanded_uncertainty": d.U, "interval": [d.low, d.high], "dof": d.dof, "method": d.method,
        "en": d.en, "beyond": d.beyond, "removed": d.removed, "least": d.least, "source": d.source, "parts": parts,
    }  # fmt: skip


def _end(m: Measurement) -> dict[str, Any]:
    return {"value": m.value, "expanded_uncertainty": m.expanded_uncertainty}
