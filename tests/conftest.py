"""Every test leaves the process as it found it: no thread, child process or socket of its own stays behind."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

REAL_TIME = ("tests/links", "tests/firmware", "tests/cli/test_serve", "tests/drivers/test_heartbeat",
             "tests/drivers/test_live_link", "tests/drivers/test_fieldbus_live", "serve-a-rig", "connect-a-rig")  # fmt: skip
GRACE_S = 2.0  # for a thread that was told to end and is on its way


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests whose processes keep up with wall time run one after the other, on one of the workers (`make test`)."""
    for item in items:
        if any(part in item.nodeid for part in REAL_TIME):
            item.add_marker(pytest.mark.xdist_group("real-time"))


@pytest.fixture(autouse=True)
def nothing_left_behind() -> Iterator[None]:
    """Fails the test that leaks a thread, a process or a socket."""
    threads, children, sockets = set(threading.enumerate()), _children(), _sockets()
    yield
    started = [t for t in threading.enumerate() if t not in threads]
    for thread in started:
        thread.join(GRACE_S)
    left = [f"thread {t.name}" for t in started if t.is_alive()]
    left += [f"process {pid}" for pid in sorted(_children() - children)]
    left += [f"socket {name}" for name in sorted(_sockets() - sockets)]
    if left:
        pytest.fail(f"left behind: {', '.join(left)}")


def _children() -> set[str]:
    """Process ids of our children, where the system tells (Linux)."""
    found: set[str] = set()
    for listing in Path("/proc/self/task").glob("*/children"):
        try:
            found.update(listing.read_text().split())
        except OSError:  # that thread has ended meanwhile
            continue
    return found


def _sockets() -> set[str]:
    found: set[str] = set()
    for descriptor in Path("/proc/self/fd").glob("*"):
        try:
            target = os.readlink(descriptor)
        except OSError:
            continue
        if target.startswith("socket:"):
            found.add(target)
    return found
