"""Run directories: made exclusively, never overwritten, and told apart from other directories when read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bench.errors import ConfigError

NAME = re.compile(r"[a-z0-9-]+-\d{8}t\d{6}z-[0-9a-f]{4}", re.IGNORECASE)

LARGEST = 2**63 - 1
"""The largest seed or visit: what the index of a folder of runs holds."""

LISTENED = "listen"
"""In the place of a procedure's name: a recording of `bench listen`, which is no run and has no record."""


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """The files of one run. Only the names live here; who writes what is in the runner."""

    path: Path

    @property
    def run_id(self) -> str:
        return self.path.name

    @property
    def recording(self) -> Path:
        return self.path / "recording.mcap"

    @property
    def record(self) -> Path:
        return self.path / "record.json"

    @property
    def truth(self) -> Path:
        return self.path / "truth.json"

    @property
    def log(self) -> Path:
        return self.path / "run.log"

    @property
    def asked(self) -> Path:
        return self.path / "asked.json"

    @property
    def analyses(self) -> Path:
        return self.path / "analyses"


def stamp(at: datetime) -> str:
    """A time as file names carry it: UTC, `yyyymmddThhmmssZ`, no colon."""
    return at.astimezone(UTC).strftime("%Y%m%dT%H%M%SZ")


def create(out: Path, procedure: str, started: datetime) -> RunDirectory:
    """Make `<out>/<procedure>-<UTC>-<4 hex>`, which did not exist before.

    Raises:
        ConfigError: `out` is not a directory or cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        return RunDirectory(_exclusive(out, f"{procedure}-{stamp(started)}"))
    except OSError as error:
        raise ConfigError(
            f"--out {out}: no run directory can be made there: {error.strerror or error} ({error.filename}); "
            "expected a directory that can be written. Nothing was started. Next: give another --out"
        ) from error


def create_analysis(run: RunDirectory, started: datetime) -> Path:
    """Make `<run>/analyses/<UTC>`; a second analysis in the same second gets a suffix.

    Raises:
        ConfigError: the run directory cannot be written.
    """
    name = stamp(started)
    try:
        run.analyses.mkdir(exist_ok=True)
        try:
            folder = run.analyses / name
            folder.mkdir()
        except FileExistsError:
            folder = _exclusive(run.analyses, name)
    except OSError as error:
        raise ConfigError(
            f"{run.analyses}: no analysis can be written there: {error.strerror or error}; the run itself is untouched"
        ) from error
    return folder


def _exclusive(parent: Path, stem: str) -> Path:
    import secrets  # with what it needs of cryptography 5 ms: whoever only reads runs has no use for it

    for _ in range(64):
        path = parent / f"{stem}-{secrets.token_hex(2)}"
        try:
            path.mkdir()
        except FileExistsError:
            continue
        return path
    raise ConfigError(f"{parent}: 64 names {stem}-xxxx are taken; expected a free one. Next: give another --out")


def existing(path: Path) -> RunDirectory:
    """The run directory at `path`.

    Raises:
        ConfigError: there is none: no such directory, or it holds neither a recording nor a record.
    """
    run = RunDirectory(path.resolve())
    if not path.is_dir():
        found = "a file" if path.exists() else "nothing"
        raise ConfigError(f"{path}: found {found}; expected a run directory. Next: `bench runs` lists them")
    if not (run.recording.is_file() or run.record.is_file()):
        raise ConfigError(
            f"{path}: found a directory with neither recording.mcap nor record.json; expected a run directory. "
            "Next: `bench runs` lists them"
        )
    return run


def runs_in(out: Path) -> Iterator[RunDirectory]:
    """Every directory of a run directly under `out`, by name; none if `out` does not exist."""
    if not out.is_dir():
        return
    for path in sorted(out.iterdir()):
        if named_as_run(path.name) and path.is_dir():
            yield RunDirectory(path)


def named_as_run(name: str) -> bool:
    """Whether a directory of that name is a run's."""
    return NAME.fullmatch(name) is not None and not name.startswith(f"{LISTENED}-")
