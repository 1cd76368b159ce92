"""The procedure that a stored run was made by: of the catalogue, or of the file that is named for it."""

from __future__ import annotations

import hashlib
import logging
import shlex
from pathlib import Path

from bench.cli.loading import executed, load_procedure
from bench.errors import BenchError, ConfigError
from bench.procedure import Origin, Procedure
from bench.procedure.origin import ATTACHED, FILE
from bench.recording import Recording
from bench.rundir import RunDirectory

logger = logging.getLogger("bench.cli")


def procedure_of(run: RunDirectory, name: str, given: str = "", command: str = "analyse") -> Procedure:
    """The procedure `name` of a run: `given` on the command line, else that of the catalogue. No file is executed because a
    recording names it.

    Raises:
        ConfigError: `given` is another procedure, or nothing here has that name; the message says what to give.
    """
    origin = _origin(run)
    if given:
        procedure = load_procedure(given)
        if procedure.name != name:
            raise ConfigError(
                f"--procedure {given}: found {procedure.name!r}; expected {name!r}, which {run.path} was made by"
            )
        if origin is not None and origin.of_file and procedure.origin != origin and not _same(procedure, origin):
            logger.warning("%s is not as it was when the run was made", given)
        return procedure
    if origin is None:
        return load_procedure(name)
    if origin.of_file:
        if (here := executed(name)) is not None and _same(here, origin):
            return here
        raise ConfigError(_named(run, name, origin, command))
    try:
        return load_procedure(name)
    except ConfigError as error:
        raise ConfigError(f"{run.path}: was made by {name!r} of the package {origin}; {error}. "
                          f"Next: `pip install {origin.name}=={origin.version}`") from error  # fmt: skip


def _same(procedure: Procedure, origin: Origin) -> bool:
    return procedure.origin is not None and procedure.origin.version == origin.version


def _origin(run: RunDirectory) -> Origin | None:
    """What a recording says of its procedure's origin, with where its file lay; None where it says nothing."""
    try:
        recording: Recording[object] = Recording.open(run.recording)  # type: ignore[type-var]
        said = Origin.parse(recording.run.get("procedure_from", ""))
        where = recording.wall.get("procedure_file", "")
    except BenchError:
        return None
    return said and Origin(said.name, said.version, path=where)


def _named(run: RunDirectory, name: str, origin: Origin, command: str) -> str:
    """What to give for a run of a procedure in one file: that file if it is there as it was, else where its text is."""
    path, words = Path(origin.path or origin.name), ["bench", command, str(run.path), "--procedure"]
    made = (
        f"{run.path}: was made by {name!r} of the file {path}, and the bench executes no file that is not named to it"
    )
    try:
        there = FILE + hashlib.sha256(path.read_bytes()).hexdigest() == origin.version
    except OSError:
        there = False
    if there:
        return f"{made}. Next: `{shlex.join([*words, str(path)])}`"
    kept = f"Recording.open(Path({str(run.recording)!r})).attachment({ATTACHED!r})"
    text = f"from pathlib import Path; from bench.recording import Recording; Path({origin.name!r}).write_text({kept})"
    written = f"python -c {shlex.quote(text)}"
    return (f"{made}. It is not there as it was then. Next: `{written}` writes what the recording kept of it, then "
            f"`{shlex.join([*words, f'./{origin.name}'])}`, or give today's file")  # fmt: skip
