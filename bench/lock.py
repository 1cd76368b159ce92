"""One bench per rig, one writer of a recording: a lock on a file, which the kernel frees with the process however that ends.

The file's text names the owner and the start, for the message that a second bench gives. The file itself stays: to
remove it would let two processes hold "the" lock on different files.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import re
import socket
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from bench.errors import ConfigError

LOCKED_BYTE = 1 << 30  # past the text, so that Windows, whose locks forbid reading, lets others read it
TEXT_LIMIT = 500


def lock_path(rig: str, directory: Path | None = None) -> Path:
    """Where the lock of a rig lies: the same file for every user and working directory of this host.

    `rig` is what makes the rig one thing: its name and the addresses of its links.
    """
    folder = directory if directory is not None else Path(tempfile.gettempdir()) / "levbench-locks"
    readable = re.sub(r"[^A-Za-z0-9_-]+", "-", rig)[:40]
    return folder / f"{readable}-{hashlib.sha256(rig.encode()).hexdigest()[:12]}.lock"


@contextmanager
def rig_lock(rig: str, directory: Path | None = None) -> Iterator[Path]:
    """Hold the lock of a rig for the block.

    Raises:
        ConfigError: another process holds it (the text says who and since when), or the file cannot be made.
    """
    path = lock_path(rig, directory)
    try:
        descriptor = _open(path)
    except OSError as error:
        raise ConfigError(f"lock file {path} cannot be opened: {error.strerror}; expected a writable folder") from error
    try:
        if not _try_lock(descriptor):
            holder = os.read(descriptor, TEXT_LIMIT).decode("utf-8", "replace").strip() or "an unnamed process"
            raise ConfigError(
                f"rig {rig} is in use by {holder}; expected one bench per rig. Next: wait for that run or stop it"
            )
        os.ftruncate(descriptor, 0)
        os.write(descriptor, _owner().encode()[:TEXT_LIMIT])
        yield path
    finally:
        os.close(descriptor)


def hold(descriptor: int) -> None:
    """Hold a file that is being written until it is closed or the process ends; `is_held` says so to others."""
    _try_lock(descriptor)


def is_held(path: Path) -> bool:
    """Whether a process holds a file.

    Raises:
        OSError: it cannot be opened.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    try:
        return not _try_lock(descriptor)
    finally:
        os.close(descriptor)


def _open(path: Path) -> int:
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.parent.chmod(0o1777)  # shared by users, as the temporary directory itself is
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
    descriptor = os.open(path, flags, 0o666)
    if hasattr(os, "fchmod") and os.fstat(descriptor).st_uid == os.getuid():
        os.fchmod(descriptor, 0o666)  # the umask would keep other users from asking who holds it
    return descriptor


def _owner() -> str:
    started = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # no name for this user id
        user = "unknown user"
    return f"{user} on {socket.gethostname()}, process {os.getpid()}, since {started}"


if sys.platform == "win32":
    import msvcrt

    def _try_lock(descriptor: int) -> bool:
        os.lseek(descriptor, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
        return True

else:
    import fcntl

    def _try_lock(descriptor: int) -> bool:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
