"""Captures of the simulated controller: bytes in, bytes out. Triggers, pre-trigger, memory, refusals, both forms of blocks."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.link.codec import Decoder, encode
from bench.link.frames import FD, SENT, FrameBatch, frame, payload
from bench.rigfile import load_rig
from bench.rigfile.capture import Layout
from bench.wire.captureblock import OVERHEAD, ROOM, block_of, piece_of
from bench.wire.isotp import Reassembler
from sim_backend.controller.capture_memory import CaptureMemory, Order
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

RIG = load_rig("amb5dof")
MESSAGES = RIG.messages
assert RIG.capture is not None
SPEC = RIG.capture
NAMES = tuple(SPEC.channels)
POSITIONS = ("pos_yi", "pos_zi", "pos_yo", "pos_zo")
TICK_NS = 100_000
STATUS = Decoder(MESSAGES["CaptureStatus"])


class Host:
    """The other end of the wire."""

    def __init__(self, **truth: float) -> None:
        self.device = SimulatedController(RIG, draw(RIG, 5, truth), substeps=1)
        self.now, self.count, self.session, self.token = 10**12, 0, 7, 0

    def run(self, seconds: float, *sent: FrameBatch) -> FrameBatch:
        self.count += 1
        beat = self.message("Heartbeat", session=self.session, counter=self.count)
        ticks = round(seconds * 1e4)
        out = self.device.advance(ticks, np.concatenate([beat, *sent]), self.now)
        self.now += ticks * TICK_NS
        return out

    def message(self, name: str, **values: float) -> FrameBatch:
        return frame(MESSAGES[name].identifier, encode(MESSAGES[name], values), t_ns=self.now, flags=FD | SENT)

    def ask(self, name: str, seconds: float = 1e-3, **values: float) -> dict[str, float | str]:
        self.token = (self.token + 1) % 256
        out, _ = STATUS.decode(self.run(seconds, self.message(name, **{"token": self.token, **values})))
        assert len(out["token"]) == 1
        told = {k: float(v[0]) for k, v in out.items()}
        names = {k: MESSAGES["CaptureStatus"].signal(k).choices[int(told[k])] for k in ("status", "state")}
        return {**told, **names}

    def arm(self, channels: Sequence[str] = POSITIONS, **values: float) -> dict[str, float | str]:
        mask = Layout.of(SPEC, channels).mask
        given = {"divider": 1, "length": 100, "session": self.session, **values}
        return self.ask("CaptureArm", channels0=mask & 0xFFFFFFFF, channels1=mask >> 32, **given)

    def status(self, seconds: float = 1e-3) -> dict[str, float | str]:
        return self.ask("CaptureAsk", seconds, session=self.session, code=0)

    def read(self, number: int, offset: int, length: int, seconds: float = 0.05) -> bytes | None:
        """By ISO-TP."""
        receiver = Reassembler()
        out = self.run(1e-3, self.message("CaptureRead", number=number, offset=offset, length=length))
        for _ in range(2):
            answers = []
            for record in out[out["id"] == 0x200]:
                event = receiver.feed(payload(record))
                assert event.failure is None
                if event.received is not None:
                    found = block_of(event.received)
                    assert found is not None
                    assert (found.number, found.offset) == (number, offset)
                    return found.data
                if event.send is not None:
                    answers.append(frame(0x18, event.send, t_ns=self.now, flags=SENT))
            out = self.run(seconds, *answers)
        return None


def test_a_capture_that_is_asked_for_twice_by_the_same_request_is_armed_once() -> None:
    host = Host()
    first = host.arm(length=200, token=9)
    again = host.arm(length=200, token=9)
    assert [(r["status"], r["number"], r["token"]) for r in (first, again)] == [("OK", 1, 9)] * 2
    assert host.arm(length=200, token=10)["status"] == "WRONG_STATE"  # another request


def test_now_without_a_wait() -> None:
    host = Host()
    armed = host.arm(length=200)
    assert (armed["status"], armed["state"], armed["number"]) == ("OK", "ARMED", 1)
    assert (armed["memory"], armed["size"], armed["token"]) == (1 << 20, 200 * 8, host.token)
    begun = host.device.plant.tick - 10  # armed at the first tick of that millisecond
    done = host.status(0.025)
    assert (done["state"], done["samples"]) == ("TRIGGERED", 10)  # of the millisecond before it asked
    done = host.status()
    assert (done["state"], done["samples"], done["trigger"], done["tick"]) == ("DONE", 200, 0, begun)
    data = host.read(1, 0, 1600)
    assert data is not None
    assert zlib.crc32(data) == done["crc"]
    x = Layout.of(SPEC, POSITIONS).decoded(data)
    down = -100e-6 / np.sqrt(2)  # it rests on its rings
    assert {len(v) for v in x.values()} == {200}
    assert np.mean(x["pos_yi"]) == pytest.approx(down, abs=15e-6)
    assert 0.1e-6 < np.std(x["pos_yi"]) < 0.6e-6


def test_the_readings_are_those_of_their_ticks() -> None:
    """Telemetry is the mean of ten readings; a capture's are the ten."""
    host = Host()
    host.arm(("pos_yi", "i_yi_p"), length=300)
    host.run(0.03)
    status = host.status()
    data = host.read(1, 0, 1200)
    assert data is not None
    x = Layout.of(SPEC, ("pos_yi", "i_yi_p")).decoded(data)["pos_yi"]
    twin = Host()
    told, _ = Decoder(MESSAGES["Telemetry"]).decode(twin.run(0.05))
    first = int(status["tick"])  # type: ignore[arg-type]
    assert first % 10 == 0
    at = np.flatnonzero(told["tick"] == first + 10)[0]
    assert told["pos_yi"][at : at + 30] == pytest.approx(x.reshape(30, 10).mean(axis=1), abs=1.1e-8)


def test_a_lower_rate_takes_some_of_the_ticks() -> None:
    """Those whose number is a multiple."""
    every, third = Host(), Host()
    every.arm(length=600)
    third.arm(length=150, divider=3)
    for host in (every, third):
        host.run(0.08)
    one, other = every.status(), third.status()
    assert (one["state"], other["state"], other["tick"] % 3) == ("DONE", "DONE", 0)  # type: ignore[operator]
    x, y = (Layout.of(SPEC, POSITIONS).decoded(h.read(1, 0, n * 8) or b"") for h, n in ((every, 600), (third, 150)))
    first = int(other["tick"]) - int(one["tick"])  # type: ignore[arg-type]
    assert 0 <= first < 3
    for name in POSITIONS:
        assert y[name].tolist() == x[name][first::3][:150].tolist()


@pytest.mark.parametrize(
    ("values", "status"),
    [
        ({"length": (1 << 20) // 8 + 1}, "TOO_LARGE"),
        ({"length": 0}, "OUT_OF_RANGE"),
        ({"length": 10, "before": 10}, "OUT_OF_RANGE"),
        ({"divider": 0}, "OUT_OF_RANGE"),
        ({"trigger": 9}, "OUT_OF_RANGE"),
        ({"trigger": 1, "level": float("nan")}, "OUT_OF_RANGE"),
        ({"trigger": 1, "source": 63}, "UNKNOWN_CHANNEL"),
        ({"channels0": 0}, "UNKNOWN_CHANNEL"),
        ({"channels1": 1}, "UNKNOWN_CHANNEL"),
        ({"session": 8}, "WRONG_SESSION"),
    ],
)
def test_refusals(values: dict[str, float], status: str) -> None:
    host = Host()
    host.arm(length=5)
    assert host.status()["state"] == "DONE"
    if "channels0" in values or "channels1" in values:
        given = {"channels0": 1.0, "divider": 1, "length": 9, "session": 7, **values}
        refused = host.ask("CaptureArm", **given)
    else:
        refused = host.arm(**values)
    assert refused["status"] == status
    assert (refused["state"], refused["number"], refused["samples"]) == ("DONE", 1, 5)  # what it has stays


def test_one_at_a_time_until_it_is_given_up() -> None:
    host = Host()
    assert host.arm(trigger=1, source=0, level=1.0)["status"] == "OK"
    assert host.arm()["status"] == "WRONG_STATE"
    assert host.ask("CaptureAsk", code=1, session=8)["status"] == "WRONG_SESSION"
    assert host.ask("CaptureAsk", code=9, session=7)["status"] == "UNKNOWN"
    assert host.ask("CaptureAsk", code=1, session=7)["state"] == "IDLE"
    assert host.arm()["status"] == "OK"


def test_reads_that_cannot_be() -> None:
    host = Host()
    for number in (0, 1):
        assert host.ask("CaptureRead", number=number, length=1)["status"] == "NO_CAPTURE"
    host.arm(length=5)
    host.run(0.01)
    assert host.ask("CaptureRead", number=2, length=1)["status"] == "NO_CAPTURE"
    for values in ({"length": 41}, {"length": 0}, {"offset": 40, "length": 1}, {"length": 8, "form": 7}):
        assert host.ask("CaptureRead", number=1, **values)["status"] == "OUT_OF_RANGE"
    assert host.read(1, 8, 32) is not None
    host.device.restart()
    assert host.ask("CaptureRead", number=1, length=1)["status"] == "NO_CAPTURE"


def test_pieces_and_their_pace() -> None:
    host = Host()
    host.arm(length=5000)
    host.run(0.6)
    out = host.run(0.5, host.message("CaptureRead", number=1, form=1, length=40000))
    mine = out[out["id"] == 0x201]
    found = [piece_of(payload(record)) for record in mine]
    assert [p.offset for p in found if p is not None] == list(range(0, 40000, ROOM))
    whole = b"".join(p.data for p in found if p is not None)
    assert host.status()["crc"] == zlib.crc32(whole)
    # 3 Mbit/s carries 300 kB/s; telemetry takes 72, packets and pieces their heads
    seconds = (mine["t_ns"][-1] - mine["t_ns"][0]) * 1e-9
    assert 0.7 * 216e3 < 40000 / seconds < 216e3
    telemetry = out[out["id"] == 0x100]
    assert len(telemetry) == 500


def test_blocks_leave_the_bus_to_the_others() -> None:
    host = Host()
    host.arm(length=5000)
    host.run(0.6)
    host.run(1e-3, host.message("CaptureRead", number=1, length=40000))
    out = host.run(0.2, frame(0x18, bytes((0x30, 0, 0)), t_ns=host.now, flags=SENT))
    mine = out[out["id"] == 0x200]
    assert len(mine) == -(-(40000 + OVERHEAD - 58) // 63)
    steps = np.diff(mine["t_ns"])
    assert steps.min() > 190_000  # 145 us of frame, 73 % of the bus
    assert len(out[out["id"] == 0x100]) == 200
    assert host.device.fault == "NONE"


def test_a_new_read_ends_the_last() -> None:
    host = Host()
    host.arm(length=5000)
    host.run(0.6)
    host.run(1e-3, host.message("CaptureRead", number=1, form=1, length=40000))
    out = host.run(0.05, host.message("CaptureRead", number=1, form=1, offset=39990, length=10))
    assert [piece_of(payload(r)).offset for r in out[out["id"] == 0x201]] == [39990]  # type: ignore[union-attr]


def test_what_is_on_its_way_ends_with_the_capture() -> None:
    host = Host()
    host.arm(length=5000)
    host.run(0.6)
    assert (host.run(2e-3, host.message("CaptureRead", number=1, form=1, length=40000))["id"] == 0x201).any()
    host.arm(length=10)
    assert not (host.run(0.05)["id"] == 0x201).any()


def test_many_reads_are_no_faster() -> None:
    host = Host()
    host.arm(length=100)
    host.run(0.02)
    out = np.concatenate([
        host.run(1e-4, host.message("CaptureRead", number=1, form=1, offset=k, length=8)) for k in range(30)
    ])  # fmt: skip
    mine = out[out["id"] == 0x201]
    assert 8 <= len(mine) <= 13
    assert np.diff(mine["t_ns"]).min() > 200_000


def rows(tick: int, count: int, every: int, **columns: np.ndarray) -> np.ndarray:
    """Readings; channel pos_yi counts the ticks in um."""
    out = np.zeros((count, len(NAMES)))
    out[:, 0] = (tick + every * np.arange(count)) * 1e-6
    for name, x in columns.items():
        out[:, NAMES.index(name)] = x
    return out


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.integers(1, 40), min_size=1, max_size=20), st.integers(0, 30), st.integers(1, 60), st.integers(1, 5),
    st.integers(0, 200),
)  # fmt: skip
def test_the_trigger_is_where_it_should_be(parts: list[int], before: int, after: int, every: int, at: int) -> None:
    """However the readings are cut into parts, the sample at the trigger is the first that crosses the level, once the
    ring before it is full."""
    memory, level = CaptureMemory(SPEC, NAMES), (at + 0.5) * 1e-6
    assert memory.arm(Order(1, every, before + after, before, "RISES", 0, level)) == "OK"
    tick = 0
    for count in parts:
        if memory.every:
            memory.take(tick, rows(tick, count, every))
        assert sum(map(len, memory._kept)) <= before + after + 40  # a ring, not everything
        tick += count * every
    crossing = -(-(at + 1) // every)  # index of the first reading above
    total = sum(parts)
    if crossing >= total or crossing < before:
        assert memory.state == "ARMED"
    elif crossing + after > total:
        assert memory.state == "TRIGGERED"
        assert memory.first_tick == (crossing - before) * every
    else:
        assert memory.state == "DONE"
        assert memory.first_tick == (crossing - before) * every
        x = Layout.of(SPEC, ("pos_yi",)).decoded(memory.buffer)["pos_yi"]
        ticks = memory.first_tick + every * np.arange(before + after)
        assert x == pytest.approx(np.minimum(ticks * 1e-6, 327.67e-6), abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "channel", "x", "level", "found"),
    [
        ("RISES", "pos_zo", [0, 2, 0, 1, 3], 1.0, 1),
        ("RISES", "pos_zo", [2, 2, 0, 1, 3], 1.0, 3),  # at the level is above it
        ("FALLS", "pos_zo", [2, 2, 0, 1, 3], 1.0, 2),
        ("PULSE", "pulses", [4, 4, 4, 5, 5], 0.0, 3),
        ("PULSE", "pulses", [65535, 65535, 0, 0, 0], 0.0, 2),
        ("SPEED", "speed", [10, 20, 30, 40, 50], 25.0, 2),
        ("SPEED", "speed", [50, 40, 30, 20, 10], 25.0, 3),
        ("SPEED", "speed", [25, 25, 25, 25, 25], 25.0, None),
        ("NOW", "pos_zo", [0, 0, 0, 0, 0], 0.0, 0),
    ],
)
def test_each_trigger(kind: str, channel: str, x: list[float], level: float, found: int | None) -> None:
    for cut in range(5):
        memory = CaptureMemory(SPEC, NAMES)
        memory.arm(Order(1, 1, 1, 0, kind, SPEC.channels[channel].index, level))
        for part in (slice(0, cut), slice(cut, 5)):
            memory.take(part.start, rows(0, 5, 1, **{channel: np.array(x, float)})[part])
        assert (memory.first_tick if memory.state == "DONE" else None) == found


def test_nothing_else_hears_of_captures() -> None:
    """The telemetry of a controller that records is that of one that does not."""
    plain, recording = Host(), Host()
    recording.arm(NAMES, length=3000, before=1000)
    recording.run(0.2)
    plain.status()  # by which it knows its owner too
    plain.run(0.2)
    assert recording.status(0.01)["state"] in ("TRIGGERED", "DONE")
    plain.run(0.01)
    a, b = (h.run(0.05) for h in (plain, recording))
    assert a.tobytes() == b.tobytes()
