"""From what a command returns or raises to the exit status and a line for the user.

0 PASS, DONE    1 FAIL    2 usage or configuration    3 ERROR    4 ABORTED    5 INDETERMINATE
"""

from __future__ import annotations

import difflib
import errno
import os
import re
import sys
import traceback
from pathlib import Path
from typing import Any

import typer

from bench.errors import Aborted, BenchError, ConfigError

USAGE, ERROR, ABORTED = 2, 3, 4
INTERRUPTED = 130  # what the library makes of Ctrl-C
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def run_app(app: typer.Typer, arguments: list[str]) -> int:
    """Run one command of an application; returns its exit status, whatever goes wrong in it."""
    status = _status(app, arguments)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read our output stopped reading, as `head` does; the interpreter must not flush into it again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _status(app: typer.Typer, arguments: list[str]) -> int:
    try:
        return _dispatch(app, arguments)
    except ConfigError as error:
        return _told(str(error), USAGE)
    except (Aborted, KeyboardInterrupt, typer.Abort) as error:
        return _told(str(error) or "stopped", ABORTED)
    except BenchError as error:
        return _told(str(error), ERROR)
    except BrokenPipeError:
        return ERROR
    except OSError as error:
        next_step = ". Next: free space there, and try again" if error.errno in FULL else ""
        return _told(f"{error.filename or 'a file'}: {error.strerror or error}{next_step}", ERROR)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        return _told(f"unexpected {type(error).__name__} in {place}: {error}; please report it", ERROR)


def _dispatch(app: typer.Typer, arguments: list[str]) -> int:
    command = typer.main.get_command(app)
    try:
        status: Any = command.main(arguments, prog_name="bench", standalone_mode=False)
    except typer.Exit as stop:
        return int(stop.exit_code)
    except Exception as error:
        # The library's usage errors have no public common class across its versions, but they all can show themselves.
        show = getattr(error, "show", None)
        if show is None or not hasattr(error, "format_message"):
            raise
        if isinstance(told := getattr(error, "message", None), str):
            error.message = _nearest(told)  # type: ignore[attr-defined]
        show()
        return USAGE
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    return status if isinstance(status, int) else 0


def _told(text: str, status: int) -> int:
    sys.stderr.write(f"bench: {text}\n")
    sys.stderr.flush()
    return status


def _nearest(told: str) -> str:
    """A message of the library that a choice is none, in our words, with the nearest one."""
    found = re.search(r"'([^']*)' is not one of (.*)\.$", told)
    if found is None:
        return told
    close = difflib.get_close_matches(found[1], re.findall(r"'([^']*)'", found[2]), 1)
    return told.removeprefix("Value error, ") + (f" Did you mean {close[0]!r}?" if close else "")
