"""CAN through python-can: frames and messages, errors, filters, bus off, and what cannot be opened."""

from __future__ import annotations

from collections.abc import Iterator

import can
import numpy as np
import pytest
from far_end import Adapter, far_end, until
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import ConfigError, LinkError
from bench.link.frames import ERROR, EXTENDED, FD, FRAME, FrameBatch, empty_batch, frame, payload
from bench.rigfile import LinkSpec
from bench.wire.slcan import LENGTHS
from drivers.canbus import CanBus, open_bus
from drivers.canframes import batch_of, messages_of

VIRTUAL = LinkSpec(url="can:virtual:lev-test", bitrate=1e6, data_bitrate=5e6)


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with can.Bus("lev-test", interface="virtual", ignore_config=True) as bus:
        yield bus


@pytest.fixture
def bus(peer: can.BusABC) -> Iterator[CanBus]:
    bus = open_bus(VIRTUAL, "can0", now_ns=lambda: 5_000)
    yield bus
    bus.close()


def message(identifier: int, data: bytes = b"", **more: object) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data, **more)  # type: ignore[arg-type]


def frames_from(bus: CanBus, count: int) -> FrameBatch:
    parts = [empty_batch()]
    until(lambda: parts.append(bus.read(0.1)) or sum(map(len, parts)) >= count)
    return np.concatenate(parts)


def test_messages_become_frames_in_order(bus: CanBus, peer: can.BusABC) -> None:
    peer.send(message(0x100, bytes(range(64)), is_fd=True))
    peer.send(message(0x21, b"\x01\x02"))
    peer.send(can.Message(arbitration_id=0x1ABCDEF0, data=b"\xff"))
    peer.send(message(0x22, is_remote_frame=True, dlc=3))
    batch = frames_from(bus, 3)
    assert batch["id"].tolist() == [0x100, 0x21, 0x1ABCDEF0 | EXTENDED]
    assert batch["flags"].tolist() == [FD, 0, 0]
    assert [payload(f) for f in batch] == [bytes(range(64)), b"\x01\x02", b"\xff"]
    assert batch["t_ns"].tolist() == [5_000] * 3
    assert batch["hw_ns"].tolist() == [0] * 3  # `virtual` stamps with the host's clock
    assert bus.stats.received == 3


def test_frames_become_messages_in_order(bus: CanBus, peer: can.BusABC) -> None:
    bus.write(np.concatenate([frame(0x11, bytes(12), flags=FD), frame(0x12, b"\x07"), frame(3 | EXTENDED, b"")]))
    got = [peer.recv(1.0) for _ in range(3)]
    assert [(m.arbitration_id, bytes(m.data), m.is_fd, m.is_extended_id, m.bitrate_switch) for m in got if m] == [
        (0x11, bytes(12), True, False, True),
        (0x12, b"\x07", False, False, False),
        (3, b"", False, True, False),
    ]
    assert bus.stats.sent == 3


def test_the_interfaces_own_time_is_kept() -> None:
    batch = batch_of([message(1, timestamp=12.000345678)], 7, own_time=True)
    assert batch["hw_ns"].tolist() == [12_000_345_678]
    assert batch["t_ns"].tolist() == [7]


def test_error_frames_are_marked_and_counted(bus: CanBus, peer: can.BusABC) -> None:
    peer.send(can.Message(is_error_frame=True, arbitration_id=0x40, data=bytes(8)))
    peer.send(message(1))
    batch = frames_from(bus, 2)
    assert batch["flags"].tolist() == [ERROR, 0]
    assert bus.stats.error_frames == 1
    assert bus.stats.bus_off == 0  # the classes of error frames are SocketCAN's


def test_socketcans_bus_off_comes_after_its_evidence(peer: can.BusABC) -> None:
    inner = can.Bus("lev-test", interface="virtual", ignore_config=True)
    bus = CanBus("can0", inner, {"interface": "socketcan", "channel": "can0"}, lambda: 5)
    peer.send(message(0x100))
    peer.send(can.Message(is_error_frame=True, arbitration_id=0x40, data=bytes(8)))
    batch = frames_from(bus, 2)
    assert batch["id"].tolist() == [0x100, 0x40]
    assert batch["hw_ns"].all()
    with pytest.raises(LinkError, match=r"link can0: the CAN interface reports bus off: .* check wiring"):
        bus.read(0.0)
    assert bus.stats.bus_off == 1
    bus.close()


def test_an_slcan_adapter_with_bus_errors_and_silence_is_bus_off() -> None:
    adapter = Adapter()
    with far_end(answer=adapter) as end:
        bus = open_bus(LinkSpec(url=f"slcan:{end.where}", bitrate=500e3), "can0")
        adapter.status = b"F80\r"
        with pytest.raises(LinkError, match="bus off"):
            until(lambda: len(bus.read(0.1)) > 0)
        assert bus.stats.bus_off == 1
        bus.close()


def test_filters_let_only_the_rigs_identifiers_pass(peer: can.BusABC) -> None:
    everything = LinkSpec(url="can:virtual:lev-test?filters=off")
    for spec, expected in ((VIRTUAL, [0x100, 0x5 | EXTENDED]), (everything, [0x100, 0x101, 0x5 | EXTENDED, 0x5])):
        bus = open_bus(spec, "can0", [0x100, 0x5 | EXTENDED])
        for identifier in (0x100, 0x101):
            peer.send(message(identifier))
        peer.send(can.Message(arbitration_id=5))
        peer.send(message(5))
        assert frames_from(bus, len(expected))["id"].tolist() == expected
        bus.close()


@pytest.mark.parametrize("identifier", [0x20, 0x40])
def test_error_frames_pass_the_filters_and_are_counted(peer: can.BusABC, identifier: int) -> None:
    bus = open_bus(VIRTUAL, "can0", [0x100, 0x5 | EXTENDED])
    peer.send(can.Message(is_error_frame=True, is_extended_id=False, arbitration_id=identifier, data=bytes(8)))
    peer.send(can.Message(is_error_frame=True, arbitration_id=identifier, data=bytes(8)))
    for other in (0x101, 0x100):
        peer.send(message(other))
    batch = frames_from(bus, 3)
    assert batch["id"][-1] == 0x100
    assert batch["flags"].tolist() == [ERROR, ERROR, 0]
    assert bus.stats.error_frames == 2
    bus.close()


def test_a_lost_interface_is_a_link_error(bus: CanBus) -> None:
    bus.bus.shutdown()
    with pytest.raises(LinkError, match="link can0: the CAN interface is lost"):
        bus.read(0.0)
    with pytest.raises(LinkError, match="link can0: the CAN interface does not send"):
        bus.write(frame(1, b""))
    bus.close()


def test_a_message_that_can_does_not_know_is_a_link_error(peer: can.BusABC) -> None:
    with far_end(answer=Adapter()) as end:
        bus = open_bus(LinkSpec(url=f"slcan:{end.where}", bitrate=500e3), "can0")
        with pytest.raises(LinkError, match="payload of 9 bytes"):
            bus.write(frame(1, bytes(9), flags=FD))
        bus.close()


@pytest.mark.parametrize(
    ("url", "bitrate", "says"),
    [
        ("can:scoketcan:can0", 5e5, "link can0: found CAN interface 'scoketcan'; did you mean 'socketcan'?"),
        ("can:bluetooth:x", 5e5, "link can0: found CAN interface 'bluetooth'; expected one of canalystii, "),
        ("can:socketcan", 5e5, "link can0: found no channel; expected such as 'can:socketcan:can0'"),
        ("can:kvaser:0", 5e5, "link can0: the CAN interface kvaser:0 cannot be opened: "),
        ("can:pcan:PCAN_USBBUS1", 5e5, "link can0: the CAN interface pcan:PCAN_USBBUS1 cannot be opened: "),
        ("can:socketcan:nocan7", 5e5, "link can0: the CAN interface socketcan:nocan7 cannot be opened: "),
        ("slcan:/dev/ttyLEV3", 5e5, "link can0: port /dev/ttyLEV3: found no such device; "),
        ("slcan:/dev/ttyLEV3", 7e5, "link can0: SLCAN has no code for a bit rate of 700000 bit/s; expected one of "),
        ("slcan:/dev/ttyLEV3", None, "link can0: SLCAN needs a bit rate; expected `bitrate` in [links.can0]"),
        ("slcan:/dev/ttyLEV3?bitrat=5", 5e5, "link can0: SLCAN has no option bitrat; expected among bitrate, "),
        ("slcna:/dev/ttyACM0", 5e5, "link URL 'slcna:/dev/ttyACM0': found scheme 'slcna'; did you mean "),
    ],
)
def test_what_cannot_be_opened_says_so(url: str, bitrate: float | None, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        open_bus(LinkSpec(url=url, bitrate=bitrate), "can0")
    assert str(caught.value).startswith(says)


def test_the_urls_query_and_the_options_reach_the_interface() -> None:
    spec = LinkSpec(
        url="can:virtual:lev-test?receive_own_messages=true&rx_queue_size=7", options={"preserve_timestamps": True}
    )
    bus = open_bus(spec, "can0")
    assert {k: bus.arguments[k] for k in ("receive_own_messages", "rx_queue_size", "preserve_timestamps")} == {
        "receive_own_messages": True, "rx_queue_size": 7, "preserve_timestamps": True,
    }  # fmt: skip
    bus.write(frame(9, b"\x01"))
    assert frames_from(bus, 1)["id"].tolist() == [9]
    bus.close()


@st.composite
def batches(draw: st.DrawFn) -> FrameBatch:
    def one() -> FrameBatch:
        fd = draw(st.booleans())
        length = draw(st.sampled_from(LENGTHS if fd else LENGTHS[:9]))
        extended = draw(st.booleans())
        identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF)) | (EXTENDED if extended else 0)
        return frame(identifier, draw(st.binary(min_size=length, max_size=length)), t_ns=5, flags=FD if fd else 0)

    return np.concatenate([np.empty(0, FRAME), *(one() for _ in range(draw(st.integers(0, 5))))])


@given(batches())
def test_frames_survive_being_messages(batch: FrameBatch) -> None:
    assert np.array_equal(batch_of(messages_of(batch), 5), batch)
