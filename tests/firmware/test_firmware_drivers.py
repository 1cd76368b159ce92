"""The C program of the protocol page against the bench's own drivers, over SLCAN and over packets."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from bench.cli.opening import beat_of
from bench.clock import WallClock
from bench.errors import BenchError, ConfigError, LinkError
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from bench.run.job import WatchedClock
from drivers.controller import Controller
from drivers.live_link import LiveLink
from drivers.wires import open_wire

RIG = load_rig("tsbs12")
DEADLINE_S = 20.0


@dataclass(frozen=True)
class Bench:
    """The drivers' end of the program's pseudo terminal, put together as `bench run` does it."""

    rig: RigFile
    link: LiveLink
    clock: WatchedClock

    def controller(self, session: Session) -> Controller:
        return Controller(self.rig, self.link, self.clock, session, 0.02)


FIRST, SECOND = Session(0xA1B2C3D4, 1_767_225_600, "lab@bench7"), Session(0x11223344, 0, "else@where")


@pytest.fixture(params=["slcan", "packets"])
def bench(program: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    with ExitStack() as stack:
        child = stack.enter_context(
            subprocess.Popen([program, request.param], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        )
        assert child.stdin
        assert child.stdout
        stack.callback(child.stdin.close)
        path = child.stdout.readline().strip()
        url = f"slcan:{path}" if request.param == "slcan" else f"serial:{path}"
        rig = RIG.model_copy(update={"links": {**RIG.links, "controller": RIG.link.model_copy(update={"url": url})}})
        known = [m.identifier for m in rig.messages.messages.values()]
        beat = replace(beat_of(rig, FIRST), lease_s=0.4)
        link = LiveLink("controller", lambda: open_wire(rig.link, "controller", known), beat)
        stack.callback(link.close)
        yield Bench(rig, link, WatchedClock(WallClock(), link.renew_lease, lambda _: None))


def test_a_run(bench: Bench) -> None:
    c = bench.controller(FIRST)
    c.connect()
    c.set("watchdog_s", 1.0)  # so that a busy machine is no dead host
    assert c.get("watchdog_s") == 1.0
    c.telemetry.start_counting()
    c.enable()
    assert c.mode == "READY"
    c.levitate()
    now = c.telemetry.latest
    assert (now["pos_yi"], now["i_yo_p"], now["supply"], now["flags"]) == (0.0, 4.0, 148.0, 16.0)
    with pytest.raises(BenchError, match="refuses bias_i = 2 A: WRONG_STATE"):
        c.set("bias_i", 2.0)
    c.land()
    c.disable()
    c.release()
    n, stats = c.telemetry.counters, bench.link.stats
    assert (n.lost, n.duplicates, n.reordered, n.wrong_length, n.unknown, n.reboots) == (0, 0, 0, 0, 0, 0)
    assert (stats.crc_errors, stats.malformed, stats.refused, stats.packets_lost) == (0, 0, 0, 0)


def test_a_second_session_is_refused_by_name(bench: Bench) -> None:
    bench.controller(FIRST).connect()
    with pytest.raises(ConfigError, match=r"its controller obeys lab@bench7, session 0xa1b2c3d4, since 2026-01-01"):
        bench.controller(SECOND).connect()


def test_a_host_that_dies(bench: Bench) -> None:
    c = bench.controller(FIRST)
    c.connect()
    c.set("watchdog_s", 0.5)
    c.enable()
    c.levitate()
    c.guarded = False
    bench.clock.renewing = False  # heartbeats end when the lease does
    seen = set()

    def landed() -> bool:
        seen.add(c.mode)
        return c.mode == "FAULT"

    c.wait(landed, DEADLINE_S, LinkError("it did not land"))
    assert "READY" not in seen
    assert c.fault == "HEARTBEAT_LOST"
    bench.clock.renewing = True
    c.connect()
    assert c.cleared == "HEARTBEAT_LOST"
    assert c.mode == "OFF"
