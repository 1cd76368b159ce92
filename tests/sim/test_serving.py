"""The loop that serves a rig, on a clock of the test's own: pacing, who hears what, pauses, faults."""

from __future__ import annotations

import os
import selectors
import socket
import struct
from collections.abc import Callable, Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from serving_clients import MS, PATIENCE_S, SECOND, T0, Bus, address_of

from bench.link.packetstream import PacketStream
from bench.wire import sign, slcan
from sim_backend.serving import connection as connections
from sim_backend.serving import loop
from sim_backend.serving.pacing import DEBT_NS, TICK_NS, Pacer
from sim_backend.serving.ports import Port


@settings(deadline=None)
@given(steps=st.lists(st.integers(0, 300 * MS), max_size=40))
def test_bench_time_follows_wall_time_and_is_made_up_after_every_pause(steps: list[int]) -> None:
    pacer, now, since = Pacer(T0), T0, 0
    for step in steps:
        now += step
        since += pacer.due(now)
        assert pacer.bench_ns() <= now
        if pacer.drops:
            return
    for _ in range(6000):
        now += 2 * MS
        since += pacer.due(now)
    assert pacer.drops == 0
    assert since == pacer.ticks
    assert 0 <= now - T0 - pacer.ticks * TICK_NS < TICK_NS


@settings(deadline=None)
@given(pause=st.integers(0, 9990 * MS))
def test_it_catches_up_slowly_enough_for_a_watchdog_that_heartbeats_of_wall_time_keep_quiet(pause: int) -> None:
    pacer, now = Pacer(T0), T0 + pause
    first = pacer.due(now)
    assert first * TICK_NS <= 7.5 * MS
    for _ in range(50):  # two heartbeats of 20 ms lie ten slices apart
        ten = 0
        for _ in range(10):
            now += 2 * MS
            ten += pacer.due(now)
        assert ten * TICK_NS <= 20 * MS * 3 // 2 + 7.5 * MS


def test_a_late_slice_is_an_overrun_and_a_debt_over_ten_seconds_is_given_up_and_counted() -> None:
    pacer = Pacer(T0)
    pacer.due(T0 + 2 * MS)
    pacer.due(T0 + 24 * MS)  # 20 ms late: not yet
    assert (pacer.overruns, pacer.worst_ns) == (0, 20 * MS)
    pacer.due(T0 + 47 * MS)
    assert (pacer.overruns, pacer.worst_ns) == (1, 21 * MS)
    before = pacer.ticks
    late = T0 + 47 * MS + 15 * SECOND
    assert pacer.due(late) * TICK_NS == 2 * MS
    assert pacer.drops == 1
    assert pacer.dropped_ns == late - T0 - before * TICK_NS - 2 * MS
    assert pacer.bench_ns() == late
    assert pacer.due(late + 3 * MS) == 30  # and on at the pace of the wall
    assert DEBT_NS == 10 * SECOND


def test_the_next_slice_starts_two_milliseconds_after_the_last() -> None:
    pacer = Pacer(T0)
    pacer.due(T0)
    assert pacer.wait_s(T0) == pytest.approx(2e-3)
    assert pacer.wait_s(T0 + 1_500_000) == pytest.approx(5e-4)
    assert pacer.wait_s(T0 + 9 * MS) == 0.0
    assert pacer.due(T0 - SECOND) == 0  # a clock that went back moves nothing


Served = Callable[..., Bus]


@pytest.fixture
def served(selector: selectors.BaseSelector, opened: list[Port]) -> Iterator[Served]:
    made: list[Bus] = []

    def serve(*faults: str) -> Bus:
        made.append(Bus(selector, opened, *faults))
        return made[-1]

    yield serve
    for bus in made:
        for client in bus.clients:
            client.socket.close()


def test_every_client_hears_the_same_thousand_messages_a_second(served: Served) -> None:
    bus = served()
    clients = [bus.client(bus.slcan), bus.client(bus.slcan), bus.client(bus.serial)]
    bus.run(0.5)
    bus.until(lambda: all(len(c.of(0x100)) == 500 for c in clients))
    assert {tuple(c.of(sign.IDENTIFIER)) for c in clients} == {(sign.PAYLOAD,) * 5}  # whoever listens sees what it is
    first = clients[0].sequences()
    assert first == list(range(first[0], first[0] + 500))
    assert {tuple(c.of(0x100)) for c in clients} == {tuple(clients[0].of(0x100))}
    assert bus.server.sent == 500
    assert bus.server.statistics().startswith("bench time 0.5 s, load ")
    assert "clients 3, frames sent 500, received 0 (unknown 0), not read 0, overruns 0" in bus.server.statistics()
    assert bus.ticked[-1] - T0 <= SECOND // 2
    assert len(bus.ticked) == 25  # every 20 ms


@pytest.mark.parametrize("endpoint", ["slcan", "serial"])
def test_a_request_is_answered_at_once(served: Served, endpoint: str) -> None:
    bus = served()
    client = bus.client(getattr(bus, endpoint))
    client.command(8)
    assert client.of(0x023) == [bytes.fromhex("0100 0200 00000000")]
    assert client.of(0x021) == [bytes((8, 8, 0, 0))]
    assert bus.clock.now == T0


def test_adapters_hear_each_other_and_the_serial_port_does_not(served: Served) -> None:
    bus = served()
    one, other, serial = bus.client(bus.slcan), bus.client(bus.slcan), bus.client(bus.serial)
    one.send(slcan.line(0x123, b"\x07", fd=True, brs=True))
    bus.until(lambda: other.of(0x123) == [b"\x07"])
    serial.socket.sendall(serial.message(0x123, b"\x08"))
    bus.until(lambda: bus.server.heard == 2)
    bus.run(0.01)
    assert [c.of(0x123) for c in (one, other, serial)] == [[], [b"\x07"], []]
    assert (bus.server.heard, bus.server.unknown) == (2, 2)


def test_a_client_that_does_not_read_costs_only_itself(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "BACKLOG_BYTES", 1000)
    bus = served()
    deaf, good = bus.client(bus.slcan), bus.client(bus.slcan)
    deaf.reading = False
    (stream, *_) = [c.stream for c in bus.slcan.connections]
    with socket.socket(fileno=os.dup(stream.fileno())) as twin:  # a small pipe, lest the system keeps seconds of it
        twin.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    deaf.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    for _ in range(400):
        bus.run(0.05)
        if bus.server.unread:
            break
    lost = bus.server.unread
    assert lost > 0
    bus.until(lambda: len(good.of(0x100)) == bus.server.sent)
    assert f"not read {lost}" in bus.server.statistics()
    deaf.socket.close()
    bus.clients.remove(deaf)
    bus.until(lambda: len(bus.slcan.connections) == 1)
    assert bus.server.unread == lost  # it is still told when that client has gone


def test_states_are_told_and_a_host_that_beats_keeps_the_controller_through_a_pause_of_the_server(
    served: Served,
) -> None:
    bus = served()
    host = bus.client(bus.slcan)
    host.command(1)
    host.beat()
    bus.run(0.002)
    assert bus.lines == ["0.000 s: OFF -> READY"]
    for _ in range(40):  # 0.8 s without a processor: the host went on
        host.beat()
    bus.clock.now += 800 * MS
    slices = iter(range(10_000))
    bus.run(4.0, lambda: host.beat() if next(slices) % 10 == 0 else None)
    assert bus.device.state == "READY"
    assert bus.server.pacer.overruns == 1
    assert bus.server.pacer.ticks * TICK_NS == bus.clock.now - T0
    bus.run(0.1)  # and now it is silent
    assert (bus.device.state, bus.device.fault) == ("FAULT", "HEARTBEAT_LOST")
    assert bus.lines[-1].endswith("s: READY -> FAULT, fault HEARTBEAT_LOST")


def test_time_that_is_given_up_is_told_once(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "REPORT_NS", SECOND // 2)
    bus = served()
    client = bus.client(bus.serial)
    bus.run(0.01)
    bus.clock.now += 13 * SECOND
    bus.run(0.01)
    assert [line for line in bus.lines if "gave up" in line] == [
        "0.012 s: over ten seconds behind wall time; gave up catching up, 13.0 s so far"
    ]
    sequences = client.sequences()
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))
    bus.run(0.5)
    before = len(bus.lines)
    bus.run(1.5)
    assert len(bus.lines) == before  # no news
    assert "overruns 1 (worst 13000 ms), time given up 13.0 s" in bus.lines[-1]


def test_a_fault_unplugs_the_endpoints_and_plugs_them_in_again(served: Served) -> None:
    bus = served("disconnect@0.1+0.2")
    client = bus.client(bus.slcan)
    client.beat()
    bus.run(0.05)
    assert not client.closed
    bus.run(0.1)
    assert client.closed
    assert bus.lines == [f"{bus.lines[0][:7]}: {p.line} is gone" for p in (bus.slcan, bus.serial)]
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(address_of(bus.slcan), PATIENCE_S)
    bus.run(0.2)
    assert bus.lines[-1].endswith(f"{bus.serial.line} is there again")
    client.socket.close()
    bus.clients.clear()
    again = bus.client(bus.slcan)
    bus.run(0.1)
    assert len(again.sequences()) == 100


def test_faults_of_the_wire_reach_can_and_serial_each_in_its_way(served: Served) -> None:
    bus = served("corrupt=0.2")
    can, serial = bus.client(bus.slcan), bus.client(bus.serial)
    can.beat()
    bus.run(0.5)
    bus.until(lambda: len(can.frames) > 300)
    assert 50 < 500 - len(can.sequences()) < 150
    assert isinstance(serial.stream, PacketStream)
    assert serial.stream.crc_errors + serial.stream.malformed > 50
    can.socket.sendall(b"F\r")
    bus.until(lambda: getattr(can.stream, "status", None) == 0x80)


def test_during_a_stall_nothing_passes_and_then_everything_does(served: Served) -> None:
    bus = served("stall@0.1+0.1")
    client = bus.client(bus.slcan)
    client.beat()
    bus.run(0.15)
    quiet = len(client.frames)
    client.socket.sendall(client.message(0x011, struct.pack("<IBBH", 0x11, 8, 8, 0)))
    bus.run(0.02)
    assert len(client.frames) == quiet
    bus.run(0.1)
    bus.until(lambda: len(client.of(0x021)) == 1)
    sequences = client.sequences()
    assert len(sequences) == 270
    assert sequences == list(range(sequences[0], sequences[0] + 270))
