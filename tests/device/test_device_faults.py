"""Faults inside the simulated controller and on its in-process link: what host and machine see of them."""

from __future__ import annotations

import numpy as np
import pytest

from bench.errors import ConfigError, LinkError
from bench.link import fault_injection
from bench.link.codec import Decoder, encode
from bench.link.frames import ERROR, FD, SENT, FrameBatch, empty_batch, frame
from bench.rigfile import RigFile, load_rig
from sim_backend.controller.controller import SimulatedController
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG: RigFile = load_rig("tsbs12")
MESSAGES = RIG.messages
TELEMETRY = MESSAGES["Telemetry"].identifier
T0 = 1_000_000_000_000
SLICE = 200  # ticks
SESSION = 7


class Host:
    """The other end of the wire, beating every 20 ms; the first beat is the origin of the faults' times."""

    def __init__(self, *texts: str) -> None:
        self.device = SimulatedController(RIG, draw(RIG, 5), [fault_injection.parse(text) for text in texts])
        self.now, self.count = T0, 0

    def run(self, seconds: float, *sent: FrameBatch, slice_ticks: int = SLICE) -> FrameBatch:
        out, frames = [], list(sent)
        for _ in range(round(seconds * 1e4 / slice_ticks)):
            if (self.now - T0) % 20_000_000 == 0:
                self.count += 1
                frames.append(message("Heartbeat", self.now, session=SESSION, counter=self.count))
            out.append(self.device.advance(slice_ticks, np.concatenate([empty_batch(), *frames]), self.now))
            self.now += slice_ticks * 100_000
            frames = []
        return np.concatenate([empty_batch(), *out])

    def command(self, name: str) -> FrameBatch:
        code = MESSAGES.code("Command", "code", name)
        return self.run(0.02, message("Command", self.now, session=SESSION, code=code, token=9))

    def levitate(self) -> None:
        self.command("ENABLE")
        self.command("LEVITATE")
        self.run(1.96)
        assert self.device.state == "LEVITATED"


def message(name: str, t_ns: int, **values: float) -> FrameBatch:
    return frame(MESSAGES[name].identifier, encode(MESSAGES[name], values), t_ns=t_ns, flags=FD | SENT)


def telemetry(batch: FrameBatch) -> dict[str, np.ndarray]:
    values, wrong = Decoder(MESSAGES["Telemetry"]).decode(batch)
    assert wrong == 0
    return values


def states(batch: FrameBatch) -> list[str]:
    choices = MESSAGES["Telemetry"].signal("state").choices
    return [choices[int(s)] for s in telemetry(batch)["state"]]


def test_a_reboot_begins_anew_from_sequence_0_and_leaves_the_rotor_lying() -> None:
    host = Host("reboot@2.5+0.3")
    host.levitate()
    host.device.parameters.values["bias_i"] = 2.5
    seen = host.run(1.5)  # to 3.5 s
    values = telemetry(seen)
    (at,) = np.flatnonzero(np.diff(values["tick"]) < 0)
    assert values["seq"][at + 1 :].tolist() == list(range(len(values["seq"]) - at - 1))
    assert values["tick"][at + 1 :].tolist() == [10 * (k + 1) for k in range(len(values["seq"]) - at - 1)]
    own = seen[seen["id"] == TELEMETRY]
    assert (own["t_ns"][at], own["t_ns"][at + 1]) == (T0 + 2_500_000_000, T0 + 2_801_000_000)
    assert set(states(seen)[: at + 1]) == {"LEVITATED"}
    assert set(states(seen)[at + 1 :]) == {"OFF"}
    assert values["pos_yo"][-100:].mean() < -1e-4
    assert np.abs(values["i_yo_p"][-100:]).max() < 0.03
    assert host.device.parameters.values["bias_i"] == 3.0


def test_a_controller_that_reboots_is_deaf_first_and_then_knows_nobody() -> None:
    host = Host("reboot@0.5+0.1")
    host.command("IDENTIFY")
    host.run(0.46)
    assert host.device._owner.session == SESSION
    host.run(0.02)
    assert len(host.command("ENABLE")) == 0
    assert (host.device.state, host.device._owner.session) == ("OFF", 0)
    host.run(0.18)
    assert host.device._owner.session == 0  # heartbeats take nothing
    assert len(host.command("ENABLE")) > 0
    assert (host.device.state, host.device._owner.session) == ("READY", SESSION)


def test_the_reboot_comes_at_its_time_however_time_is_sliced() -> None:
    coarse, fine = Host("reboot@0.05+0.02"), Host("reboot@0.05+0.02")
    assert coarse.run(0.2).tobytes() == fine.run(0.2, slice_ticks=25).tobytes()


def test_two_reboots_come_in_the_order_of_their_times() -> None:
    host = Host("reboot@0.3+0.02", "reboot@0.1+0.02")
    seen = telemetry(host.run(1.0, slice_ticks=5000))
    assert np.flatnonzero(np.diff(seen["tick"]) < 0).tolist() == [99, 279]


def test_a_stuck_heartbeat_lands_the_rotor() -> None:
    host = Host("stuck-heartbeat@2.5")
    host.levitate()
    seen = states(host.run(2.5))
    lost = next(k for k, state in enumerate(seen) if state != "LEVITATED")
    assert 560 <= lost <= 562  # from 2.0 s on: the last beat that counted came at 2.48 s, the watchdog waits 80 ms
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")


def test_a_stuck_heartbeat_shorter_than_the_watchdog_is_survived() -> None:
    host = Host("stuck-heartbeat@2.5+0.05")
    host.levitate()
    host.run(1.0)
    assert host.device.state == "LEVITATED"


def test_a_mute_controller_talks_and_lives_but_does_not_answer() -> None:
    host = Host("mute@2.5+0.5")
    host.levitate()
    host.run(0.6)
    silent = host.command("MAKE_SAFE")
    assert set(silent["id"].tolist()) == {TELEMETRY}
    host.run(0.5)
    assert host.device.state == "LEVITATED"
    answered = host.command("MAKE_SAFE")
    assert MESSAGES["CommandReply"].identifier in answered["id"]
    assert host.device.state == "LANDING"


def test_without_faults_nothing_changes() -> None:
    assert Host().run(0.3).tobytes() == Host("reboot@9", "mute@9", "stuck-heartbeat@9").run(0.3).tobytes()


def test_a_controller_has_no_faults_of_the_link() -> None:
    with pytest.raises(ConfigError, match=r"drop=0\.1@0: happens on the link"):
        Host("drop=0.1")


class Line:
    """A simulated rig, polled every 10 ms."""

    def __init__(self, *texts: str, reconnect_s: float = 0.0) -> None:
        link = RIG.link.model_copy(update={"reconnect_s": reconnect_s})
        rig = RIG.model_copy(update={"links": {**RIG.links, RIG.devices["controller"].link: link}})
        self.rig = SimulatedRig(rig, draw(RIG, 5), SESSION, [fault_injection.parse(text) for text in texts])
        self.start = self.rig.now_ns()

    def run(self, seconds: float) -> FrameBatch:
        out = []
        for _ in range(round(seconds / 0.01)):
            self.rig.link.renew_lease()
            self.rig.sleep(0.01)
            out.append(self.rig.link.receive())
        return np.concatenate([empty_batch(), *out])

    def command(self, name: str) -> None:
        code = MESSAGES.code("Command", "code", name)
        self.rig.link.send(message("Command", 0, session=SESSION, code=code, token=1))


def test_frames_are_dropped_and_destroyed_on_the_in_process_link() -> None:
    line = Line("drop=0.1@0.5", "corrupt=0.1@0.5")
    assert np.diff(telemetry(line.run(0.5))["seq"]).max() == 1
    seen = line.run(2.0)
    destroyed = int((seen["flags"] & ERROR != 0).sum())
    assert 140 < destroyed < 220
    assert line.rig.link.stats.error_frames == destroyed
    assert line.rig.link.stats.received == 500 + len(seen)
    assert 1740 < len(seen) < 1860


def test_a_stall_holds_back_both_ways_and_then_lets_everything_through() -> None:
    line = Line("stall@0.2+0.3")
    line.run(0.2)
    line.command("ENABLE")
    assert len(line.run(0.29)) == 0
    assert line.rig.device.state == "OFF"
    seen = line.run(0.05)
    assert telemetry(seen)["seq"].size >= 300
    assert line.rig.device.state == "READY"  # the watchdog is armed by the command that came late


def test_a_stall_longer_than_the_watchdog_lands_the_rotor() -> None:
    line = Line("stall@3+0.2")
    line.run(0.1)
    line.command("ENABLE")
    line.run(0.1)
    line.command("LEVITATE")
    line.run(2.8)
    assert line.rig.device.state == "LEVITATED"
    line.run(0.15)
    assert (line.rig.device.state, line.rig.device.fault) == ("LANDING", "HEARTBEAT_LOST")


@pytest.mark.parametrize("kind", ["disconnect", "bus-off"])
def test_a_cut_is_told_at_both_ends_of_the_call_and_loses_what_was_sent(kind: str) -> None:
    line = Line(f"{kind}@0.2+0.3")
    line.run(0.2)
    with pytest.raises(LinkError, match=f"injected: {kind}"):
        line.run(0.02)
    with pytest.raises(LinkError, match=f"injected: {kind}"):
        line.command("ENABLE")
    for _ in range(40):  # nobody looks meanwhile
        line.rig.sleep(0.01)
    seen = line.run(0.1)
    assert line.rig.device.state == "OFF"
    assert telemetry(seen)["tick"][0] == 10_000  # at 0.5 s, the end of the cut; it was on for 0.5 s before
    stats = line.rig.link.stats
    assert (stats.bus_off, stats.reconnects) == ((1, 0) if kind == "bus-off" else (0, 1))


def test_a_cut_that_is_over_before_anybody_looked_is_told_in_its_place() -> None:
    line = Line("bus-off@0.2+0.05")
    line.rig.link.renew_lease()
    line.rig.sleep(0.3)
    before = telemetry(line.rig.link.receive())["tick"]
    with pytest.raises(LinkError, match="bus-off"):
        line.rig.link.receive()
    after = telemetry(line.rig.link.receive())["tick"]
    assert (before[-1], after[0]) == (5000 + 1990, 5000 + 2500)
    assert line.rig.link.stats.received == len(before) + len(after)


def test_a_link_that_reconnects_mends_a_short_disconnect() -> None:
    line = Line("disconnect@0.2+0.3", reconnect_s=1.0)
    seen = telemetry(line.run(1.0))
    assert np.diff(seen["seq"]).max() == 301
    assert line.rig.link.stats.reconnects == 1


def test_equal_seeds_give_equal_faults_however_often_the_link_is_read() -> None:
    texts = ("drop=0.05", "duplicate=0.05", "delay=0.015@0.3")
    often, seldom = Line(*texts), Line(*texts)
    seldom.rig.link.renew_lease()
    seldom.rig.sleep(1.0)
    assert seldom.rig.link.receive().tobytes() == often.run(1.0).tobytes()
