"""From what a command returns or raises to the exit status and a line for the user.

0 PASS, DONE    1 FAIL    2 usage or configuration    3 ERROR    4 ABORTED    5 INDETERMINATE
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

from bench.errors import Aborted, BenchError, ConfigError

USAGE, ERROR, ABORTED = 2, 3, 4
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def ended(act: Callable[[], int]) -> int:
    """Do what a command does; returns its exit status, whatever goes wrong in it."""
    status = _status(act)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read our output stopped reading, as `head` does; the interpreter must not flush into it again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _status(act: Callable[[], int]) -> int:
    try:
        return act()
    except ConfigError as error:
        return _told(str(error), USAGE)
    except (Aborted, KeyboardInterrupt) as error:
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


def _told(text: str, status: int) -> int:
    sys.stderr.write(f"bench: {text}\n")
    sys.stderr.flush()
    return status
