"""`bench adopt`: a run's results become facts of its rig."""

from __future__ import annotations

import sys
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from bench import catalogue
from bench.calibration import Calibration
from bench.calibration.store import Store, named
from bench.cli.made_by import procedure_of
from bench.record.outcomes import SOUND
from bench.rigfile import load_rig
from bench.run.adoption import Adoption, due, refuse_other_rig
from bench.uncertainty import interval, stated


def adopt(
    run: Path, rig: str = "", calibrations: Path | None = None, anyway: bool = False, procedure: str = ""
) -> tuple[Calibration, Path]:  # fmt: skip
    """Make a run's results the current calibration of its rig; what it is now, and its file.

    `rig` is the rig file, by default the one that the run was made with; `calibrations` another folder than the one beside it;
    `procedure` the file of a procedure that is in no catalogue.

    Raises:
        ConfigError: the run cannot be relied on, or is not of the rig as its file describes it today.
        BenchError: its recording cannot be read or analysed.
    """
    adoption = Adoption.open(run)
    chosen = procedure_of(adoption.run, adoption.recording.procedure, procedure, "adopt")
    made = adoption.calibration(chosen, anyway)
    then = adoption.recording.wall.get("rig_file", "")
    file = load_rig(rig or (then if Path(then).is_file() else str(catalogue.rig_path(made.rig))))
    store = Store.of(file, made.seed, calibrations)
    refuse_other_rig(made, file, store)
    made = replace(made, due=due(file, made.procedure, datetime.fromisoformat(made.date)))  # by today's interval
    return made, store.adopt(made)


def adopt_command(run: Path, rig: str, calibrations: Path | None, anyway: bool, procedure: str = "") -> int:
    """Adopt, say on standard error what became current and until when; the file on standard output."""
    made, path = adopt(run, rig, calibrations, anyway, procedure)
    sys.stderr.write(said(made))
    sys.stdout.write(f"{path}\n")
    return 0


def said(c: Calibration) -> str:
    """What became current, as lines of text."""
    seed = f", {named(c.seed)}" if c.seed is not None else ""
    lines = [f"{c.procedure} of {c.rig}{seed}: current from now on, due {c.due}"]
    if c.outcome not in SOUND:
        lines.append(f"  adopted although its outcome was {c.outcome}")
    lines += [f"  adopted although {u.procedure} had expired on {u.due}" for u in c.used if u.state == "expired"]
    lines += [f"  {line}" for line in values(c)]
    return "\n".join(lines) + "\n"


def values(c: Calibration) -> list[str]:
    """The values of a calibration, one a line; those by angle are only counted."""
    whole = {name: e for name, e in c.values.items() if "@" not in name}
    lines = []
    for name, e in whole.items():
        unit = "" if e.unit == "1" else e.unit
        lines.append(f"{name:8} {stated(e.value, interval(e).U, '±')} {unit}".rstrip())
    rest = len(c.values) - len(whole)
    return [*lines, f"and {rest} values by angle"] if rest else lines
