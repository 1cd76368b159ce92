"""The rate of a serial line: a controller that begins at another one, a brown-out under way, rates that are given up."""

from __future__ import annotations

import contextlib
import os
import re
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import lira_line
import pytest
from far_end import until
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import DeviceFault
from bench.rigfile import load_rig
from bench.wire.commandline import with_checksum
from drivers.controller import Controller
from drivers.linerate import ANSWER_S, FIRST_TAG, RATE_TAG, SILENT_S, Rate
from sim_backend.machines.lira.device import RATES, Device
from sim_backend.machines.lira.uart import Uart
from sim_backend.truth import draw

LINES = load_rig("lira").commandline
assert LINES is not None
FAST = 921_600
BAUDS = {termios.B115200: 115_200, termios.B921600: FAST}
NOISE = b"\xfe\x00\xe0\x8c"
STEP_S = 2e-3


class Line:
    """The firmware on a pty that carries bytes between two ends at one rate; at different ones each hears noise."""

    def __init__(self) -> None:
        rig = load_rig("lira")
        truth = draw(rig, 5_000_000, {"reduced": 1.0})
        self.device = Device(truth.machine.make(truth.plant, truth.noise, 2))
        self._uart, self._off, self._failing = Uart(self.device), threading.Event(), threading.Event()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.where = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def brown_out(self) -> None:
        self._failing.set()

    def close(self) -> None:
        self._off.set()
        self._thread.join(5.0)
        os.close(self._master)
        os.close(self._slave)

    @property
    def host_baud(self) -> int:
        return BAUDS.get(termios.tcgetattr(self._master)[4], 0)

    def _carried(self, data: bytes, baud: int) -> bytes:
        return data if self.host_baud == baud or not data else NOISE

    def _run(self) -> None:
        last = time.monotonic()
        while not self._off.wait(STEP_S):
            now, baud = time.monotonic(), self.device.baud  # an answer goes out at the rate at which it was asked for
            said = b""
            with contextlib.suppress(BlockingIOError):
                said = os.read(self._master, 65536)
            if self._failing.is_set():
                self._failing.clear()
                told, baud = self.device.restart("brownout"), RATES[0]
            else:
                told = b""
            told += self._uart.advance(now - last, self._carried(said, baud))
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, self._carried(told, baud))
            last = now


@pytest.fixture
def line() -> Iterator[Line]:
    one = Line()
    yield one
    one.close()


def connected(where: str) -> AbstractContextManager[Controller]:
    """A bench on it, patient with a test machine that gives it no time."""
    text = (Path(__file__).parents[2] / "rigs/lira.toml").read_text()
    text = re.sub(r"(watchdog_s = .*?default = )[0-9.]+(, .*?high = )[0-9.]+", r"\g<1>5\g<2>5", text)
    return lira_line.connected(text, f"cli:serial:{where}?baudrate={FAST}")


def test_a_brown_out_is_found_again_and_told(line: Line) -> None:
    """The firmware is at 115 200 Bd again and the bench at 921 600: the run ends by the restart, and the next one begins."""
    with connected(line.where) as controller:
        assert (line.device.baud, line.host_baud) == (FAST, FAST)
        controller.clock.sleep(1.5)  # so far a tick has to fall
        line.brown_out()
        with pytest.raises(DeviceFault, match="restarted"):
            controller.clock.sleep(20.0)
        until(lambda: line.device.baud == FAST)
        assert line.host_baud == FAST
        assert controller.link.stats.reconnects == 1
    line.brown_out()
    until(lambda: line.device.baud == RATES[0])
    with connected(line.where) as controller:
        assert (line.device.baud, line.host_baud, controller.mode) == (FAST, FAST, "OFF")


def rate() -> tuple[Rate, list[int]]:
    assert LINES is not None
    puts: list[int] = []
    return Rate(puts.append, LINES, FAST, 0.0), puts


def ok(tag: int) -> bytes:
    return f"{with_checksum(f'{tag} ok 921600')}\r\n".encode()


def test_noise_after_a_good_line_is_looked_into() -> None:
    one, puts = rate()
    assert one.look(b"1 ok\r\n", True, 0.1) == one.look(NOISE, False, 0.2) == b""
    assert one.look(b"", False, 0.1 + SILENT_S + 0.01) == b"\n\n" + with_checksum(f"{FIRST_TAG} id").encode() + b"\n"
    assert puts == [RATES[0]]
    assert one.look(NOISE + b"\n" + ok(FIRST_TAG), True, 0.4).endswith(
        with_checksum(f"{RATE_TAG} baud 921600").encode() + b"\n"
    )
    assert one.look(ok(RATE_TAG), True, 0.41) == b""
    assert (puts, one.found) == ([RATES[0], FAST], 1)


def test_silence_is_left_alone_and_so_is_one_that_does_not_answer() -> None:
    one, puts = rate()
    assert {one.look(b"", False, t / 10) for t in range(100)} == {b""}
    assert puts == []
    one.look(NOISE, False, 10.0)
    assert puts == [RATES[0]]
    assert one.look(b"", False, 10.0 + ANSWER_S) == b""
    assert (puts, one.found) == ([RATES[0], FAST], 0)
    assert {one.look(b"", False, 11 + t / 10) for t in range(100)} == {b""}  # until there is noise anew
    assert puts == [RATES[0], FAST]


@given(st.lists(st.tuples(st.binary(max_size=40), st.booleans(), st.floats(0, 0.5))))
def test_whatever_comes_both_ends_are_at_one_rate_when_nothing_is_asked(reads: list[tuple[bytes, bool, float]]) -> None:
    one, puts = rate()
    now = 0.0
    for data, understood, seconds in reads:
        now += seconds
        one.look(data, understood, now)
    for k in range(3):
        one.look(b"x", True, now + 1 + k)
    assert not puts or puts[-1] == FAST
    assert puts.count(FAST) == puts.count(RATES[0])
