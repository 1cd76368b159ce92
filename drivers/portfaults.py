"""What a byte stream's failures are called: from the system's error to what was found, expected, and the next step."""

from __future__ import annotations

import contextlib
import difflib
import errno
import os
import socket
from collections.abc import Callable
from pathlib import Path

from bench.errors import ConfigError, LinkError

BUSY = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)
ABSENT = (errno.ENOENT, errno.ENXIO, errno.ENODEV)


def lost(where: str, error: BaseException) -> LinkError:
    """A stream that was open and is not any more."""
    return LinkError(f"port {where} was unplugged or its other end closed ({_reason(error)})")


def full(where: str, seconds: float) -> LinkError:
    """A stream whose other end takes nothing."""
    return LinkError(f"port {where} takes no data for {seconds:g} s: its other end does not read")


def not_connected(where: str, error: Exception) -> ConfigError:
    """A TCP endpoint that does not answer."""
    if isinstance(error, ConnectionRefusedError):
        found, step = "nobody listens there", "start `bench serve` or the device server, or correct the link's URL"
    elif isinstance(error, socket.gaierror):
        found, step = "no host of that name", "correct the link's URL"
    elif isinstance(error, TimeoutError):
        found, step = "no answer", "check address, network and firewall"
    else:
        found, step = _reason(error), "check the link's URL"
    return ConfigError(f"port {where}: {found}; {step}")


def not_opened(where: str, baudrate: int, error: Exception, devices: Callable[[], list[str]]) -> ConfigError:
    """A serial port that cannot be opened; `devices` lists those that this machine has."""
    number = error.errno if isinstance(error, OSError) else None
    if number in BUSY or (number is None and "PermissionError" in str(error)):  # the latter is how Windows says it
        owner = owner_of(where)
        what = f"it is in use by {owner}" if owner else "it is in use by another process"
        return ConfigError(f"port {where}: {what}; end that process, or name another port in the link's URL")
    if number in (errno.EACCES, errno.EPERM):
        return ConfigError(f"port {where}: no permission to open it; {_permission(where)}")
    if number in ABSENT or (number is None and "could not open port" in str(error) and "://" not in where):
        return ConfigError(f"port {where}: found no such device; {_alternatives(where, devices())}")
    if isinstance(error, ValueError) and "://" in where:
        return ConfigError(f"port {where}: {error}; expected a device, socket://HOST:PORT or rfc2217://HOST:PORT")
    if isinstance(error, ValueError) or number == errno.EINVAL:
        return ConfigError(f"port {where}: it does not do {baudrate} Bd ({_reason(error)}); set another baudrate")
    if "configure port" in str(error) or number in (errno.ENOTTY, errno.EISDIR):
        return ConfigError(f"port {where}: found something that is no serial port; {_alternatives(where, devices())}")
    return ConfigError(f"port {where}: {_reason(error)}; check the link's URL")


def owner_of(where: str) -> str:
    """The process that holds a device, where /proc tells; empty where it does not. The one that has locked it, else one
    that has it open: whoever serves a pty has it open as well."""
    device = os.path.realpath(where)
    users = [*_locking(device), *(f.name for f in Path("/proc").glob("[0-9]*") if _has_open(f, device))]
    if not users:
        return ""
    if users[0] == str(os.getpid()):
        return "this process"
    command = ""
    with contextlib.suppress(OSError):  # it has ended meanwhile
        command = Path("/proc", users[0], "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    return f"process {users[0]} ({command[:80]})"


def _locking(device: str) -> list[str]:
    """Process ids of those that hold a lock on a file: `1: FLOCK ADVISORY WRITE 4711 00:18:5 0 EOF`."""
    with contextlib.suppress(OSError):
        s = os.stat(device)
        file = f"{os.major(s.st_dev):02x}:{os.minor(s.st_dev):02x}:{s.st_ino}"
        lines = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
        return [f[4] for f in lines if len(f) > 5 and f[5] == file and int(f[4]) > 0]
    return []


def _has_open(folder: Path, device: str) -> bool:
    with contextlib.suppress(OSError):  # processes end, and others' are not ours to look at
        return any(os.path.realpath(fd) == device for fd in (folder / "fd").iterdir())
    return False


def _reason(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text)


def _permission(where: str) -> str:
    with contextlib.suppress(ImportError, OSError, KeyError):
        import grp  # not there on Windows

        group = grp.getgrgid(os.stat(where).st_gid).gr_name
        return f"it belongs to the group {group}: `sudo usermod -a -G {group} $USER`, then log in again"
    return "another program may hold it, or your user may not use it"


def _alternatives(where: str, found: list[str]) -> str:
    if not found:
        return "there are no serial ports on this machine; is the adapter plugged in?"
    close = difflib.get_close_matches(where, found, 1)
    return f"did you mean {close[0]}?" if close else f"expected one of {', '.join(found)}"
