"""Telemetry whose counters or readings stand, while a run goes on; and somebody else's heartbeats."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hostile_controller import AMB, TSBS, Bench, Telemetry, unchanged

from bench.errors import AnotherHost, DeviceFault, FrozenError
from bench.link.frames import ERROR, FrameBatch, frame
from bench.rigfile import RigFile
from drivers.hosts import ECHO, RATE, HostFrames

PLAIN = RigFile.parse(TSBS.toml_text, TSBS.dbc_text.replace(" SG_ session : 0|32@1+", " SG_ someone : 0|32@1+", 1))


@pytest.mark.parametrize(
    ("frozen", "stands"), [(("tick",), "tick"), (("seq",), "sequence"), (("tick", "seq"), "tick and sequence")]
)
def test_a_counter_that_stands_for_a_second_ends_the_run_by_its_name(frozen: tuple[str, ...], stands: str) -> None:
    bench = Bench()
    bench.link.change = Telemetry(TSBS, frozen=frozen, stuck=False)
    bench.controller.clock.sleep(0.8)
    with pytest.raises(FrozenError, match=f"telemetry is frozen: frames come, but the controller's {stands} has stood"):
        bench.controller.clock.sleep(0.6)


def test_a_code_without_a_name_that_comes_for_less_than_a_second_ends_nothing() -> None:
    bench = Bench()
    strange = Telemetry(TSBS, {"state": 42.0}, frozen=(), stuck=False)
    for _ in range(3):
        bench.link.change = strange
        bench.controller.clock.sleep(0.6)
        bench.link.change = unchanged
        bench.controller.clock.sleep(0.3)
    bench.link.change = strange
    with pytest.raises(DeviceFault, match="its state is 42, which its DBC does not name"):
        bench.controller.clock.sleep(1.3)


def test_readings_that_stand_while_the_tick_runs_are_stuck_channels() -> None:
    bench = Bench()
    bench.controller.clock.sleep(1.5)
    assert bench.controller.watch.stuck.found == set()
    bench.link.change = Telemetry(TSBS, frozen=("pos_yi", "i_yo_p", "i_m1", "supply", "temp_i"), stuck=False)
    bench.controller.clock.sleep(0.9)
    assert bench.controller.watch.stuck.found == set()
    bench.controller.clock.sleep(0.3)
    assert bench.controller.watch.stuck.found == {"pos_yi", "i_yo_p", "i_m1"}


def test_a_rotor_at_rest_may_read_the_same() -> None:
    bench = Bench()
    bench.controller.land()
    bench.link.change = Telemetry(TSBS, frozen=("pos_yi",), stuck=False)
    bench.controller.clock.sleep(2.0)
    assert bench.controller.watch.stuck.found == set()


def test_coarse_counts_are_not_stuck() -> None:
    """A rig that states less noise than a count, or none, is not accused."""
    quiet = TSBS.toml_text.replace("noise = 5e-8", "noise = 1.9e-8").replace(", noise = 1.5e-3", "")
    bench = Bench(RigFile.parse(quiet, TSBS.dbc_text))
    bench.link.change = Telemetry(TSBS, frozen=("pos_yi", "i_yo_p"), stuck=False)
    bench.controller.clock.sleep(2.0)
    assert bench.controller.watch.stuck.found == set()


def heartbeat(session: int, counter: int, t_ns: int = 0) -> FrameBatch:
    return frame(0x010, struct.pack("<IHH", session, counter, 0), t_ns=t_ns)


def test_a_heartbeat_of_another_session_ends_the_run() -> None:
    bench = Bench(AMB)
    bench.link.change = lambda batch: np.concatenate([batch, heartbeat(1, 7)])  # our own, back from the bus
    bench.controller.clock.sleep(0.5)
    bench.link.change = lambda batch: np.concatenate([batch, heartbeat(0xDEADBEEF, 7)])
    with pytest.raises(AnotherHost, match=r"another host \(session 0xDEADBEEF\) sends heartbeats"):
        bench.controller.clock.sleep(0.2)


def hosts(sent: list[int]) -> HostFrames:
    """Of a controller whose heartbeats tell no session."""
    return HostFrames(PLAIN, 1, lambda: sent[-1])


def test_without_sessions_another_host_shows_by_its_rate() -> None:
    sent = [0]
    watch = hosts(sent)
    for n in range(64_500, 66_500):  # each of ours comes back once, some late; the counter wraps
        sent.append(n)
        watch.marked(heartbeat(0, (n - 2 * (n % 3)) & 0xFFFF, n * 20_000_000))
        watch.check()
    for k in range(RATE):
        watch.check()
        watch.marked(heartbeat(0, (sent[-1] + 5000 + k) & 0xFFFF, 70_000 * 20_000_000 + k * 20_000_000))
    with pytest.raises(AnotherHost, match="10 that are not ours came within a second"):
        watch.check()


def test_stray_heartbeats_are_no_host() -> None:
    watch = hosts([1000])
    for k in range(100):  # one in a fifth of a second
        watch.marked(heartbeat(0, 5000 + k, k * 200_000_000))
        watch.check()


def test_destroyed_frames_are_no_hosts_whatever_their_identifier() -> None:
    """That of an error frame is a class of errors, which may be that of a message."""
    watch = hosts([1000])
    for k in range(2 * RATE):
        destroyed = heartbeat(0, 5000 + k, k * 20_000_000)
        destroyed["flags"] |= ERROR
        assert watch.marked(destroyed)["flags"].tolist() == [ERROR]
    watch.check()
    assert watch.seen == set()


def test_an_echo_counts_once() -> None:
    """A second one with the same counter is somebody else's."""
    watch = hosts([ECHO])
    for k in range(RATE):
        for _ in range(2):
            watch.marked(heartbeat(0, 50 + k, k * 20_000_000))
    with pytest.raises(AnotherHost):
        watch.check()
