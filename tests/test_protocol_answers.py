"""docs/reference/protocol.md: what it says about repeats, about rest, about angles and about the other devices, against the
simulated rig and the drivers."""

from __future__ import annotations

import math
import re
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from bench.link.codec import Decoder, encode
from bench.link.fault_injection import Fault
from bench.link.frames import FD, FrameBatch, empty_batch, frame
from bench.link.session import Session
from bench.rigfile import load_rig
from drivers import operator_line, slcan_bus
from drivers.controller import Controller
from sim_backend.controller.controller import SimulatedController
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

PAGE = Path(__file__).parent.parent / "docs" / "reference" / "protocol.md"
PROSE = " ".join(PAGE.read_text(encoding="utf-8").split())
RIG = load_rig("tsbs12")
MESSAGES = RIG.messages


class Host:
    """A session that talks to the simulated controller directly, and beats."""

    def __init__(self) -> None:
        self.device = SimulatedController(RIG, draw(RIG, 1, {}))
        self.tokens, self.beats, self.now = count(), count(1), 0
        self.telemetry: dict[str, np.ndarray] = {}
        assert self.command("IDENTIFY") == "OK"  # which makes it the owner

    def run(self, seconds: float, *sent: FrameBatch) -> FrameBatch:
        out, frames = [empty_batch()], list(sent)
        for _ in range(round(seconds / 0.02)):
            frames.append(self.message("Heartbeat", session=0x11, counter=next(self.beats) % 65536))
            out.append(self.device.advance(200, np.concatenate(frames), self.now))
            self.now, frames = self.now + 20_000_000, []
        batch = np.concatenate(out)
        self.telemetry = Decoder(MESSAGES["Telemetry"]).decode(batch)[0]
        return batch

    def message(self, name: str, **values: float) -> FrameBatch:
        return frame(MESSAGES[name].identifier, encode(MESSAGES[name], values), t_ns=self.now, flags=FD)

    def command(self, name: str) -> str:
        code = MESSAGES.code("Command", "code", name)
        batch = self.run(0.02, self.message("Command", session=0x11, code=code, token=next(self.tokens) % 256))
        reply, _ = Decoder(MESSAGES["CommandReply"]).decode(batch)
        return MESSAGES["CommandReply"].signal("status").choices[int(reply["status"][0])]

    def set(self, name: str, value: float) -> None:
        self.run(0.02, self.message("ParamSet", index=RIG.parameters[name].index or 0, value=value, session8=0x11))

    def levitate(self) -> None:
        assert [self.command("ENABLE"), self.command("LEVITATE")] == ["OK", "OK"]
        self.run(2.0)
        assert self.device.state == "LEVITATED"


def test_at_rest_no_current_flows_and_contact_shows() -> None:
    assert "In OFF, READY and FAULT no current flows" in PROSE
    host = Host()
    assert host.command("ENABLE") == "OK"
    host.run(0.2)
    for name in ("i_yi_p", "i_yi_n", "i_xo_p", "i_z_p"):
        assert abs(float(host.telemetry[name].mean())) < 0.006  # the sensors' offset and noise
    assert {int(v) & 0b1100 for v in host.telemetry["flags"]} == {0b1100}
    assert host.command("LEVITATE") == "OK"
    host.run(0.1)
    assert float(host.telemetry["i_xo_p"].mean()) > 2.0


def test_a_fault_wins_over_off_at_the_end_of_a_landing() -> None:
    assert "to FAULT if a fault is latched, also where both are due" in PROSE
    host = Host()
    host.levitate()
    host.device.states.fail("SENSOR")
    assert host.command("MAKE_SAFE") == "OK"
    host.run(3.0)
    assert host.device.state == "FAULT"
    assert host.command("MAKE_SAFE") == "OK"  # "OFF and FAULT stay, and get OK as well"
    assert host.device.state == "FAULT"


def turned_to(host: Host, angle_ref: float) -> float:
    """How far the rotor turned, rad, counted over turns."""
    host.set("angle_ref", angle_ref)
    host.run(6.0)
    angles = np.unwrap(host.telemetry["angle"])
    return float(angles[-1] - angles[0])


@pytest.mark.parametrize("turns", [0, 3])
def test_angle_ref_counts_over_turns_from_the_nearest_one(turns: int) -> None:
    """At LEVITATE the nearest turn is taken, and kept."""
    host = Host()
    host.set("angle_ref", turns * 2 * math.pi)
    host.set("angle_slew", 4.0)
    host.levitate()
    assert abs(np.ptp(np.unwrap(host.telemetry["angle"]))) < 0.1  # it did not turn by `turns` turns
    assert turned_to(host, turns * 2 * math.pi + 1.0) == pytest.approx(1.0, abs=0.1)
    assert turned_to(host, (turns + 1) * 2 * math.pi + 1.0) == pytest.approx(2 * math.pi, abs=0.02)


def test_the_first_words_of_the_host() -> None:
    """All parameters are read, and those that another host left elsewhere are written."""
    found = re.search(r"a ParamGet for every parameter of the rig file, all at once \((\d+) for", PROSE)
    assert found
    assert int(found[1]) == sum(p.index is not None for p in RIG.parameters.values())
    machine = SimulatedRig(RIG, draw(RIG, 1), 1)
    machine.device.parameters.values["kd_i"] = 77.0
    controller = Controller(RIG, machine.link, machine, Session(0x1201, 0, "test"))
    controller.connect()
    assert controller.restored == ("kd_i 77",)
    assert machine.device.parameters.values["kd_i"] == RIG.parameters["kd_i"].default


@pytest.mark.parametrize("lost_s", [0.4, 0.9])
def test_a_run_outlives_replies_that_are_lost(lost_s: float) -> None:
    """ENABLE and LEVITATE are executed while their replies do not come, and once."""
    machine = SimulatedRig(RIG, draw(RIG, 1), 1, faults=[Fault("mute", start_s=1.0, duration_s=lost_s)])
    controller = Controller(RIG, machine.link, machine, Session(0x1201, 0, "test"))
    controller.connect()
    controller.clock.sleep(1.0 - machine.now_ns() % 1_000_000_000 * 1e-9 + 0.05)
    controller.enable()
    assert controller.requests.repeats >= 1
    assert controller.mode == "READY"


def test_numbers_of_the_operators_line_and_of_the_adapter() -> None:
    assert f"each answered by one line within {operator_line.ANSWER_S:g} s" in PROSE
    assert f"when no frame has come for {slcan_bus.SILENT_S:g} s" in PROSE


@pytest.mark.parametrize(
    "line", ["hang M2", "hang -", "lever left M2", "lever left -", "mount ring", "mount -", "ask TEXT"]
)
def test_the_operators_requests_are_understood(line: str) -> None:
    assert f"`{line}`" in PROSE
    answer = SimulatedRig(RIG, draw(RIG, 1), 1).request(line)
    assert answer == "yes" if line.startswith("ask") else answer.startswith("ok ")


def test_what_the_operator_does_not_know_it_refuses() -> None:
    assert SimulatedRig(RIG, draw(RIG, 1), 1).request("hang M9").startswith("error ")
