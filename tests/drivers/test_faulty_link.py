"""A link with faults around a sound one: here around the in-process link of a simulated rig, in virtual time."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from bench.errors import BenchError, ConfigError, DeviceFault, LinkError, NoReply
from bench.link import fault_injection
from bench.link.codec import Decoder, encode
from bench.link.frames import ERROR, FD, SENT, FrameBatch, empty_batch, frame
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from drivers.controller import Controller
from drivers.faulty_link import FaultyLink
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG: RigFile = load_rig("tsbs12")
MESSAGES = RIG.messages
TELEMETRY = MESSAGES["Telemetry"].identifier
SESSION = Session(7, 1_767_225_600, "test")


class Bench:
    """A sound rig and a link with faults to it. The link hushes as a live one does: heartbeats end at once."""

    def __init__(self, *texts: str, reconnect_s: float = 0.0) -> None:
        self.rig = SimulatedRig(RIG, draw(RIG, 5), SESSION.number)
        self.link = FaultyLink(
            self.rig.link, [fault_injection.parse(text) for text in texts], 1, self.rig, telemetry=[TELEMETRY],
            hush=self.rig.link.close, reconnect_s=reconnect_s,
        )  # fmt: skip

    def command(self, name: str) -> None:
        code = MESSAGES.code("Command", "code", name)
        payload = encode(MESSAGES["Command"], {"session": SESSION.number, "code": code, "token": 1})
        self.link.send(frame(MESSAGES["Command"].identifier, payload, flags=FD | SENT))

    def run(self, seconds: float) -> FrameBatch:
        out = []
        for _ in range(round(seconds / 0.01)):
            self.link.renew_lease()
            self.rig.sleep(0.01)
            out.append(self.link.receive())
        return np.concatenate([empty_batch(), *out])

    def begin(self) -> None:
        """The first frame that the host sends: from here on times of faults count."""
        self.command("IDENTIFY")


def ticks(batch: FrameBatch) -> list[int]:
    values, _ = Decoder(MESSAGES["Telemetry"]).decode(batch)
    return [int(t) for t in values["tick"]]


def test_a_link_without_faults_is_the_link() -> None:
    sound, wrapped = SimulatedRig(RIG, draw(RIG, 5), SESSION.number), Bench()
    wrapped.begin()
    sound.link.send(frame(0x011, encode(MESSAGES["Command"], {"session": 7, "code": 8, "token": 1}), flags=FD | SENT))
    sound.link.renew_lease()
    sound.sleep(0.5)
    assert wrapped.run(0.5).tobytes() == sound.link.receive().tobytes()
    assert wrapped.link.stats == sound.link.stats
    assert wrapped.link.name == sound.link.name


def test_what_only_a_controller_can_have_is_refused() -> None:
    with pytest.raises(ConfigError, match="reboot@0: happens inside the controller"):
        Bench("drop=0.1", "reboot")


def test_dropped_and_destroyed_frames_are_counted() -> None:
    bench = Bench("drop=0.1@0.5001", "corrupt=0.1@0.5001")
    bench.begin()
    before = bench.run(0.5)
    assert len(ticks(before)) == 500
    after = bench.run(1.0)
    destroyed = int((after["flags"] & ERROR != 0).sum())
    assert 860 < len(after) < 940
    assert 60 < destroyed < 120
    stats = bench.link.stats
    assert (stats.received, stats.error_frames) == (len(before) + len(after), destroyed)


def test_a_stall_keeps_what_either_side_sends() -> None:
    bench = Bench("stall@0.1+0.06")
    bench.begin()
    bench.run(0.1)
    assert len(bench.run(0.02)) == 0
    bench.command("ENABLE")
    assert len(bench.run(0.03)) == 0
    assert bench.rig.device.state == "OFF"
    freed = bench.run(0.04)
    assert ticks(freed)[:60] == list(range(6000, 6600, 10))
    assert bench.rig.device.state == "READY"


@pytest.mark.parametrize("kind", ["stall", "disconnect", "bus-off"])
def test_while_nothing_passes_heartbeats_end_and_the_rotor_lands_by_itself(kind: str) -> None:
    bench = Bench(f"{kind}@2.1501")
    bench.begin()
    bench.command("ENABLE")
    bench.run(0.1)
    bench.command("LEVITATE")
    bench.run(2.05)
    assert bench.rig.device.state == "LEVITATED"
    for _ in range(15):
        with nullcontext() if kind == "stall" else pytest.raises(LinkError, match=f"injected: {kind}@2.1501"):
            bench.run(0.01)
    assert (bench.rig.device.state, bench.rig.device.fault) == ("LANDING", "HEARTBEAT_LOST")


@pytest.mark.parametrize("kind", ["disconnect", "bus-off"])
def test_a_cut_is_an_error_at_the_next_call_and_what_came_before_comes_first(kind: str) -> None:
    bench = Bench(f"{kind}@0.2+0.05")
    bench.begin()
    bench.link.renew_lease()
    bench.rig.sleep(0.22)
    with pytest.raises(LinkError, match=f"{kind}@0.2"):
        bench.command("ENABLE")
    bench.rig.sleep(0.08)
    before = bench.link.receive()
    assert bench.link.stats.received == len(before)
    with pytest.raises(LinkError, match=f"{kind}@0.2"):
        bench.link.receive()
    after = bench.link.receive()
    assert (ticks(before)[-1], ticks(after)[0]) == (5000 + 1990, 5000 + 2500)
    stats = bench.link.stats
    assert (stats.bus_off, stats.reconnects) == ((1, 0) if kind == "bus-off" else (0, 1))
    assert stats.received == len(before) + len(after)


def test_a_link_that_reconnects_only_counts_a_short_disconnect() -> None:
    bench = Bench("disconnect@0.2+0.05", reconnect_s=1.0)
    bench.begin()
    assert len(ticks(bench.run(0.5))) == 450
    assert bench.link.stats.reconnects == 1
    bench.run(0.1)  # its heartbeat is back
    assert bench.rig.device._owner.heartbeat > bench.rig.device.plant.tick - 300


def test_a_mute_link_brings_telemetry_and_no_replies_though_commands_are_obeyed() -> None:
    bench = Bench("mute@0.1")
    bench.begin()
    bench.run(0.1)
    bench.command("ENABLE")
    assert set(bench.run(0.1)["id"].tolist()) == {TELEMETRY}
    assert bench.rig.device.state == "READY"


def test_closing_closes_the_link_and_drops_what_waits() -> None:
    bench = Bench("stall@0+0.1")
    bench.begin()
    bench.link.close()
    bench.link.close()
    bench.rig.sleep(0.2)
    bench.link.receive()
    bench.rig.sleep(0.1)
    assert bench.rig.link.stats.sent == 0


def controller(bench: Bench) -> Controller:
    opened = Controller(RIG, bench.link, bench.rig, SESSION)
    opened.connect()
    return opened


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ("stall@1.5", LinkError, "no telemetry for 0.6"),
        ("disconnect@1.5", LinkError, "unplugged"),
        ("bus-off@1.5", LinkError, "bus-off"),
        ("delay=0.7@1.5", LinkError, "no telemetry for 0.6"),
        ("burst=0.7@1.5", LinkError, "no telemetry for 0.6"),
        ("stall@1.5+0.2", DeviceFault, "HEARTBEAT_LOST"),
    ],
)
def test_the_driver_names_what_it_notices(text: str, error: type[BenchError], said: str) -> None:
    driver = controller(Bench(text))
    driver.enable()
    driver.levitate()
    with pytest.raises(error, match=said):
        driver.clock.sleep(3.0)


def test_the_driver_names_the_reply_that_does_not_come() -> None:
    driver = controller(Bench("mute@1"))
    driver.clock.sleep(1.0)
    with pytest.raises(NoReply, match="the reply to ENABLE; it did not come, though it was asked for 3 times"):
        driver.enable()
