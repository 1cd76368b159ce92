"""The simulated controller behind its command line, spoken to by bytes; a host reads them by the wire format's own reader."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lira_plants import rise_s

from bench.wire.captureblock import Block
from bench.wire.commandline import Event, Line, Reply, Splitter, read_line, request
from sim_backend.machines.lira.device import Device
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import STATES, TRACE, Plant
from sim_backend.machines.lira.settings import MEASUREMENTS, SETTINGS
from sim_backend.machines.lira.streamed import TOLD

TOLD_STATE = 18  # sequence, sixteen values, supply, state


class Host:
    """Asks with tags and checksums, keeps events and blocks."""

    def __init__(self, **params: float) -> None:
        self.device = Device(Plant(PlantParams(**params), 1))  # type: ignore[arg-type]
        self.splitter = Splitter()
        self.events: list[Event] = []
        self.blocks: list[Block] = []
        self.more: list[str] = []
        self._tag = 0
        for line in (b"\n\n", b"echo off\n", b"prompt off\n"):
            self.device.shell.feed(line)

    def ask(self, *words: str) -> Reply:
        self._tag += 1
        self.more.clear()
        return self._read(self.device.shell.feed(request(self._tag, *words)))

    def wait(self, seconds: float) -> None:
        """With heartbeats."""
        for _ in range(max(1, round(seconds / 0.02))):
            self.ask("hb", str(self._tag))
            self._read(self.device.advance(min(seconds, 0.02)), replies=False)

    def _read(self, data: bytes, *, replies: bool = True) -> Reply:
        last = Reply(None, "err", "nothing came", checked=False)
        for piece in self.splitter.feed(data):
            if isinstance(piece, Block):
                self.blocks.append(piece)
                continue
            said = read_line(piece.text)
            assert said is not None, piece
            if isinstance(said, Event):
                self.events.append(said)
            elif said.kind == "more":
                self.more.append(said.text)
            else:
                last = said
        assert not replies or (last.tag == self._tag and last.checked)
        return last


def test_a_person_is_echoed_and_prompted() -> None:
    shell = Device(Plant(PlantParams(), 1)).shell
    assert shell.feed(b"hb x\x08 7\r\n") == b"hb x\x08 7\r\r\n- ok 7\r\nlira> "
    shell.feed(b"echo off\nprompt off\n")
    assert shell.feed(b"hb 8\n") == b"- ok 8\r\n"


def test_golden_requests() -> None:
    host = Host()
    shell = host.device.shell
    assert shell.feed(b"17 get kp.b*27\n") == b"17 ok kp.b=680000 N/m*4A\r\n"
    assert shell.feed(b"18 set kp.b 3e6\n") == b"18 err 3 range kp.b 0..2000000\r\n"
    assert shell.feed(b"19 set kp.b 7e5\n") == b"19 ok kp.b=700000 N/m\r\n"
    assert shell.feed(b"17 get kp.b*28\n").startswith(b"- err 6")
    assert shell.feed(b"x" * 97 + b"\n").startswith(b"- err 7")


def test_a_request_that_comes_again_is_answered_and_not_done_again() -> None:
    host = Host()
    shell = host.device.shell
    first = shell.feed(b"5 cap arm 1 35000 10 0 now\n")
    assert first == b"5 ok 1 bytes=20\r\n"
    assert shell.feed(b"5 cap arm 1 35000 10 0 now\n") == first
    assert shell.feed(b"6 cap arm 1 35000 10 0 now\n") == b"6 ok 2 bytes=20\r\n"


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("fly",), 1), (("get",), 2), (("get", "kp.q"), 2), (("set", "kp.b", "fast"), 2), (("set", "kp.b", "nan"), 2),
        (("set", "kp.b", "1e99"), 3), (("set", "kp.b", "-1"), 3), (("lift",), 4), (("land",), 4), (("clear",), 4),
        (("ref", "z", "0.01"), 4), (("step", "d_R1", "1"), 4), (("step", "d_R1", "9"), 3), (("step", "x", "1"), 2),
        (("baud", "9600"), 2), (("cap", "stat"), 10), (("cap", "read", "0", "10"), 10),
        (("cap", "arm", "0", "35000", "9", "0", "now"), 3),
        (("cap", "arm", "1ffff", "140000", "9", "0", "now"), 3), (("cap", "arm", "1", "35000", "9", "9", "now"), 3),
        (("cap", "arm", "1", "35000", "9", "0", "level", "z", "1"), 3), (("meas",), 2), (("meas", "x9"), 2), (("list",), 2),
        (("echo", "maybe"), 2), (("inj", "z", "ref", "1e-5", "99999"), 3), (("on", "rotary"), 2), (("hb", "-1"), 2),
    ],
)  # fmt: skip
def test_what_cannot_be_done_says_why(words: tuple[str, ...], code: int) -> None:
    reply = Host().ask(*words)
    assert (reply.kind, int(reply.text.split()[0])) == ("err", code)


def test_lists_name_every_parameter_and_channel() -> None:
    host = Host()
    assert host.ask("list", "par").text == str(len(SETTINGS))
    assert [line.split()[1] for line in host.more] == [s.name for s in SETTINGS]
    host.ask("list", "chan")
    assert [line.split()[1] for line in host.more] == [m.name for m in MEASUREMENTS]
    assert len(host.more) == 64


def test_every_parameter_is_got_as_it_was_set() -> None:
    host = Host()
    for s in SETTINGS:
        told = host.ask("set", s.name, repr(0.5 * (s.low + s.high))).text
        assert host.ask("get", s.name).text == told
        assert float(told.split("=")[1].split()[0]) == pytest.approx(0.5 * (s.low + s.high), rel=1e-6)
    host.ask("default")
    assert host.ask("get", "kp.b").text == "kp.b=680000 N/m"


def test_a_mission_over_the_line_tells_its_states() -> None:
    host = Host()
    host.ask("on", "current")
    host.wait(0.2)
    assert host.ask("lift").text == "LIFT"
    host.wait(1.2)
    assert "state=LEVITATED" in host.ask("stat").text
    assert host.ask("baud", "921600").kind == "err"  # its way back outlasts the watchdog
    host.ask("ref", "z", "0.014", "0.5", "40")
    host.wait(0.3)
    assert float(host.ask("meas", "z").text.split("z=")[1].split()[0]) == pytest.approx(0.014, abs=2e-5)
    host.ask("land")
    host.wait(2.0)
    told = [e.text for e in host.events if e.name == "state"]
    assert told == ["IDLE", "CURRENT", "LIFT", "LEVITATED", "LANDING", "CURRENT"]
    assert [e.tick for e in host.events] == sorted(e.tick for e in host.events)


def test_a_step_captured_at_280_kHz_has_its_rise() -> None:
    """G1 over the line: q and d of R1 from its six coil currents, by the winding's transpose."""
    host = Host(locked=1.0, supply=400.0)
    host.ask("on", "current")
    host.wait(0.02)
    mask = sum(1 << k for k, m in enumerate(MEASUREMENTS) if m.name in [f"i_s{n}" for n in range(1, 7)])
    assert host.ask("cap", "arm", f"{mask:x}", "280000", "840", "100", "step").kind == "ok"
    host.wait(0.02)
    host.ask("step", "d_R1", "3")
    host.wait(0.02)
    size = int(host.ask("cap", "stat").text.split("bytes=")[1].split()[0])
    for at in range(0, size, 4000):
        host.ask("cap", "read", str(at), "4000")
    data = b"".join(b.data for b in sorted(host.blocks, key=lambda b: b.offset))
    assert len(data) == size == 840 * 6 * 2
    i = np.frombuffer(data, "<i2").reshape(-1, 6) * 7.3e-3
    a, b, c = (0.5 * (i[:, k] + i[:, 3 + k]) for k in range(3))
    rows = np.zeros((len(i), len(TRACE)))
    rows[:, TRACE.index("i_d_R1")] = (2 * a - b - c) / 3
    assert rise_s(rows) == pytest.approx(0.107e-3, rel=0.1)  # at 400 V: less time at the limit


@pytest.mark.parametrize("amperes", [1.5, -1.5])
def test_a_step_that_says_how_long_it_lasts_ends_by_the_firmwares_ticks(amperes: float) -> None:
    """15 ms of 35 kHz, however long the host says nothing; a step without a time stays, and so does one with 0."""
    host = Host(locked=1.0)
    host.ask("on", "current")
    host.wait(0.02)
    names = [m.name for m in MEASUREMENTS]
    mask = sum(1 << names.index(f"i_s{n}") for n in range(1, 7))

    def steps(*words: str) -> int:
        assert host.ask("cap", "arm", f"{mask:x}", "35000", "2000", "10", "step").kind == "ok"
        host.wait(0.02)
        assert host.ask("step", "d_R1", *words).kind == "ok"
        host.blocks.clear()
        host.wait(0.08)
        host.ask("cap", "read", "0", "24000")
        data = b"".join(b.data for b in sorted(host.blocks, key=lambda b: b.offset))
        first = np.frombuffer(data, "<i2").reshape(-1, 6)[:, 0] * 7.3e-3
        host.ask("step", "d_R1", "0")
        return int((first * np.sign(amperes) > 0.75).sum())

    assert steps(f"{amperes}", "0.015") == pytest.approx(
        525, abs=3
    )  # the edges of both ends cancel but for their samples
    assert steps(f"{amperes}", "0") > 1900
    assert steps(f"{amperes}") > 1900
    assert host.ask("step", "d_R1", "1", "1.1").text.startswith("3 range -5..5 A 0..1 s")
    assert host.ask("step", "d_R1", "1", "-0.1").kind == "err"


def test_blocks_that_are_missing_are_read_again() -> None:
    host = Host()
    host.ask("cap", "arm", "ff", "35000", "1000", "0", "now")
    host.wait(0.04)
    host.ask("cap", "read", "0", "16000")
    whole = {b.offset: b.data for b in host.blocks}
    assert [e.text for e in host.events if e.name == "capture"] == ["1 done"]
    host.blocks.clear()
    host.ask("cap", "read", "2048", "1024")
    assert [(b.offset, b.data) for b in host.blocks] == [(2048, whole[2048])]
    host.blocks.clear()
    assert host.ask("cap", "read", "16000", "1024").text == "cap sent=0"


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    st.lists(
        st.binary(max_size=60) | st.sampled_from([b"5 lift\n", b"cap arm 1 35000 5 0 now\n", b"on current\n"]),
        max_size=12,
    )
)
def test_arbitrary_bytes_never_crash_it(parts: list[bytes]) -> None:
    device = Device(Plant(PlantParams(), 1, reduced=True))
    for part in parts:
        said = device.shell.feed(part + b"\n")
        assert all(isinstance(p, Line | Block) for p in Splitter().feed(said))
        device.advance(1e-4)


def test_each_sample_tells_the_age_of_the_heartbeat_at_its_own_instant() -> None:
    """The host is lost within a slice of the machine's time: samples before that tell the age they had."""
    host = Host()
    host.ask("idle")
    host.ask("on", "current")
    assert host.ask("stream", "1000").kind == "ok"
    for _ in range(12):  # off the grid of the samples: the last hears the host lost in the middle of a slice
        host._read(host.device.advance(10.3e-3), replies=False)
    assert host.device.plant.fault == "HEARTBEAT_LOST"
    blocks = Splitter().feed(b"".join(host.device.streamed.waiting))
    told = [TOLD.unpack(b.data) for b in blocks if isinstance(b, Block)]
    ages = np.array([t[-1] for t in told])
    state = np.array([t[TOLD_STATE] for t in told])
    held = ages[state == STATES.index("CURRENT")]
    assert held[-1] == pytest.approx(80, abs=1)  # its watchdog.s
    assert set(np.diff(held)) == {1}
    assert set(ages[state == STATES.index("FAULT")]) == {0xFFFF}
