"""A line of the command line, understood by the library that the commands are declared with."""

from __future__ import annotations

import copy
import difflib
import re
from typing import Any

import typer
from typer.models import CommandInfo

from bench.cli.status import USAGE, ended
from bench.errors import Aborted

INTERRUPTED = 130  # what the library makes of Ctrl-C


def run_app(app: typer.Typer, arguments: list[str]) -> int:
    """Run one command of an application; returns its exit status, whatever goes wrong in it."""
    return ended(lambda: _dispatch(app, arguments))


def _dispatch(app: typer.Typer, arguments: list[str]) -> int:
    command = typer.main.get_command(_asked(app, arguments))
    try:
        status: Any = command.main(arguments, prog_name="bench", standalone_mode=False)
    except typer.Exit as stop:
        return int(stop.exit_code)
    except typer.Abort as stop:
        raise Aborted(str(stop)) from stop
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


def _asked(app: typer.Typer, arguments: list[str]) -> typer.Typer:
    """The application with that command alone which is asked for, where it has such a one: to make the others of their
    declarations takes as long as a short command does."""
    named = [c for c in app.registered_commands if arguments[:1] == [_name(c)]]
    if not named:
        return app
    alone = copy.copy(app)
    alone.registered_commands = named
    return alone


def _name(command: CommandInfo) -> str | None:
    return command.name or (command.callback and typer.main.get_command_name(command.callback.__name__))


def _nearest(told: str) -> str:
    """A message of the library that a choice is none, in our words, with the nearest one."""
    found = re.search(r"'([^']*)' is not one of (.*)\.$", told)
    if found is None:
        return told
    close = difflib.get_close_matches(found[1], re.findall(r"'([^']*)'", found[2]), 1)
    return told.removeprefix("Value error, ") + (f" Did you mean {close[0]!r}?" if close else "")
