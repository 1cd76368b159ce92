"""`bench list` and `bench check`."""

from __future__ import annotations

import contextlib
import gc
import sys
import textwrap
from typing import TYPE_CHECKING

from bench import catalogue
from bench.progress_text import columns

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bench.errors import Problem
    from bench.rigfile import RigFile
    from bench.rigfile.busload import BusLoad

PASS, USAGE = 0, 2


def show_list() -> int:
    """Procedures, rigs and campaigns, one a line. Imports nothing heavy."""
    found = [(r.name, r.title) for r in catalogue.rigs()]
    campaigns = [(c.name, c.title) for c in catalogue.campaigns()]
    _table("procedures", [(p.name, p.about) for p in catalogue.procedures()])
    _table("rigs", found or [("(none found)", "")])
    _table("campaigns", campaigns or [("(none found)", "")])
    return _of_packages()


def _of_packages() -> int:
    """Say what is wrong with what installed packages register, as far as their metadata tell; 2 if something is."""
    from bench import extensions

    others = (extensions.MACHINES, extensions.DEVICES, extensions.LINKS)
    wrong = [why for _, why in catalogue.taken_twice()]
    wrong += [why for group in others for _, why in extensions.clashes(group, {})]
    wrong += extensions.problems()
    sys.stderr.write("".join(f"bench: {text}\n" for text in wrong))
    return USAGE if wrong else PASS


def show_abilities(rig: str) -> int:
    """Which procedures a rig can run, and what the others lack. Imports no numerics: procedures bring them where they compute.

    Raises:
        ConfigError: there is no such rig, or its file has problems; every one is in it.
    """
    with _nothing_collected():
        from bench.cli import sampled
        from bench.cli.abilities import abilities, listed
        from bench.rigfile import load_rig

        loaded = load_rig(rig)
        sys.stdout.write(f"procedures on {loaded.name}\n{listed(abilities(loaded), rig)}")
        sys.stdout.write(_in_files(loaded, rig) + sampled.told(loaded))
    return PASS


def _in_files(loaded: RigFile, rig: str) -> str:
    """Procedures in files beside the rig's: named, not executed."""
    from bench.cli.loading import beside

    found = beside(loaded)
    lines = [f"  {path}  {name}\n" for path, name in found]
    head = f"in files beside it, not looked into (`bench check {rig} FILE` does):\n"
    return "".join([head, *lines]) if found else ""


@contextlib.contextmanager
def _nothing_collected() -> Iterator[None]:
    """Without the garbage collector: what a listing imports lives to its end, and going through it takes a quarter of its time,
    here and when the process ends."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _table(title: str, rows: list[tuple[str, str]]) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in (title, *_rows(rows, columns() if sys.stdout.isatty() else None))))


def _rows(rows: list[tuple[str, str]], width: int | None) -> Iterator[str]:
    """A row each, one line where no width is given; on a terminal what is longer goes on below itself."""
    wide = max(len(name) for name, _ in rows)
    for name, about in rows:
        row = f"  {name:{wide}}  {about}".rstrip()
        if width is None or len(row) <= width:
            yield row
        else:
            yield from textwrap.wrap(row, max(width, wide + 20), subsequent_indent=" " * (wide + 4),
                                     break_on_hyphens=False)  # fmt: skip


def _load_line(load: BusLoad) -> str:
    from bench.rigfile.busload import WARN

    largest = max(load.by_message, key=lambda name: load.by_message[name])
    text = f"bus load {load.total:.1%} worst case ({largest} {load.by_message[largest]:.1%})"
    return f"{text}, high: above {WARN:.0%}\n" if load.total > WARN else f"{text}\n"


def check_rig_file(rig: str, procedure: str = "") -> int:
    """Every problem of a rig file with file, key, found and expected, on standard error, what protects it and which
    procedures it can run; 2 if there is a problem, or if it cannot run the one that is asked for."""
    from bench.cli import protected, sampled
    from bench.cli.abilities import Ability, abilities, told, unknown_plans
    from bench.rigfile.based import read_merged
    from bench.rigfile.check import as_far_as_read, check_rig

    path = catalogue.rig_path(rig)
    problems, load = check_rig(rig)
    file, able = as_far_as_read(rig), list[Ability]()
    if file is not None:
        able = abilities(file, procedure, wrong=bool(problems))
        of_procedures = dict.fromkeys(p for a in able for p in a.problems)  # a spec that cannot be read is each one's
        of_files = (
            *_of_spec(file.name),
            *of_procedures,
            *_of_simulation(file, wrong=bool(problems)),
            *_of_calibrations(file),
        )
        problems += read_merged(path).attributed((*unknown_plans(file), *of_files))
    for problem in problems:
        sys.stderr.write(f"{problem}\n")
    if load is not None:
        sys.stdout.write(_load_line(load))
    if problems:
        noun = "problem" if len(problems) == 1 else "problems"
        sys.stderr.write(f"bench: {path}: {len(problems)} {noun}\n")
    else:
        sys.stdout.write(f"{path}: no problems\n")
    if procedure:
        lines = [line for a in able for line in (*a.lacking, *a.unfit)]
        sys.stdout.write("\n  ".join([f"{path} {'cannot' if lines else 'can'} run {procedure}", *lines]) + "\n")
        sys.stdout.write(sampled.told(file) if file is not None and not problems else "")
        return USAGE if problems or lines else PASS
    sys.stdout.write(protected.told(file) + _of_certificates(file) if file is not None and not problems else "")
    sys.stdout.write(told(able, rig) if able else "")
    sys.stdout.write(sampled.told(file) if file is not None and not problems else "")
    return USAGE if problems else PASS


def _of_certificates(rig: RigFile) -> str:
    """A line for each certificate that does not hold today: results that rest on one say so."""
    from datetime import UTC, datetime

    from bench.rigfile.certificates import out_of_date

    return "".join(f"{found}\n" for found in out_of_date(rig, datetime.now(UTC).date()))


def _of_calibrations(rig: RigFile) -> Iterator[Problem]:
    """The current calibrations beside the rig file that no run would take: not to be read, changed, or of the future."""
    from datetime import UTC, datetime

    from bench.calibration.file import read
    from bench.calibration.store import stores_of
    from bench.errors import ConfigError, Problem

    now = datetime.now(UTC)
    for path in (p for store in stores_of(rig) for p in store.current_files()):
        try:
            c = read(path)
        except ConfigError as error:
            first, *_ = str(error).removeprefix(f"{path}: ").splitlines()
            yield from error.problems or [Problem(str(path), "calibration", first.rstrip(":"), "one that can be read")]
            continue
        if c.ahead(now):
            yield Problem(str(path), "date", c.date, f"one that is past; the clock says {now:%Y-%m-%dT%H:%M:%S+00:00}")


def _of_spec(rig: str) -> Iterator[Problem]:
    """Limits of no procedure; a spec that cannot be read is told of by the procedures."""
    from bench.errors import ConfigError
    from bench.record.specs import misnamed

    with contextlib.suppress(ConfigError):
        yield from misnamed(rig)


def _of_simulation(rig: RigFile, *, wrong: bool) -> Iterator[Problem]:
    """What the simulated backend would object to, where the rig file has something to simulate; of one that is `wrong`, as far
    as a machine can be made of it."""
    from bench.cli.broken import forgiven

    if rig.simulation:
        with forgiven(wrong):
            yield from _of_machine(rig)


def _of_machine(rig: RigFile) -> Iterator[Problem]:
    from bench.errors import ConfigError, Problem
    from sim_backend.machines.table import machine_of
    from sim_backend.unspoken import unspoken

    try:
        yield from unspoken(rig, machine_of(rig))
    except ConfigError as error:
        if str(error).startswith("machine "):  # a package's
            yield Problem(
                rig.path, "simulation.machine", f"{rig.simulation.get('machine')!r}: {error}", "one that can be used"
            )
            return
        place, _, said = str(error).partition(": found ")
        found, _, expected = said.partition("; expected ")
        yield Problem(rig.path, place.rpartition(" ")[2], found, expected)
