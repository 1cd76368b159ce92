"""Register devices that are only read."""

from __future__ import annotations

import pytest

from bench.clock import WallClock
from bench.errors import LinkError
from bench.rigfile import load_rig
from bench.rigfile.registers import Table, Words
from drivers.register_reading import ReadPort, RegisterReading


class Kept:
    """A port that keeps what is written to it."""

    def __init__(self) -> None:
        self.written: list[tuple[int, Words]] = []

    def read(self, table: Table, address: int, count: int) -> Words:
        return tuple(range(address, address + count))

    def write(self, address: int, words: Words) -> None:
        self.written.append((address, words))


def test_a_port_is_read_and_not_written() -> None:
    port = Kept()
    reading = ReadPort(port)
    assert reading.read("input", 3, 2) == (3, 4)
    with pytest.raises(LinkError, match="holding register 7: the device is only read; nothing is written to it"):
        reading.write(7, (1,))
    assert port.written == []


def test_devices_that_are_not_there_are_told_and_hinder_nothing() -> None:
    rig = load_rig("tsbs12")
    links = {**rig.links, "fieldbus": rig.links["fieldbus"].model_copy(update={"url": "modbus-tcp:127.0.0.1:9"})}
    reading = RegisterReading(rig.model_copy(update={"links": links}), WallClock())
    try:
        assert list(reading.unreachable) == ["drive", "supply", "thermal"]
        assert "nobody answers there" in reading.unreachable["drive"]
        assert (reading.layouts, reading.take()) == ((), ([], []))
    finally:
        reading.close()
        reading.close()
