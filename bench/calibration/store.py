"""Where calibrations lie: beside the rig file, a folder for each machine, the current one of each procedure and the older.
Those of a rig file that was installed with Levbench lie in `./rigs`.

rigs/tsbs12.toml
rigs/tsbs12.calibrations/live/amb-calibration.json
rigs/tsbs12.calibrations/sim-3/amb-calibration.json                     virtual rig 3 is another machine than 4
rigs/tsbs12.calibrations/sim-3/amb-calibration-20261121T101500Z.json    superseded: named by the date of its run
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from bench import catalogue
from bench.calibration import file
from bench.calibration.calibration import Calibration
from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.rundir import stamp
from bench.wholefile import write_whole

SUFFIX = ".calibrations"
SUPERSEDED = re.compile(r"-\d{8}T\d{6}Z(-\d+)?$")


@dataclass(frozen=True)
class Store:
    """The calibrations of one machine, in `folder`. The machine: serial number of the rig's unit under test, and which of
    the virtual ones it is (`seed`, None for the real one)."""

    folder: Path
    rig: str
    uut: str
    seed: int | None

    @classmethod
    def of(cls, rig: RigFile, seed: int | None, base: Path | None = None) -> Store:
        """The store of a rig: beside its file, or in `base`."""
        return cls(base_of(rig, base) / machine(seed), rig.name, rig.uut.serial, seed)

    def path(self, procedure: str) -> Path:
        """The file of the current calibration by a procedure."""
        return self.folder / f"{procedure}.json"

    def current(self, procedure: str) -> Calibration | None:
        """The current calibration by a procedure; None if there is none.

        Raises:
            ConfigError: the file cannot be read.
        """
        path = self.path(procedure)
        return file.read(path) if path.exists() else None

    def current_files(self) -> list[Path]:
        """The files of the current calibrations; the superseded ones have a date in their names."""
        return [p for p in sorted(self.folder.glob("*.json")) if not SUPERSEDED.search(p.stem)]

    def foreign(self, c: Calibration) -> str:
        """Whose calibration it is, if not this machine's; else nothing."""
        if c.rig != self.rig:
            return f"of rig {c.rig}"
        if c.uut != self.uut:
            return f"of the machine with serial no. {c.uut}; this is {self.uut}"
        if c.seed != self.seed:
            return f"of {named(c.seed)}; this is {named(self.seed)}"
        return ""

    def adopt(self, calibration: Calibration) -> Path:
        """Make a calibration the current one; the one before it is kept under its date. At no time is there none.

        Raises:
            ConfigError: the folder cannot be written.
        """
        path = self.path(calibration.procedure)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if path.exists():
                self._keep(path, calibration)
            file.write(path, calibration)
        except OSError as error:
            raise ConfigError(
                f"{path}: cannot be written: {error.strerror or error} ({error.filename}); nothing was adopted. "
                "Next: give another folder with --calibrations, here and to `bench run`"
            ) from error
        return path

    def _keep(self, path: Path, successor: Calibration) -> None:
        """Copy what is current to its name as a superseded one; the same run adopted again supersedes nothing."""
        text = path.read_bytes().decode("utf-8", errors="replace")
        try:
            old = file.from_json(text, str(path))
            if old.run_id == successor.run_id:
                return
            made = datetime.fromisoformat(old.date)
        except ConfigError:  # whatever it is, it is not thrown away
            made = datetime.fromtimestamp(path.stat().st_mtime).astimezone()
        kept = path.with_name(f"{successor.procedure}-{stamp(made)}.json")
        number = 1
        while kept.exists() and kept.read_text(encoding="utf-8") != text:
            number += 1
            kept = path.with_name(f"{successor.procedure}-{stamp(made)}-{number}.json")
        write_whole(kept, text)


def base_of(rig: RigFile, base: Path | None = None) -> Path:
    """The folder of all calibrations of a rig file: `<stem>.calibrations` beside it, unless another is given; in `./rigs`
    if the file is part of an installed package, which is not written into: what is known of a machine would go with it."""
    path = Path(rig.path)
    folder = Path("rigs") if catalogue.PACKAGED in path.parents else path.parent
    return base or folder / (path.stem + SUFFIX)


def machine(seed: int | None) -> str:
    """The folder's name of the real machine (None) or of a virtual one."""
    return "live" if seed is None else f"sim-{seed}"


def named(seed: int | None) -> str:
    """The machine in words."""
    return "the real rig" if seed is None else f"virtual rig {seed}"


def seed_of(folder: str) -> int | None:
    """The seed that a folder's name stands for, None for `live`.

    Raises:
        ValueError: it is no such name.
    """
    if folder == "live":
        return None
    prefix, _, number = folder.partition("-")
    if prefix != "sim":
        raise ValueError(folder)
    return int(number)


def stores_of(rig: RigFile, base: Path | None = None) -> Iterator[Store]:
    """The machines of a rig file that have calibrations: the real one first, virtual ones by seed."""
    folder = base_of(rig, base)
    found = []
    for path in folder.iterdir() if folder.is_dir() else ():
        try:
            seed = seed_of(path.name)
        except ValueError:
            continue
        found.append((-1 if seed is None else seed, seed))
    for _, seed in sorted(found):
        yield Store.of(rig, seed, base)
