"""The Modbus adapter against ends that answer what the test writes down, byte by byte."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from far_end import FarEnd, far_end, until
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.errors import ConfigError, LinkError
from bench.rigfile import LinkSpec
from bench.rigfile.registers import RegisterRefused
from drivers.modbus import ModbusLine, ModbusPort
from sim_backend.devices.modbus_server import crc16

READ = bytes.fromhex("04 00 64 00 02")  # input registers 100 and 101
Answer = Callable[[bytes], bytes]


def tcp_answer(request: bytes, pdu: str) -> bytes:
    """A response to a Modbus TCP request: its transaction and unit come back."""
    data = bytes.fromhex(pdu)
    return request[:4] + (len(data) + 1).to_bytes(2, "big") + request[6:7] + data


def link_spec(url: str, options: Mapping[str, object] | None = None, **keys: object) -> LinkSpec:
    return LinkSpec.model_validate({"url": url, "options": options or {"timeout_s": 0.2}, **keys})


@contextmanager
def line(answer: Answer, scheme: str = "modbus-tcp", **keys: object) -> Iterator[tuple[FarEnd, ModbusLine]]:
    with far_end(tcp=scheme != "modbus-rtu", answer=answer) as end:
        where = end.where.removeprefix("socket://")
        spec = LinkSpec.model_validate({"url": f"{scheme}:{where}", "options": {"timeout_s": 0.2}, **keys})
        modbus = ModbusLine("fieldbus", spec)
        try:
            modbus.open()
            yield end, modbus
        finally:
            modbus.close()


@contextmanager
def lost_line(**keys: object) -> Iterator[ModbusLine]:
    """One that was open, and whose other end is gone for good."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"modbus-tcp:127.0.0.1:{listener.getsockname()[1]}"
        modbus = ModbusLine("fieldbus", LinkSpec.model_validate({"url": url, "options": {"timeout_s": 0.2}, **keys}))
        modbus.open()
    try:
        yield modbus
    finally:
        modbus.close()


def read_supply(port: ModbusPort) -> tuple[int, ...]:
    return port.read("input", 100, 2)


def test_tcp_read_by_hand() -> None:
    with line(lambda r: tcp_answer(r, "04 04 39 d0 00 23")) as (end, modbus):
        assert read_supply(modbus.port(2)) == (14800, 35)
        assert end.received[2:] == bytes.fromhex("00 00 00 06 02") + READ
        assert (modbus.stats.sent, modbus.stats.received, modbus.stats.malformed) == (1, 1, 0)


def test_tcp_write_by_hand() -> None:
    with line(lambda r: tcp_answer(r, "10 00 01 00 02")) as (end, modbus):
        modbus.port(1).write(1, (0x750C, 1))
        assert end.received[2:] == bytes.fromhex("00 00 00 0b 01 10 00 01 00 02 04 75 0c 00 01")


@pytest.mark.parametrize("scheme", ["modbus-rtu-tcp", "modbus-rtu"])
def test_rtu_read_by_hand(scheme: str) -> None:
    """The textbook's request 01 03 00 00 00 0A with its check C5 CD."""
    response = bytes.fromhex("01 03 14" + "00 07" * 10)
    checked = response + crc16(response).to_bytes(2, "little")
    with line(lambda _: checked, scheme) as (end, modbus):
        assert modbus.port(1).read("holding", 0, 10) == (7,) * 10
        assert end.received == bytes.fromhex("01 03 00 00 00 0a c5 cd")


def test_an_exception_response_is_an_error_with_its_code() -> None:
    with line(lambda r: tcp_answer(r, "84 02")) as (_, modbus):
        with pytest.raises(
            RegisterRefused, match="link fieldbus: unit 2, input registers 100 to 101: exception 2"
        ) as e:
            read_supply(modbus.port(2))
        assert e.value.code == 2
        assert modbus.stats.reconnects == 0


@pytest.mark.parametrize(
    ("pdu", "text"),
    [
        ("04 02 39 d0", "found 1 registers; expected 2"),
        ("03 04 39 d0 00 23", "found the answer to function 3"),
    ],
)
def test_an_answer_to_something_else_is_an_error(pdu: str, text: str) -> None:
    with line(lambda r: tcp_answer(r, pdu)) as (_, modbus):
        with pytest.raises(LinkError, match=text):
            read_supply(modbus.port(2))
        assert modbus.stats.malformed == 1


def test_a_write_s_echo_is_checked() -> None:
    with line(lambda r: tcp_answer(r, "10 00 05 00 01")) as (_, modbus), pytest.raises(LinkError, match="an echo of 1"):
        modbus.port(1).write(1, (3,))


@pytest.mark.parametrize("spoiled", ["unit", "transaction", "silence", "garbage"])
def test_an_answer_that_is_not_the_request_s_is_none(spoiled: str) -> None:
    def answer(request: bytes) -> bytes:
        good = tcp_answer(request, "04 04 39 d0 00 23")
        return {
            "unit": good[:6] + b"\x09" + good[7:],
            "transaction": b"\x7f\x7f" + good[2:],
            "silence": b"",
            "garbage": bytes(range(64)),
        }[spoiled]

    with line(answer) as (_, modbus), pytest.raises(LinkError, match="link fieldbus: modbus-tcp:"):
        read_supply(modbus.port(2))


def test_a_spoiled_check_is_no_answer() -> None:
    with line(lambda _: bytes.fromhex("02 04 04 39 d0 00 23 00 00"), "modbus-rtu-tcp") as (_, modbus):
        with pytest.raises(LinkError, match="no usable answer"):
            read_supply(modbus.port(2))


def test_a_late_answer_is_not_taken_for_the_next_request_s() -> None:
    """RTU frames have no transaction: after a failure the connection is a new one."""
    late = bytes.fromhex("02 04 04 11 11 22 22")
    good = bytes.fromhex("02 04 04 39 d0 00 23")

    def answer(_: bytes) -> bytes:
        if end.clients == 1:
            return b""
        return good + crc16(good).to_bytes(2, "little")

    with line(answer, "modbus-rtu-tcp", reconnect_s=20.0) as (end, modbus):
        assert read_supply(modbus.port(2)) == (14800, 35)
        assert end.clients == 2
        assert late not in end.received


def test_a_lost_connection_is_opened_anew_within_its_time() -> None:
    def answer(request: bytes) -> bytes:
        if end.clients < 3:
            end.hang_up()
            return b""
        return tcp_answer(request, "04 04 39 d0 00 23")

    with line(answer, reconnect_s=20.0) as (end, modbus):
        assert read_supply(modbus.port(2)) == (14800, 35)
        assert modbus.stats.reconnects == 1  # one outage, however often it was tried
        assert end.clients == 3


def test_without_reconnect_a_lost_connection_is_an_error_at_once() -> None:
    with lost_line() as modbus:
        for _ in range(2):
            with pytest.raises(LinkError, match="link fieldbus: modbus-tcp:"):
                read_supply(modbus.port(2))
        assert modbus.stats.reconnects == 0


def test_trying_again_ends() -> None:
    with lost_line(reconnect_s=0.3) as modbus:
        with pytest.raises(LinkError):
            read_supply(modbus.port(2))
        assert modbus.stats.sent >= 2
        assert modbus.stats.reconnects == 0  # it never came back


def test_without_reconnect_only_a_write_opens_the_connection_anew() -> None:
    def answer(request: bytes) -> bytes:
        if end.clients < 2:
            end.hang_up()
            return b""
        return tcp_answer(request, "10 00 00 00 01" if request[7] == 16 else "04 04 39 d0 00 23")

    with line(answer) as (end, modbus):
        with pytest.raises(LinkError):
            read_supply(modbus.port(2))
        with pytest.raises(LinkError, match="lost, and reconnect_s is 0"):
            read_supply(modbus.port(2))
        assert end.clients == 1
        modbus.port(1).write(0, (0,))
        assert read_supply(modbus.port(2)) == (14800, 35)
        assert (end.clients, modbus.stats.reconnects) == (2, 1)


def test_closing_ends_a_request_that_tries_again() -> None:
    with lost_line(reconnect_s=30.0) as modbus:
        failed = threading.Event()

        def ask() -> None:
            with pytest.raises(LinkError):
                read_supply(modbus.port(2))
            failed.set()

        thread = threading.Thread(target=ask)
        thread.start()
        until(lambda: modbus.stats.sent >= 2)
        modbus.close()
        thread.join(20.0)
        assert failed.is_set()
        with pytest.raises(LinkError, match="closed"):
            read_supply(modbus.port(2))


def test_nobody_there() -> None:
    with socket.socket() as bound:  # and not listening
        bound.bind(("127.0.0.1", 0))
        modbus = ModbusLine("fieldbus", link_spec(f"modbus-tcp:127.0.0.1:{bound.getsockname()[1]}"))
        with pytest.raises(
            ConfigError, match=r"nobody answers there\. Next: start what answers there, or correct \[links"
        ):
            modbus.open()
        modbus.close()


def test_a_port_that_is_none() -> None:
    modbus = ModbusLine("fieldbus", link_spec("modbus-rtu:/dev/no-such-port"))
    with pytest.raises(ConfigError, match="the port cannot be opened"):
        modbus.open()
    modbus.close()


@pytest.mark.parametrize(
    ("url", "options", "text"),
    [
        ("slcan:/dev/ttyACM0", {}, "found slcan:/dev/ttyACM0; expected such as modbus-tcp:"),
        ("modbus-tcp:nowhere", {}, "expected HOST:PORT"),
        ("modbus-tcp:localhost:502?baudrate=9600", {}, "found baudrate=9600; expected no settings"),
        ("modbus-rtu:/dev/ttyUSB0?baud=9600", {}, "found baud=9600; expected baudrate, parity"),
        ("modbus-rtu:/dev/ttyUSB0?baudrate=fast", {}, "found baudrate=fast"),
        ("modbus-rtu:/dev/ttyUSB0?parity=X", {}, "expected parity N, E or O"),
        ("modbus-rtu:/dev/ttyUSB0?baudrate=0", {}, "positive baudrate"),
        ("modbus-rtu:socket://localhost:502", {}, "or modbus-rtu-tcp:HOST:PORT"),
        ("modbus-tcp:localhost:502", {"timeout_s": 0}, "expected at most timeout_s"),
        ("modbus-tcp:localhost:502", {"retries": 3}, "expected at most timeout_s"),
        ("modbus-tcp:localhost:502", {"timeout_s": True}, "expected at most timeout_s"),
    ],
)
def test_a_link_that_cannot_be(url: str, options: dict[str, float], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        ModbusLine("fieldbus", link_spec(url, options))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.binary(min_size=1, max_size=300), st.sampled_from(["modbus-tcp", "modbus-rtu-tcp"]))
def test_any_answer_is_two_registers_or_an_error(data: bytes, scheme: str) -> None:
    with line(lambda _: data, scheme, options={"timeout_s": 0.02}) as (_, modbus):
        try:
            words = read_supply(modbus.port(2))
        except LinkError:
            return
        assert len(words) == 2
        assert bytes(b for w in words for b in divmod(w, 256)) in data


def test_requests_of_threads_do_not_mix() -> None:
    def answer(request: bytes) -> bytes:
        address = request[8:10]
        return request[:4] + b"\0\x05" + request[6:7] + b"\x04\x02" + address

    with line(answer) as (_, modbus), ThreadPoolExecutor(4) as pool:
        asked = list(range(1000, 1100))
        found = list(pool.map(lambda a: modbus.port(a % 3 + 1).read("input", a, 1), asked))
        assert found == [(a,) for a in asked]
