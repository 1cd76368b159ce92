"""Listening alone: what an adapter is told, what it answers, and that nothing else is ever written."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest
from far_end import Adapter, FarEnd, far_end, until

from bench.errors import ConfigError, LinkError
from bench.link.frames import FrameBatch, empty_batch, frame, joined
from bench.link.packetstream import encode as packets
from bench.rigfile import LinkSpec
from drivers import slcan_reception
from drivers.listener import Listener
from drivers.reception import MutePort, Reception, open_reception
from drivers.slcan_reception import AdapterPort

OPENING = b"\r\rC\rV\r"
FRAME = b"t1003AABBCC\r"
KINDS = pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])


class Lawicel(Adapter):
    """One that knows L as well; while it is open it has `frames` for whoever opened it."""

    def __init__(self, *args: object, frames: bytes = b"", **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self._frames = frames

    def _line(self, line: bytes) -> bytes:
        answer = super()._line(line)
        if line in (b"L", b"O") and answer == b"\r":
            self.opened = True
            return answer + self._frames
        return answer


class Canable:
    """The CANable firmware: it answers V and confirms nothing."""

    def __call__(self, data: bytes) -> bytes:
        return b"CANable2-b158aa7 github.com/normaldotcom\r" * data.count(b"V\r") + FRAME * data.count(b"O\r")


@contextmanager
def received(end: FarEnd, *, acknowledge: bool = False, kind: str = "slcan") -> Iterator[Reception]:
    spec = LinkSpec(url=f"{kind}:{end.where}", bitrate=1_000_000, data_bitrate=5_000_000)
    reception = open_reception(spec, "controller", time.time_ns, acknowledge=acknowledge)
    try:
        yield reception
    finally:
        reception.close()


def frames_from(reception: Reception, count: int) -> FrameBatch:
    parts = [empty_batch()]
    until(lambda: parts.append(reception.read(0.1)) or sum(map(len, parts)) >= count)  # type: ignore[func-returns-value]
    return joined(parts)


@KINDS
def test_an_adapter_is_opened_in_listen_only_mode_and_told_nothing_else(tcp: bool) -> None:
    with far_end(tcp, Lawicel(frames=FRAME)) as end:
        with received(end) as reception:
            assert reception.manner == slcan_reception.LISTENING
            (one,) = frames_from(reception, 1)
            assert one["id"] == 0x100
            assert end.received == OPENING + b"S8\rY5\rV\r" + b"L\rV\r"
        end.wait_for(b"L\rV\rC\r")
        assert end.received == OPENING + b"S8\rY5\rV\r" + b"L\rV\r" + b"C\r"


def test_one_that_refuses_listen_only_is_opened_and_that_is_said() -> None:
    with far_end(False, Lawicel(unknown=(b"L", b"M1"), frames=FRAME)) as end:
        with received(end) as reception:
            assert reception.manner == slcan_reception.UNKNOWN
            assert "acknowledges frames; none is sent" in reception.manner
            assert end.received.endswith(b"L\rV\rM1\rV\rO\rV\r")
        end.wait_for(b"O\rV\rC\r")


def test_one_that_knows_the_silent_mode_alone_is_put_back() -> None:
    with far_end(False, Lawicel(unknown=(b"L",), frames=FRAME)) as end:
        with received(end) as reception:
            assert reception.manner == slcan_reception.SILENCED
        end.wait_for(b"M1\rV\rO\rV\rC\rM0\r")


def test_one_that_confirms_nothing_is_asked_to_be_silent() -> None:
    with far_end(False, Canable()) as end:
        with received(end) as reception:
            assert reception.manner == slcan_reception.UNCONFIRMED
            assert len(frames_from(reception, 1)) == 1
        end.wait_for(b"S8\rY5\rV\rM1\rO\rC\rM0\r")


def test_acknowledging_is_asked_for() -> None:
    with far_end(False, Lawicel(frames=FRAME)) as end, received(end, acknowledge=True) as reception:
        assert reception.manner == slcan_reception.ASKED
        assert end.received == OPENING + b"S8\rY5\rV\r" + b"O\rV\r"
    with far_end(False, Canable()) as end, received(end, acknowledge=True):
        end.wait_for(b"M0\rO\r")


@contextmanager
def in_use(count: int) -> Iterator[FarEnd]:
    """An adapter that is open already: it has frames for whoever connects."""
    with far_end(True) as end:

        def speak() -> None:
            end.wait(lambda e: e.clients == 1)
            end.write(count * FRAME)

        thread = threading.Thread(target=speak)
        thread.start()
        yield end
        thread.join()


def test_one_that_is_open_already_is_told_nothing_at_all() -> None:
    """Another program may use it: C would take the bus away from it."""
    with in_use(3) as end:
        with received(end) as reception:
            assert reception.manner == slcan_reception.FOUND_OPEN
            assert len(frames_from(reception, 3)) == 3
        assert end.received == b""


def test_bus_errors_are_a_complaint_for_a_listener_and_the_end_of_one_that_acknowledges() -> None:
    with far_end(False, Lawicel(status=b"F80\r")) as end, received(end) as reception:
        assert reception.complaint == "the SLCAN adapter reports bus errors at 1000000 bit/s (F80)"
    with far_end(False, Lawicel(status=b"F80\r", unknown=(b"L", b"M1"))) as end:
        with pytest.raises(
            ConfigError, match=r"and was closed, so that it does not disturb the bus; expected the bit rat"
        ):
            with received(end):
                pass
        end.wait_for(b"F\rC\r")


def test_rates_that_an_adapter_does_not_know_and_what_is_no_adapter() -> None:
    with far_end(False, Lawicel(unknown=(b"Y5",))) as end:
        with pytest.raises(ConfigError, match="refuses one of S8, Y5"), received(end):
            pass
    with far_end(False, lambda data: b"\x00\xff~\r" * 40) as end:
        with pytest.raises(ConfigError, match="pieces came that are no SLCAN, and no frames"), received(end):
            pass


@KINDS
def test_a_serial_port_is_opened_and_read(tcp: bool) -> None:
    data, _ = packets(joined([frame(0x100, bytes(8)), frame(0x101, bytes(3))]), 0)
    with far_end(tcp) as end:
        with received(end, kind="serial") as reception:
            until(lambda: not tcp or end.clients == 1)
            end.write(data)
            assert frames_from(reception, 2)["id"].tolist() == [0x100, 0x101]
        assert end.received == b""


def test_ports_that_are_open_for_listening_refuse_to_write() -> None:
    with far_end() as end:
        port = MutePort.open(end.where)
        with pytest.raises(LinkError, match="nothing is written to it"):
            port.write(b"x")
        port.close()
        adapter = AdapterPort.open(end.where)
        for line in (FRAME, b"d1008" + 16 * b"0" + b"\r", b"r1000\r", b"S8\rt1000\r", b"t", b"N\r"):
            with pytest.raises(LinkError, match="nothing but its adapter's settings"):
                adapter.write(line)
        adapter.close()
        assert end.received == b""


def test_an_interface_of_python_can_hears_and_cannot_send() -> None:
    spec = LinkSpec(url="can:virtual:listened", bitrate=1_000_000)
    with can.Bus(interface="virtual", channel="listened") as other:
        reception = open_reception(spec, "controller", time.time_ns)
        assert reception.manner == ("python-can has no listen-only for virtual: it acknowledges frames; none is sent")
        other.send(can.Message(arbitration_id=0x123, data=b"abc", is_extended_id=False))
        assert frames_from(reception, 1)["id"].tolist() == [0x123]
        with pytest.raises(can.CanError, match="open for listening"):
            reception._bus.bus.send(can.Message())  # type: ignore[attr-defined]
        reception.close()
        assert other.recv(0) is None


def test_a_listener_has_no_way_to_send_and_tells_what_was_lost() -> None:
    assert not {"send", "write", "renew_lease", "writer"} & {*dir(Listener), *dir(Reception)}
    with in_use(3) as end:
        spec = LinkSpec(url=f"slcan:{end.where}", bitrate=1_000_000)
        listener = Listener("controller", open_reception(spec, "controller", time.time_ns))
        try:
            parts: list[FrameBatch] = []
            until(lambda: parts.append(listener.receive()) or sum(map(len, parts)) >= 3)  # type: ignore[func-returns-value]
            assert listener.stats.received == 3
            end.hang_up()
            with pytest.raises(LinkError, match=end.where):
                until(lambda: parts.append(listener.receive()) or False)  # type: ignore[func-returns-value]
        finally:
            listener.close()
            listener.close()


@pytest.mark.parametrize(
    ("url", "said"),
    [
        (
            "inprocess:",
            "where nothing can be listened to; expected a URL that starts with slcan:, can:, serial: or cli:",
        ),
        ("slcan:/dev/ttyNOWHERE", "found no such device"),
        ("serial:/dev/ttyNOWHERE", "found no such device"),
        ("slcan:socket://127.0.0.1:9", "nobody listens there"),
        ("can:sockedcan:can0", "did you mean 'socketcan'?"),
    ],
)
def test_a_link_that_cannot_be_opened_says_what_to_do(url: str, said: str) -> None:
    with pytest.raises(ConfigError, match="link controller: ") as caught:
        open_reception(LinkSpec(url=url, bitrate=500_000), "controller", time.time_ns)
    assert said in str(caught.value)
