"""Heartbeats ask to run before other programs, and say so where the system refuses."""

from __future__ import annotations

import subprocess
import sys

import pytest
from heartbeat_ports import socket_port

from bench.cli.opening import _priority
from drivers.heartbeat import ROOT, Beat, HeartbeatProcess, WriterSpec
from drivers.live_link import LiveLink

ASK = """
import os, resource, sys
from drivers import portable
if sys.argv[1] == "nobody":
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    if os.getuid() == 0:
        os.setuid(65534)
said = portable.prefer_this_thread(nice=True)
print("first" if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO else "as any other")
print(said or "granted")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="schedulers of Linux")
@pytest.mark.parametrize("who", ["us", "nobody"])
def test_what_is_said_of_the_priority_is_what_the_system_gives(who: str) -> None:
    found = subprocess.run([sys.executable, "-c", ASK, who], cwd=ROOT, capture_output=True, text=True, check=True)
    place, said = found.stdout.splitlines()
    assert (place == "first") == (said == "granted")
    assert who == "us" or said == "Operation not permitted"


def test_the_process_tells_what_it_was_granted() -> None:
    with socket_port() as (_, port):
        heart = HeartbeatProcess(Beat(0x010, bytes(8), range(32, 48), True), WriterSpec("slcan", port.fileno()))
        try:
            assert heart.unpreferred in ("", "Operation not permitted")
        finally:
            heart.close()


class Refused(LiveLink):
    """A link whose heartbeats were refused."""

    def __init__(self, why: str) -> None:
        self._name, self._why = "controller", why

    @property
    def unpreferred(self) -> str:
        return self._why


def test_a_record_says_when_heartbeats_run_like_any_other_program() -> None:
    assert _priority(Refused("")) == []
    (note,) = _priority(Refused("Operation not permitted"))
    assert (note.code, note.effect.value, note.where) == ("heartbeat-unprioritised", "note", "controller")
    assert "Operation not permitted" in note.text
