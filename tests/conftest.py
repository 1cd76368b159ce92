"""Every test leaves the process as it found it: no thread, child process or socket of its own stays behind."""

from __future__ import annotations

import gc
import os
import signal
import threading
from collections.abc import Generator, Iterator
from typing import Any

import groups
import pytest
from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Before anything loads numpy, and for every process that a test starts: the threads of a small product only wait."""
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.register_profile("search", max_examples=2000, deadline=None)
settings.load_profile("repeatable")
"""The same examples in every run: a check that is green stays green. `make fuzz` looks for new ones."""
if hasattr(
    signal, "SIGHUP"
):  # where the tests themselves were started to outlive a terminal, what they start must not be
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
GRACE_S = 2.0  # for a thread that was told to end and is on its way


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """For `--dist loadgroup`, which `make test` asks for."""
    return groups.scheduler(config, log) if config.getvalue("dist") == "loadgroup" else None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Half a million objects are made, and nearly all stay: looking for garbage among them takes a third of it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Tests in real time have the processor first."""
    groups.give_way(item.nodeid)


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
    for thread in _listed("/proc/self/task"):
        try:
            with open(f"/proc/self/task/{thread}/children", encoding="ascii") as listing:
                found.update(listing.read().split())
        except OSError:  # that thread has ended meanwhile
            continue
    return found


def _listed(folder: str) -> list[str]:
    """Twice a test: without the objects that `pathlib` makes of every entry."""
    return os.listdir(folder) if os.path.isdir(folder) else []


def _sockets() -> set[str]:
    found: set[str] = set()
    for descriptor in _listed("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{descriptor}")
        except OSError:
            continue
        if target.startswith("socket:"):
            found.add(target)
    return found
