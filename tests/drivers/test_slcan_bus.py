"""The python-can interface `slcan_batch`: bytes by hand, batches and single messages, adapters of several minds."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import closing

import can
import numpy as np
import pytest
from far_end import Adapter, FarEnd, descriptors, far_end, until

from bench.errors import LinkError
from bench.link.frames import ERROR, EXTENDED, FD, SWITCHED, FrameBatch, empty_batch, frame, payload
from drivers import slcan_bus
from drivers.slcan_bus import SlcanBatchBus

LONG_S = 20.0
KINDS = pytest.mark.parametrize("end", [False, True], indirect=True, ids=["pty", "tcp"])


@pytest.fixture
def end(request: pytest.FixtureRequest) -> Iterator[FarEnd]:
    with far_end(getattr(request, "param", False), Adapter()) as far:
        yield far


def opened(end: FarEnd, **settings: object) -> SlcanBatchBus:
    arguments: dict[str, object] = {"bitrate": 1_000_000, "data_bitrate": 5_000_000, **settings}
    return SlcanBatchBus(end.where, **arguments)  # type: ignore[arg-type]


@pytest.fixture
def bus(end: FarEnd) -> Iterator[SlcanBatchBus]:
    bus = opened(end)
    yield bus
    bus.shutdown()


def batch_from(bus: SlcanBatchBus, count: int) -> FrameBatch:
    parts = [empty_batch()]
    until(lambda: parts.append(bus.recv_batch(0.1)) or sum(map(len, parts)) >= count)
    return np.concatenate(parts)


@KINDS
def test_opening_sets_the_adapter_up_and_closing_closes_it(end: FarEnd) -> None:
    bus = opened(end)
    assert end.received == b"\r\rC\rV\r" + b"S8\rY5\rO\rV\r" + b"F\r"
    assert bus.protocol is can.CanProtocol.CAN_FD
    bus.shutdown()
    bus.shutdown()
    end.wait_for(b"F\rC\r")


def test_classic_can_sets_no_data_rate(end: FarEnd) -> None:
    with closing_bus(opened(end, bitrate=500_000, data_bitrate=None)) as bus:
        assert b"V\rS6\rO\r" in end.received
        assert bus.protocol is can.CanProtocol.CAN_20


def closing_bus(bus: SlcanBatchBus) -> SlcanBatchBus:
    return bus  # BusABC is a context manager that shuts down


@KINDS
def test_lines_become_frames(end: FarEnd, bus: SlcanBatchBus) -> None:
    end.write(b"t1232ABCD\rT1ABCDEF01FF\rd0214DEADBEEF\rb1009" + b"0102030405060708090A0B0C" + b"\rz\rnonsense!\r")
    batch = batch_from(bus, 4)
    assert batch["id"].tolist() == [0x123, 0x1ABCDEF0 | EXTENDED, 0x021, 0x100]
    assert batch["flags"].tolist() == [0, 0, FD, FD | SWITCHED]
    assert [payload(f) for f in batch] == [b"\xab\xcd", b"\xff", b"\xde\xad\xbe\xef", bytes(range(1, 13))]
    assert (batch["t_ns"] > 0).all()
    assert not batch["hw_ns"].any()
    assert bus.stream.malformed == 0
    assert bus.stream.replies == [b"nonsense!"]


def test_the_adapters_time_goes_to_hw_ns(end: FarEnd) -> None:
    with closing_bus(opened(end, timestamp=True)) as bus:
        assert b"Y5\rZ1\rO\r" in end.received
        end.write(b"t1231FF0010\rt1231FF0015\r")
        hw = batch_from(bus, 2)["hw_ns"]
        assert int(hw[0]) > 0
        assert int(hw[1] - hw[0]) == 5_000_000


@KINDS
def test_frames_become_lines(end: FarEnd, bus: SlcanBatchBus) -> None:
    bus.send_batch(
        np.concatenate([frame(0x011, b"\x01\x02", flags=FD), frame(0x7FF, b""), frame(5 | EXTENDED, b"\xff")])
    )
    end.wait_for(b"\rb01120102\rt7FF0\rT000000051FF\r")
    with pytest.raises(LinkError, match="error frame"):
        bus.send_batch(frame(0x011, b"", flags=ERROR))
    with pytest.raises(LinkError, match="payload of 9 bytes"):
        bus.send_batch(frame(0x011, bytes(9), flags=FD))


@pytest.mark.parametrize(
    ("message", "line"),
    [
        (can.Message(arbitration_id=0x12, is_extended_id=False, data=b"\xaa\x55"), b"t0122AA55\r"),
        (can.Message(arbitration_id=0x12, data=b"\x01"), b"T00000012101\r"),
        (
            can.Message(arbitration_id=0x12, is_extended_id=False, is_fd=True, data=bytes(12)),
            b"d0129" + b"00" * 12 + b"\r",
        ),
        (
            can.Message(arbitration_id=1, is_extended_id=False, is_fd=True, bitrate_switch=True, data=b"\x07"),
            b"b001107\r",
        ),
        (can.Message(arbitration_id=0x12, is_extended_id=False, is_remote_frame=True, dlc=4), b"r0124\r"),
        (can.Message(arbitration_id=0x12, is_remote_frame=True, dlc=0), b"R000000120\r"),
    ],
)
def test_single_messages_are_sent(end: FarEnd, bus: SlcanBatchBus, message: can.Message, line: bytes) -> None:
    bus.send(message)
    end.wait_for(b"F\r" + line)


def test_what_can_does_not_know_is_not_sent(bus: SlcanBatchBus) -> None:
    for wrong in (can.Message(is_error_frame=True), can.Message(data=bytes(12), is_fd=False, dlc=12)):
        with pytest.raises(can.CanOperationError):
            bus.send(wrong)


def burst(first: int, count: int) -> bytes:
    return b"".join(b"b1004%08X\r" % n for n in range(first, first + count))


@KINDS
def test_python_can_finds_it_by_name_and_a_notifier_loses_nothing(end: FarEnd) -> None:
    reader = can.BufferedReader()
    with can.Bus(interface="slcan_batch", channel=end.where, bitrate=1_000_000, fd=True, ignore_config=True) as bus:
        notifier = can.Notifier(bus, [reader], timeout=0.05)
        with closing(Stopping(notifier)):
            end.write(burst(0, 5000))
            numbers = [int.from_bytes(taken(reader).data, "big") for _ in range(5000)]
        assert numbers == list(range(5000))


class Stopping:
    def __init__(self, notifier: can.Notifier) -> None:
        self.close: Callable[[], None] = notifier.stop


def taken(reader: can.BufferedReader) -> can.Message:
    message = reader.get_message(LONG_S)
    assert message is not None
    return message


def test_an_asyncio_notifier_gets_all_of_a_burst(end: FarEnd, bus: SlcanBatchBus) -> None:
    """With a `fileno` it would take one message for each event, and leave the rest."""

    async def collect() -> list[int]:
        reader = can.AsyncBufferedReader()
        notifier = can.Notifier(bus, [reader], timeout=0.05, loop=asyncio.get_running_loop())
        end.write(burst(0, 200))
        got = [await asyncio.wait_for(reader.get_message(), LONG_S) for _ in range(200)]
        notifier.stop()
        return [int.from_bytes(m.data, "big") for m in got]

    assert asyncio.run(collect()) == list(range(200))
    with pytest.raises(NotImplementedError):
        bus.fileno()


def test_filters_hold_for_batches_and_messages(end: FarEnd, bus: SlcanBatchBus) -> None:
    bus.set_filters([
        {"can_id": 0x100, "can_mask": 0x7F0, "extended": False},
        {"can_id": 0x5, "can_mask": 0x1FFFFFFF, "extended": True},
    ])  # fmt: skip
    lines = b"t1050\rt2000\rT000000050\rT000001000\rt0050\rt10F0\r"
    end.write(lines)
    assert batch_from(bus, 3)["id"].tolist() == [0x105, 0x5 | EXTENDED, 0x10F]
    end.write(lines)
    got = [bus.recv(LONG_S) for _ in range(3)]
    assert [m.arbitration_id for m in got if m] == [0x105, 0x5, 0x10F]
    bus.set_filters([{"can_id": 5, "can_mask": 0x7FF}])  # of either kind
    end.write(lines)
    assert batch_from(bus, 2)["id"].tolist() == [0x5 | EXTENDED, 0x5]
    bus.set_filters(None)
    end.write(lines)
    assert len(batch_from(bus, 6)) == 6


def test_recv_without_data_ends_by_its_timeout(bus: SlcanBatchBus) -> None:
    assert bus.recv(0.0) is None
    assert bus.recv(0.01) is None


@KINDS
def test_an_adapter_that_is_gone_is_an_operation_error_and_can_be_shut_down(end: FarEnd, bus: SlcanBatchBus) -> None:
    end.hang_up()
    with pytest.raises(can.CanOperationError, match="was unplugged or its other end closed"):
        bus.recv(LONG_S)
    bus.shutdown()
    with pytest.raises(can.CanOperationError, match="is closed"):
        bus.send(can.Message(arbitration_id=1))


# What adapters say


def refused(end: FarEnd, **settings: object) -> str:
    before = descriptors()
    with pytest.raises(can.CanInitializationError) as caught:
        opened(end, **settings)
    until(lambda: descriptors() <= before | {d for d in descriptors() if d.split()[0] == str(end._end)})
    return str(caught.value)


@KINDS
def test_wrong_bit_rates_are_told_at_the_start(end: FarEnd) -> None:
    end.answer = Adapter(b"F80\r")
    text = refused(end)
    assert text.startswith(f"port {end.where}: the SLCAN adapter reports bus errors at 1000000 bit/s (F80); expected")


def test_an_adapter_without_can_fd_is_named(end: FarEnd) -> None:
    end.answer = Adapter(unknown=(b"Y5",))
    assert "refuses one of S8, Y5, O; expected one that knows these bit rates and CAN FD" in refused(end)


def test_noise_that_looks_like_a_refusal_is_called_noise(end: FarEnd) -> None:
    """Random bytes hold a bell now and then, and a piece that has the form of an answer."""
    noise = b"\x81\r?\r\x90\x90\r!\r;;\r\aV1013\r"
    end.answer = lambda data: noise if b"O\r" in data else Adapter()(data)
    assert "5 pieces came that are no SLCAN, and no frames; expected an SLCAN adapter" in refused(end)


def test_a_rate_without_a_code_is_named_before_anything_is_opened(end: FarEnd) -> None:
    assert "SLCAN has no code for a bit rate of 750000 bit/s" in refused(end, bitrate=750_000)
    assert end.received == b""


def test_a_port_that_is_none(end: FarEnd) -> None:
    with pytest.raises(can.CanInitializationError, match="port /dev/ttyLEV9: found no such device"):
        SlcanBatchBus("/dev/ttyLEV9")


def test_an_adapter_that_says_nothing_is_taken_as_it_is(end: FarEnd, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slcan_bus, "ANSWER_S", 0.02)
    monkeypatch.setattr(slcan_bus, "SILENT_S", 0.001)
    end.answer = lambda _: b""
    with closing_bus(opened(end)) as bus:
        assert bus.status() is None
        assert bus.state is can.BusState.ACTIVE
        bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        until(lambda: end.received.endswith(b"t1230\r"))  # and with it everything before
        asked = end.received.count(b"F\r")
        for _ in range(20):
            bus.recv_batch(0.002)
        end.write(b"t1230\r")
        assert len(batch_from(bus, 1)) == 1
        assert end.received.count(b"F\r") == asked  # it does not know F: it is not asked again


def test_refusing_f_is_no_refusal_of_the_set_up(end: FarEnd) -> None:
    end.answer = Adapter(b"\a")
    with closing_bus(opened(end)) as bus:
        assert bus.status() is None
        assert bus.stream.refused == 0


def test_silence_makes_it_ask_and_bus_errors_are_a_state(end: FarEnd, bus: SlcanBatchBus) -> None:
    assert bus.state is can.BusState.ACTIVE
    end.answer.status = b"F20\r"  # type: ignore[attr-defined]
    until(lambda: len(bus.recv_batch(0.1)) == 0 and bus.state is can.BusState.PASSIVE)
    end.answer.status = b"F80\r"  # type: ignore[attr-defined]
    until(lambda: len(bus.recv_batch(0.1)) == 0 and bus.state is can.BusState.ERROR)
    end.write(b"t1230\r")  # a single bus error is none of its states: frames pass
    batch_from(bus, 1)
    assert bus.state is can.BusState.ACTIVE


def test_another_writer_is_asked_to_ask(end: FarEnd, bus: SlcanBatchBus) -> None:
    written: list[bytes] = []
    bus.ask_through(written.append)
    until(lambda: len(bus.recv_batch(0.1)) == 0 and written == [b"F\r"])
    assert end.received.endswith(b"O\rV\rF\r")
