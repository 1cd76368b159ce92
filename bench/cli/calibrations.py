"""`bench calibrations`: what is known of a rig, since when and until when."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bench.calibration import Calibration, changed_certificates, number
from bench.calibration import file as calibration_file
from bench.calibration.store import Store, base_of, machine, stores_of
from bench.cli.adopt import values
from bench.cli.loading import loadable
from bench.errors import ConfigError
from bench.record.outcomes import SOUND
from bench.rigfile import RigFile, load_rig

HEADER = ("machine", "procedure", "bias", "date", "age", "due", "state")


@dataclass(frozen=True)
class Row:
    """One calibration file: its line of the table, its values, and what is wrong with it."""

    cells: tuple[str, ...]
    values: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def calibrations_command(rig: str, calibrations: Path | None) -> int:
    """The calibrations of a rig and of its virtual ones; 2 if a file cannot be read."""
    file = load_rig(rig)
    now = datetime.now(UTC)
    rows = [row for store in stores_of(file, calibrations) for row in rows_of(store, file, now)]
    if not rows:
        first = first_to_run(file)
        where = "" if calibrations is None else f" --calibrations {calibrations}"
        then = f"`bench run {first} --rig {rig}`, then `bench adopt RUN{where}` with the folder that it prints"
        sys.stderr.write(
            f"no calibrations in {base_of(file, calibrations)}. Next: {then if first else f'`bench check {rig}`'}\n"
        )
        return 0
    sys.stdout.write(table(rows))
    return 2 if any(row.cells[-1] == "unreadable" for row in rows) else 0


def first_to_run(rig: RigFile) -> str:
    """The first procedure that the rig can run and whose calibration another one uses there; else the first that it can run."""
    able = [p for p in loadable() if not p.lacking(rig)]
    used = {need.procedure for p in able for need in p.needs(p.plan())}
    return next((p.name for p in able if p.name in used), able[0].name if able else "")


def rows_of(store: Store, rig: RigFile, now: datetime) -> Iterator[Row]:
    """The calibrations of one machine, by procedure, the current one first, then the older by age."""
    known: list[tuple[tuple[str, bool, float], Row]] = []
    for path in sorted(store.folder.glob("*.json")):
        try:
            c = calibration_file.read(path)
        except ConfigError as error:
            cells = (machine(store.seed), path.stem, "", "", "", "", "unreadable")
            known.append(((path.stem, False, 0.0), Row(cells, notes=(str(error),))))
            continue
        current = path == store.path(c.procedure)
        made = datetime.fromisoformat(c.date)
        known.append(((c.procedure, not current, -made.timestamp()), row(c, store, rig, now, current)))
    yield from (found for _, found in sorted(known, key=lambda k: k[0]))


def row(c: Calibration, store: Store, rig: RigFile, now: datetime, current: bool) -> Row:
    """One calibration and its state: current, expired, superseded, other rig, other certificates, in the future."""
    notes = [f"adopted although its outcome was {c.outcome}"] if c.outcome not in SOUND else []
    notes += [f"rests on {u.procedure}, which had expired on {u.due}" for u in c.used if u.state == "expired"]
    if not c.sealed:
        notes.append(f"carries no digest; its content has {calibration_file.digest_of(calibration_file.content(c))}")
    state = "current"
    if foreign := store.foreign(c):
        state, notes = "other rig", [foreign]
    elif not current:
        state = "superseded"
    elif changed := changed_certificates(c.certificates, rig):
        state, notes = "other certificates", [*notes, *changed]
    elif c.ahead(now):
        state = "in the future"
    elif c.overdue(now):
        state = "expired"
    notes += _outlived(c, store) if state == "current" else []
    days = (now - datetime.fromisoformat(c.date)).days
    bias = f"{number(c.settings['bias_A'])} A" if "bias_A" in c.settings else ""
    cells = (machine(store.seed), c.procedure, bias, c.date[:10], f"{days} d", c.due, state)
    return Row(cells, tuple(values(c)) if current else (), tuple(notes))


def _outlived(c: Calibration, store: Store) -> list[str]:
    """Calibrations that this one was made with and that are not the current ones any more."""
    notes = []
    for used in c.used:
        try:
            now = store.current(used.procedure)
        except ConfigError:
            continue  # it has its own line
        if now is not None and now.run_id != used.run_id:
            notes.append(f"made with {used.procedure} of {used.date[:10]} ({used.run_id}), which is superseded")
    return notes


def table(rows: list[Row]) -> str:
    """The rows as text, values and notes below each."""
    widths = [max(len(r.cells[k]) for r in [Row(HEADER), *rows]) for k in range(len(HEADER))]
    lines = []
    for r in [Row(HEADER), *rows]:
        lines.append("  ".join(f"{cell:{w}}" for cell, w in zip(r.cells, widths, strict=True)).rstrip())
        lines += [f"    {line}" for line in r.values]
        lines += [f"    note: {line}" for line in r.notes]
    return "\n".join(lines) + "\n"
