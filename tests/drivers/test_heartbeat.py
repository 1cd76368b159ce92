"""The heartbeat process, seen from the other end of real sockets and ptys."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from heartbeat_ports import (
    Far,
    child_of,
    counter,
    descriptors,
    frames,
    metronome,
    pty_port,
    running,
    socket_port,
    tcp_port,
    wait_for,
)  # fmt: skip

from bench.errors import ConfigError, LinkError
from bench.link.frames import FD, empty_batch, frame, payload
from bench.wire import packet
from drivers import heartbeat
from drivers.heartbeat import Beat, HeartbeatProcess, WriterSpec

BEAT = Beat(0x010, bytes(8), range(32, 48), fd=True, period_s=0.01, lease_s=1.0)
SHORT = replace(BEAT, lease_s=0.05)  # five heartbeats
ENDLESS = replace(BEAT, lease_s=1000.0)


@pytest.fixture
def passes() -> Iterator[Callable[[int], None]]:
    with metronome() as passes:
        yield passes


@pytest.fixture
def pty() -> Iterator[tuple[int, int]]:
    with pty_port() as ends:
        yield ends


def test_heartbeats_arrive_on_a_pty(pty: tuple[int, int]) -> None:
    master, slave = pty
    with running(BEAT, WriterSpec("slcan", slave)) as heart:
        assert heart.owns_port
        assert Far(master).beats(10, heart.renew_lease) == list(range(1, 11))
        beats, sent, gap_ns = heart.counts()
        assert beats >= 10
        assert sent == 0
        assert gap_ns >= 10_000_000
        assert heart.fault is None


def test_heartbeats_arrive_over_tcp_with_bit_rate_switch() -> None:
    with tcp_port() as (far, port), running(BEAT, WriterSpec("slcan", port.fileno(), brs=True)) as heart:
        assert far.units(2, heart.renew_lease) == [b"b01080000000001000000", b"b01080000000002000000"]


def test_nothing_is_sent_before_the_first_renewal(passes: Callable[[int], None]) -> None:
    with socket_port() as (far, port), running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
        passes(10)
        assert far.waiting() == []
        assert heart.counts()[0] == 0
        heart.renew_lease()
        assert far.beats(1) == [1]


def test_silent_when_the_lease_lapses_and_back_without_a_burst(passes: Callable[[int], None]) -> None:
    with socket_port() as (far, port), running(SHORT, WriterSpec("slcan", port.fileno())) as heart:
        seen = 0
        for _ in range(2):
            counters = far.beats(1, heart.renew_lease)
            passes(30)
            counters += [counter(line) for line in far.waiting()]
            assert len(counters) <= 5  # as many as one lease is good for, whatever was missed before
            assert counters == list(range(seen + 1, seen + 1 + len(counters)))
            seen += len(counters)
            passes(5)
            assert far.waiting() == []


def test_frames_and_heartbeats_share_the_line_in_order() -> None:
    with tcp_port() as (far, port), running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
        far.beats(1, heart.renew_lease)
        heart.send(frames(70))
        heart.send_bytes(b"F\r")
        heart.send(frames(70, first=70))
        found: list[bytes] = []
        while len(found) < 141:
            found += [line for line in far.units(1, heart.renew_lease) if not line.startswith(b"d010")]
        lines = [b"d0118%016X" % number for number in range(140)]
        assert found == [*lines[:70], b"F", *lines[70:]]
        assert heart.counts()[1] == 140  # the request is no frame


def test_packet_numbers_run_on_over_heartbeats_frames_and_ports() -> None:
    with tcp_port() as (first, port), tcp_port() as (second, other):
        first, second = Far(first._fileno, b"\0"), Far(second._fileno, b"\0")
        with running(BEAT, WriterSpec("packet", port.fileno())) as heart:
            found: list[packet.Packet] = []

            def until(far: Far, counts: dict[int, int]) -> None:
                at = len(found)
                while any([m[0] for p in found[at:] for m in p.messages].count(i) < n for i, n in counts.items()):
                    found.extend(packet.unpack(unit) for unit in far.units(1, heart.renew_lease))

            until(first, {0x010: 2})
            heart.send(frames(120))
            until(first, {0x010: 2, 0x011: 120})
            heart.replace_port(None)
            found += [packet.unpack(unit) for unit in first.waiting()]
            heart.replace_port(other.fileno())
            heart.send(frames(5, first=120))
            until(second, {0x010: 2, 0x011: 5})
    assert [p.sequence for p in found] == list(range(len(found)))
    assert {p.tick for p in found} == {0}
    messages = [m for p in found for m in p.messages]
    assert [data for i, data in messages if i == 0x011] == [payload(f) for f in frames(125)]
    counters = [int.from_bytes(data[4:6], "little") for i, data in messages if i == 0x010]
    assert counters == list(range(1, len(counters) + 1))


def test_the_port_can_be_given_back_and_replaced() -> None:
    with socket_port() as (first, port), tcp_port() as (second, other):
        with running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
            first.beats(2, heart.renew_lease)
            heart.replace_port(None)
            port.close()
            first.end()  # nobody else has it any more
            assert heart.fault == "the port was given back"
            with pytest.raises(LinkError, match="given back"):
                heart.send(frames(1))
            before = heart.counts()[0]
            heart.replace_port(other.fileno())
            assert second.beats(2, heart.renew_lease) == [before + 1, before + 2]
            assert heart.fault is None


def test_a_pty_that_is_closed_is_a_fault_until_it_is_replaced(pty: tuple[int, int]) -> None:
    master, slave = pty
    with running(BEAT, WriterSpec("slcan", slave)) as heart, socket_port() as (far, other):
        Far(master).beats(1, heart.renew_lease)
        os.close(master)
        wait_for(lambda: heart.fault is not None, heart.renew_lease)
        assert "unplugged or its other end closed" in str(heart.fault)
        with pytest.raises(LinkError, match="unplugged"):
            heart.send(frames(1))
        with pytest.raises(LinkError, match="unplugged"):
            heart.send_bytes(b"F\r")
        before = heart.counts()[0]
        heart.replace_port(other.fileno())
        assert far.beats(1, heart.renew_lease) == [before + 1]
        heart.send(empty_batch())
        assert heart.fault is None


def test_frames_for_the_old_port_do_not_go_to_the_new_one() -> None:
    with socket_port() as (_, port), tcp_port() as (far, other):
        with running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
            heart.send(frames(300))  # nobody reads: most of them wait
            heart.replace_port(other.fileno())
            heart.send(frames(2, first=300))
            assert far.units(2) == [b"d0118%016X" % number for number in (300, 301)]


def test_a_closed_pty_shows_when_only_frames_are_sent(pty: tuple[int, int]) -> None:
    master, slave = pty
    with running(BEAT, WriterSpec("slcan", slave)) as heart:
        os.close(master)

        def refused() -> bool:
            try:
                heart.send(frames(1))
            except LinkError:
                return True
            return False

        wait_for(refused, lambda: None)


def test_a_full_port_drops_heartbeats_and_hangs_nobody(
    pty: tuple[int, int], passes: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    master, slave = pty
    os.set_blocking(slave, False)
    while select.select([], [slave], [], 0.1)[1]:  # the kernel moves bytes on for a while
        with suppress(BlockingIOError):
            while True:
                os.write(slave, b".")
    monkeypatch.setattr(heartbeat, "SEND_S", 0.01)
    with running(ENDLESS, WriterSpec("slcan", slave)) as heart:
        heart.renew_lease()
        passes(40)
        assert heart.counts()[0] == 0
        with pytest.raises(LinkError, match="taken no bytes"):  # the queue has an end
            heart.send(frames(5000))
        assert heart.fault is None
        far = Far(master)
        first, *others = far.units(200)
        assert counter(first.lstrip(b".")) == 1  # made now, not twenty periods ago, and before the frames
        sent = [line for line in others if line.startswith(b"d011")]
        assert sent[:50] == [b"d0118%016X" % number for number in range(50)]
        heart.renew_lease()
        heart.send(frames(1))


def test_close_writes_what_waits_and_leaves_nothing(pty: tuple[int, int]) -> None:
    master, slave = pty
    before = descriptors()
    heart = HeartbeatProcess(ENDLESS, WriterSpec("slcan", slave))
    os.kill(child_of(heart), signal.SIGSTOP)
    heart.send(frames(300))
    heart._lines.send({"close": True})  # as close() does, while all the frames still wait
    os.kill(child_of(heart), signal.SIGCONT)
    heart.close()
    heart.close()
    os.close(slave)
    assert Far(master).end() == b"".join(b"d0118%016X\r" % number for number in range(300))
    assert heart.fault == "the link is closed"
    with pytest.raises(LinkError, match="closed"):
        heart.send(frames(1))
    with pytest.raises(LinkError, match="closed"):
        heart.replace_port(None)
    heart.renew_lease()
    assert heart.counts()[1] == 300
    assert descriptors() == before - {slave}


def test_a_killed_heartbeat_process_is_an_error() -> None:
    with socket_port() as (far, port), running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
        far.beats(1, heart.renew_lease)
        os.kill(child_of(heart), signal.SIGKILL)
        wait_for(lambda: heart.fault is not None, heart.renew_lease)
        assert "has ended" in str(heart.fault)
        with pytest.raises(LinkError, match="has ended"):
            heart.send(frames(1))
        with pytest.raises(LinkError, match="has ended"):
            heart.replace_port(port.fileno())


def test_a_process_that_does_not_answer_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heartbeat, "END_S", 0.1)
    with socket_port() as (_, port):
        heart = HeartbeatProcess(BEAT, WriterSpec("slcan", port.fileno()))
        os.kill(child_of(heart), signal.SIGSTOP)
        with pytest.raises(LinkError, match="does not answer"):
            heart.replace_port(port.fileno())
        heart.close()


@pytest.mark.parametrize(
    ("writer", "expected"),
    [
        (WriterSpec("none"), 'heartbeat = "thread"'),
        (WriterSpec("slcan"), 'heartbeat = "thread"'),
        (WriterSpec("packet"), 'heartbeat = "thread"'),
        (WriterSpec("slcan", 1 << 20), "does not start"),  # not open
        (WriterSpec("python-can", arguments={"interface": "no-such-interface"}), "cannot open.*no-such-interface"),
    ],
)
def test_a_wire_that_cannot_be_used_is_a_configuration_error(writer: WriterSpec, expected: str) -> None:
    before = descriptors()
    with pytest.raises(ConfigError, match=expected):
        HeartbeatProcess(BEAT, writer)
    assert descriptors() == before


def test_a_heartbeat_that_the_format_does_not_know_is_a_configuration_error() -> None:
    with socket_port() as (_, port), pytest.raises(ConfigError, match="9 bytes"):
        HeartbeatProcess(Beat(0x010, bytes(9), range(32, 48), fd=True), WriterSpec("slcan", port.fileno()))


@pytest.mark.parametrize("program", ["/bin/false", "/no/such/python"])
def test_a_process_that_does_not_start_is_a_configuration_error(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = descriptors()
    monkeypatch.setattr(sys, "executable", program)
    with socket_port() as (_, port), pytest.raises(ConfigError, match="does not start"):
        HeartbeatProcess(BEAT, WriterSpec("slcan", port.fileno()))
    assert descriptors() == before


def test_a_bus_of_python_can_has_the_heartbeats_of_the_process() -> None:
    arguments = {"interface": "virtual", "channel": "x"}
    with running(BEAT, WriterSpec("python-can", arguments=arguments)) as heart:
        assert not heart.owns_port
        wait_for(lambda: heart.counts()[0] >= 3, heart.renew_lease)
        heart.replace_port(None)  # opens it anew
        before = heart.counts()[0]
        wait_for(lambda: heart.counts()[0] > before, heart.renew_lease)
        assert heart.fault is None
        with pytest.raises(ValueError, match="takes lines"):
            heart.send_bytes(b"F\r")


def test_impossible_frames_are_counted_and_left_out() -> None:
    with tcp_port() as (far, port), running(BEAT, WriterSpec("slcan", port.fileno())) as heart:
        heart.send(np.concatenate([frame(0x011, bytes(9), flags=FD), frames(1)]))
        assert far.units(1) == [b"d01180000000000000000"]
        wait_for(lambda: heart.refused == 1, lambda: None)
        with pytest.raises(ValueError, match="whole lines"):
            heart.send_bytes(bytes(65))


def test_the_heartbeat_process_needs_no_numpy() -> None:
    code = "import sys, drivers.heartbeat_process; sys.exit('numpy' in sys.modules or 'can' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=heartbeat.ROOT, check=False).returncode == 0
