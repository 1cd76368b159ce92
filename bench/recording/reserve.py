"""Room on the disk that is kept for a run's last words: on a full one nothing could be written that says so."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from bench.errors import ConfigError

SIZE: Final = 2_000_000
"""Bytes: a record and a log that tell how the run ended. A record has some hundred thousand."""
NAME: Final = ".reserve"


@contextmanager
def reserved(folder: Path, size: int = SIZE) -> Iterator[Callable[[], None]]:
    """Take `size` bytes of the disk for the block, or until the function that it gets is called.

    Raises:
        ConfigError: there is no such room.
    """
    path = folder / NAME
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        path.unlink()  # the room stays taken as long as it is open, and no longer, also where the process is killed
        _fill(descriptor, size)
    except OSError as error:
        raise ConfigError(
            f"{folder}: found no room for {size / 1e6:g} MB: {error.strerror or error}; nothing was started. "
            "Next: free space there, or give another --out"
        ) from error
    file = os.fdopen(descriptor, "wb")
    try:
        yield file.close
    finally:
        file.close()


def _fill(descriptor: int, size: int) -> None:
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, 0, size)  # no byte is written where the file system can do without
    else:
        os.write(descriptor, bytes(size))
