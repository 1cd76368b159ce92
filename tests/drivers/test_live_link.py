"""The live link: reader, buffer, heartbeat, losses and reconnection, over ptys, TCP and `virtual`."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import numpy as np
import pytest
from far_end import Adapter, FarEnd, descriptors, far_end, until

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.codec import encode
from bench.link.frames import FD, FrameBatch, empty_batch, frame
from bench.rigfile import LinkSpec, load_rig
from drivers.beat import Beat, WriterSpec
from drivers.heartbeat import HeartbeatProcess
from drivers.live_link import LiveLink
from drivers.wires import Wire, open_wire

BEAT = Beat(0x010, bytes(8), range(32, 48), True)
SETUP = b"\r\rC\rV\rS8\rY5\rO\rV\rF\r"
KINDS = pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])


def spec(end: FarEnd, scheme: str = "slcan") -> LinkSpec:
    rates = {"bitrate": 1e6, "data_bitrate": 5e6} if scheme == "slcan" else {}
    return LinkSpec(url=f"{scheme}:{end.where}", **rates)  # type: ignore[arg-type]


@contextmanager
def linked(end: FarEnd, scheme: str = "slcan", **settings: object) -> Iterator[LiveLink]:
    """An open link; at the end nothing of it may be left."""
    before = descriptors()
    link = LiveLink("can0", lambda: open_wire(spec(end, scheme), "can0"), BEAT, **settings)  # type: ignore[arg-type]
    try:
        yield link
    finally:
        link.close()
        link.close()
    mine = {d for d in descriptors() if d.split()[0] == str(end._end)}
    until(lambda: descriptors() <= before | mine, f"{descriptors() - before}")


def received(link: LiveLink, count: int, enough: Callable[[], bool] = lambda: True) -> FrameBatch:
    parts = [empty_batch()]
    until(lambda: parts.append(link.receive()) or (sum(map(len, parts)) >= count and enough()))
    return np.concatenate(parts)


def error_of(link: LiveLink) -> str:
    found: list[str] = []

    def lost() -> bool:
        try:
            link.renew_lease()
            link.receive()
        except LinkError as error:
            found.append(str(error))
        return bool(found)

    until(lost)
    return found[0]


def numbered(first: int, count: int) -> bytes:
    return b"".join(b"b1004%08X\r" % n for n in range(first, first + count))


def numbers(batch: FrameBatch) -> list[int]:
    return [int.from_bytes(bytes(row[:4]), "big") for row in batch["data"]]


@KINDS
def test_frames_come_and_go_and_heartbeats_beat(tcp: bool) -> None:
    with far_end(tcp, Adapter()) as end, linked(end) as link:
        assert link.name == "can0"
        end.write(numbered(0, 1000))
        assert numbers(received(link, 1000)) == list(range(1000))
        link.send(np.concatenate([frame(0x011, b"\x01", flags=FD), frame(0x012, b"\x02", flags=FD)]))
        end.wait_for(b"b011101\rb012102\r")
        assert b"b010" not in end.received  # no lease yet
        link.renew_lease()
        end.wait_for(b"b01080000000003000000\r")
        assert end.received.startswith(SETUP)
        until(lambda: link.stats.heartbeats >= 3)
        s = link.stats
        assert (s.received, s.sent - s.heartbeats) == (1000, 2)
        assert s.longest_heartbeat_gap_ns > 0
        assert s == LinkStats(s.received, s.sent, octets=14000, heartbeats=s.heartbeats,
                              longest_heartbeat_gap_ns=s.longest_heartbeat_gap_ns)  # fmt: skip


def test_the_same_in_packets() -> None:
    with far_end() as end, linked(end, "serial") as link:
        assert link.receive().tolist() == []
        link.send(frame(0x011, b"\x01"))
        end.wait_for(b"\x00")
        first = end.received
        link.renew_lease()
        end.wait(lambda f: f.received.count(b"\x00") >= 3)
        end.write(first)  # what the host sends is a packet like the controller's
        assert received(link, 1)["id"].tolist() == [0x011]


def test_nobody_takes_frames_the_newest_are_dropped_counted_and_told_once() -> None:
    with far_end(answer=Adapter()) as end, linked(end, limit=10) as link:
        end.write(numbered(0, 30))
        until(lambda: link.stats.received == 30)
        with pytest.raises(
            LinkError, match="link can0: 20 frames were dropped because nobody took them: over 10 waited"
        ):
            until(lambda: len(link.receive()) > 0)
        assert numbers(link.receive()) == list(range(10))
        assert link.stats.overflows == 20
        end.write(numbered(30, 2))
        assert numbers(received(link, 2)) == [30, 31]


@KINDS
def test_a_lost_port_ends_the_link_after_what_came(tcp: bool) -> None:
    with far_end(tcp, Adapter()) as end, linked(end) as link:
        end.write(numbered(0, 50))
        until(lambda: link.stats.received == 50)
        end.hang_up()
        until(lambda: not link._reader.is_alive())
        assert numbers(link.receive()) == list(range(50))
        for call in (link.receive, lambda: link.send(frame(1, b"")), link.receive):
            with pytest.raises(LinkError, match=f"port {end.where} was unplugged or its other end closed"):
                call()


def test_a_killed_heartbeat_process_is_a_lost_link() -> None:
    with far_end(answer=Adapter()) as end, linked(end) as link:
        link.renew_lease()
        end.wait_for(b"b010")
        assert isinstance(link._heartbeat, HeartbeatProcess)
        assert link._heartbeat._process is not None
        os.kill(link._heartbeat._process.pid, signal.SIGKILL)
        assert error_of(link).startswith("link can0: no heartbeats: the heartbeat process has ended")
        with pytest.raises(LinkError, match="no heartbeats"):
            link.send(frame(1, b""))


def test_a_killed_heartbeat_process_is_not_replaced_by_reconnecting() -> None:
    with far_end(answer=Adapter()) as end, linked(end, reconnect_s=60.0) as link:
        assert isinstance(link._heartbeat, HeartbeatProcess)
        assert link._heartbeat._process is not None
        os.kill(link._heartbeat._process.pid, signal.SIGKILL)
        text = error_of(link)
        assert "the heartbeat process has ended" in text
        assert "reader failed" not in text
        until(lambda: not link._reader.is_alive())


# Reconnection


def test_a_port_that_comes_back_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    with far_end(True, Adapter()) as end, linked(end, reconnect_s=60.0) as link:
        link.renew_lease()
        end.write(numbered(0, 3))
        assert numbers(received(link, 3)) == [0, 1, 2]
        end.wait_for(b"b010")
        end.answer = Adapter()
        end.hang_up()
        end.wait(lambda f: f.clients == 2)
        until(lambda: link.renew_lease() is None and link.stats.reconnects == 1 and not link._down)
        beats = link.stats.heartbeats
        end.wait_for(b"b010")
        assert end.received.startswith(SETUP)  # no heartbeat between the lines that set the adapter up
        link.send(frame(0x011, b"\x05", flags=FD))
        end.wait_for(b"b011105\r")
        end.write(numbered(3, 2))
        assert numbers(received(link, 2)) == [3, 4]
        s = link.stats
        assert (s.received, s.reconnects) == (5, 1)
        assert s.heartbeats >= beats > 0
    assert "trying to open it again for 60 s" in caplog.text
    assert "link can0 is open again" in caplog.text


def test_while_it_is_down_nothing_can_be_sent_and_nothing_comes() -> None:
    with far_end(True, Adapter()) as end, linked(end, reconnect_s=60.0) as link:
        end.refuse()
        until(lambda: link._down)
        assert len(link.receive()) == 0
        with pytest.raises(LinkError, match="link can0 is lost and being opened again; nothing can be sent"):
            link.send(frame(1, b""))


def test_a_port_that_stays_away_ends_the_link_with_both_reasons() -> None:
    with far_end(True, Adapter()) as end, linked(end, reconnect_s=0.15) as link:
        end.refuse()
        text = error_of(link)
        assert "unplugged or its other end closed" in text
        assert "it did not come back within 0.15 s (last: link can0: port" in text
        assert "nobody listens there" in text


def test_bus_off_with_the_port_still_there_is_reopened_without_a_heartbeat_in_between() -> None:
    adapter = Adapter()
    with far_end(answer=adapter) as end, linked(end, reconnect_s=60.0) as link:
        link.renew_lease()
        end.wait_for(b"b010")
        adapter.status = b"F80\r"
        until(lambda: link.receive() is not None and link.stats.bus_off == 1)
        adapter.status = b"F00\r"
        until(lambda: link.renew_lease() is None and link.stats.reconnects >= 1 and not link._down)
        again = end.received.rindex(SETUP)
        assert end.received[:again].endswith(b"\rC\r")
        received(link, 0, lambda: link.renew_lease() is None and b"b010" in end.received[again:])
        assert all(line[:4] == b"b010" or len(line) < 3 for line in end.lines())


# One writer


def test_the_status_is_asked_for_by_the_heartbeat_process() -> None:
    """Bytes of the bench's own could end up in the middle of a line that the other process has written in part."""
    adapter = Adapter()
    with far_end(answer=adapter) as end:
        with linked(end) as link:
            asked = end.received.count(b"F\r")
            until(lambda: link.receive() is not None and end.received.count(b"F\r") > asked)
            wire = link._wire
            assert wire._can.slcan._ask == link._later  # type: ignore[attr-defined]
            assert link.stats.sent == 0  # a request is no frame
            adapter.status = b"F80\r"
            assert "link can0: the CAN interface reports bus off" in error_of(link)
            assert link.stats.bus_off == 1


def test_messages_said_as_lines_are_counted_like_frames() -> None:
    """Another process writes them as the bytes they are: what they say is the wire's to count."""
    rig = load_rig("lira")
    asked = rig.messages["ParamGet"]
    with far_end() as end:
        link = LiveLink(
            "controller", lambda: open_wire(LinkSpec(url=f"cli:serial:{end.where}"), "controller", rig=rig), BEAT
        )
        with contextlib.closing(link):
            for _ in range(3):
                link.send(frame(asked.identifier, encode(asked, {"index": 1})))
            until(lambda: end.received.count(b" get ") >= 3)
            assert link.stats.sent - link.stats.heartbeats == 3


# Threads


def test_an_interface_of_this_process_has_a_heartbeat_thread(caplog: pytest.LogCaptureFixture) -> None:
    virtual = LinkSpec(url="can:virtual:lev-live", bitrate=1e6, data_bitrate=5e6)
    with can.Bus("lev-live", interface="virtual", ignore_config=True) as peer:
        link = LiveLink("can0", lambda: open_wire(virtual, "can0"), BEAT)
        assert "link can0: no other process can reach this interface" in caplog.text
        link.renew_lease()
        first = peer.recv(5.0)
        assert first is not None
        assert (first.arbitration_id, bytes(first.data), first.is_fd) == (0x010, b"\0\0\0\0\x01\0\0\0", True)
        peer.send(can.Message(arbitration_id=0x100, is_extended_id=False, data=b"\x01"))
        assert received(link, 1)["id"].tolist() == [0x100]
        link.close()
        link.close()


def test_a_thread_that_is_meant_is_no_warning(caplog: pytest.LogCaptureFixture) -> None:
    with far_end(answer=Adapter()) as end, linked(end, heartbeat="thread") as link:
        link.renew_lease()
        end.wait_for(b"b010")
        link.send(frame(0x011, b"\x07", flags=FD))
        end.wait_for(b"b011107\r")
    assert not [r for r in caplog.records if r.levelno >= logging.WARNING]


def test_a_heartbeat_thread_goes_on_after_reconnecting() -> None:
    with far_end(True, Adapter()) as end, linked(end, heartbeat="thread", reconnect_s=60.0) as link:
        link.renew_lease()
        end.wait_for(b"b010")
        end.answer = Adapter()
        end.hang_up()
        until(lambda: link.renew_lease() is None and link.stats.reconnects == 1)
        until(lambda: link.renew_lease() is None and end.clients >= 2 and b"b010" in end.received)


class Failing:
    """A wire whose decoder has a mistake."""

    def __init__(self) -> None:
        self.stats = LinkStats()
        self.closed = 0

    def read(self, timeout_s: float) -> FrameBatch:
        raise IndexError("out of bounds")

    def write(self, batch: FrameBatch) -> None: ...
    def writer(self) -> WriterSpec:
        return WriterSpec("none")

    def written_by(self, send_bytes: Callable[[bytes], None]) -> None: ...
    def cancel(self) -> None: ...
    def close(self) -> None:
        self.closed += 1


def test_a_mistake_in_the_reader_does_not_look_like_silence() -> None:
    wire = Failing()
    link = LiveLink("can0", lambda: wire, BEAT, heartbeat="thread", reconnect_s=60.0)
    assert error_of(link) == "link can0: the reader failed: IndexError: out of bounds"
    link.close()
    assert wire.closed


class Hanging(Failing):
    """A wire that cannot be cancelled."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()

    def read(self, timeout_s: float) -> FrameBatch:
        self.free.wait()
        return empty_batch()


def test_a_read_that_hangs_keeps_its_wire_until_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.live_link.JOIN_S", 0.01)
    wire = Hanging()
    link = LiveLink("can0", lambda: wire, BEAT, heartbeat="thread")
    link.close()
    assert not wire.closed
    wire.free.set()
    until(lambda: wire.closed == 1)


# Opening and closing


def test_what_cannot_be_opened_leaves_nothing() -> None:
    before, threads = descriptors(), threading.active_count()
    with pytest.raises(ConfigError, match="link can0: port /dev/ttyLEV2: found no such device"):
        LiveLink("can0", lambda: open_wire(LinkSpec(url="serial:/dev/ttyLEV2"), "can0"), BEAT)
    with far_end() as end:
        wrong = Beat(0x1010, bytes(8), range(32, 48), True)  # a packet has 11-bit identifiers
        with pytest.raises(ConfigError, match="link can0: heartbeat"):
            LiveLink("can0", lambda: open_wire(spec(end, "serial"), "can0"), wrong)
    assert descriptors() == before
    assert threading.active_count() == threads


@pytest.mark.parametrize("state", ["waiting", "lost", "reconnecting", "opening"])
def test_it_can_be_closed_from_any_state(state: str) -> None:
    opening, go_on = threading.Event(), threading.Event()
    with far_end(True, Adapter()) as end:
        count = 0

        def slowly() -> Wire:
            nonlocal count
            count += 1
            if count > 1 and state == "opening":
                opening.set()
                go_on.wait(20.0)
            return open_wire(spec(end), "can0")

        before = descriptors()
        link = LiveLink("can0", slowly, BEAT, reconnect_s=0.0 if state == "lost" else 60.0)
        end.answer = Adapter()
        if state in ("lost", "opening"):
            end.hang_up()
        if state == "lost":
            until(lambda: not link._reader.is_alive())
        if state == "reconnecting":
            end.refuse()
            until(lambda: link._down)
        if state == "opening":
            assert opening.wait(20.0)
            threading.Timer(0.0, go_on.set).start()
        link.close()
        assert not link._reader.is_alive()
        with pytest.raises(LinkError):
            link.send(frame(1, b""))
        until(lambda: descriptors() <= before | {d for d in descriptors() if d.split()[0] == str(end._end)})


def test_closing_sends_what_waits() -> None:
    with far_end(answer=Adapter()) as end:
        with linked(end) as link:
            link.send(frame(0x011, b"\x08", flags=FD))
        end.wait_for(b"b011108\rC\r")  # the last word, then the channel is closed
