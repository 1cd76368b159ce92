"""The simulated controller as a device: commands in every state, parameters, watchdog, sessions; bytes only."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.link.codec import Decoder, encode
from bench.link.frames import FD, SENT, FrameBatch, empty_batch, frame
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

RIG: RigFile = load_rig("tsbs12")
MESSAGES = RIG.messages
T0 = 1_000_000_000_000
SLICE = 200  # ticks
COMMANDS = ["DISABLE", "ENABLE", "LEVITATE", "LAND", "SPIN", "STOP", "CLEAR_FAULT", "MAKE_SAFE", "IDENTIFY", "RELEASE"]


class Host:
    """The other end of the wire: sends bytes, keeps what comes back, beats every 20 ms unless told not to."""

    def __init__(self, rig: RigFile = RIG, **defects: float) -> None:
        self.rig, self.device = rig, SimulatedController(rig, draw(rig, 5, defects))
        self.now, self.beating, self.session, self.count, self.token = T0, True, 7, 0, 0
        self.seen: list[FrameBatch] = []
        self.run(0.02)  # the first heartbeat makes this host the owner

    def run(self, seconds: float, *sent: FrameBatch) -> FrameBatch:
        out = []
        frames = list(sent)
        for _ in range(round(seconds * 1e4 / SLICE)):
            if self.beating:
                self.count += 1
                frames.append(self.message("Heartbeat", session=self.session, counter=self.count))
            out.append(self.device.advance(SLICE, np.concatenate([empty_batch(), *frames]), self.now))
            self.now += SLICE * 100_000
            frames = []
        batch = np.concatenate([empty_batch(), *out])
        self.seen.append(batch)
        return batch

    def message(self, name: str, **values: float) -> FrameBatch:
        return frame(
            self.rig.messages[name].identifier, encode(self.rig.messages[name], values), t_ns=self.now, flags=FD | SENT
        )

    def command(self, name: str, session: int | None = None, again: bool = False) -> str:
        """Ask for a command, or send the last one `again` with its token."""
        self.token = (self.token + (not again)) % 256
        code = self.rig.messages.code("Command", "code", name)
        batch = self.run(0.02, self.message("Command", session=session or self.session, code=code, token=self.token))
        return status(batch, "CommandReply")

    def set(self, name: str, value: float) -> tuple[str, float]:
        index = self.rig.parameters[name].index
        batch = self.run(0.02, self.message("ParamSet", index=index, value=value, token=3, session8=self.session))
        return status(batch, "ParamReply"), float(Decoder(self.rig.messages["ParamReply"]).decode(batch)[0]["value"][0])

    def levitate(self) -> None:
        assert self.command("ENABLE") == "OK"
        assert self.command("LEVITATE") == "OK"
        self.run(2.0)
        assert self.device.state == "LEVITATED"

    def telemetry(self, seconds: float = 0.02) -> dict[str, np.ndarray]:
        return Decoder(MESSAGES["Telemetry"]).decode(self.run(seconds))[0]


def status(batch: FrameBatch, message: str) -> str:
    values, wrong = Decoder(MESSAGES[message]).decode(batch)
    assert wrong == 0
    assert len(values["status"]) == 1
    return MESSAGES[message].signal("status").choices[int(values["status"][0])]


def test_lift_hold_land_and_switch_off() -> None:
    host = Host()
    host.levitate()
    held = host.telemetry(0.2)
    for name in ("pos_xi", "pos_yi", "pos_xo", "pos_yo"):
        assert np.abs(held[name]).max() < 1e-6
    assert host.command("LAND") == "OK"
    host.run(1.5)
    assert host.device.state == "READY"
    assert host.command("DISABLE") == "OK"
    off = host.telemetry(0.1)
    assert np.abs(off["i_yo_p"]).max() < 0.03
    assert off["pos_yo"].mean() < -1e-4


ALLOWED = {
    "OFF": {"ENABLE", "DISABLE", "MAKE_SAFE", "IDENTIFY", "RELEASE"},
    "READY": {"DISABLE", "LEVITATE", "MAKE_SAFE", "IDENTIFY"},
    "LIFTING": {"MAKE_SAFE", "IDENTIFY"},
    "LEVITATED": {"LAND", "SPIN", "STOP", "MAKE_SAFE", "IDENTIFY"},
    "LANDING": {"MAKE_SAFE", "IDENTIFY"},
    "FAULT": {"CLEAR_FAULT", "MAKE_SAFE", "IDENTIFY", "RELEASE"},
}


@pytest.mark.parametrize("state", ALLOWED)
@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_in_every_state(state: str, command: str) -> None:
    host = Host()
    if state in ("LIFTING", "LEVITATED", "LANDING"):
        host.levitate()
    elif state == "READY":
        host.command("ENABLE")
    host.device.states.state = state  # the interface's state alone decides what is refused
    assert host.command(command) == ("OK" if command in ALLOWED[state] else "WRONG_STATE")


def test_make_safe_lands_and_switches_off() -> None:
    host = Host()
    host.levitate()
    assert host.command("MAKE_SAFE") == "OK"
    host.run(2.5)
    assert host.device.state == "OFF"
    assert not (host.telemetry()["flags"].astype(int) & 16).any()  # the watchdog is disarmed
    host.levitate()
    assert host.command("LAND") == "OK"
    host.run(1.5)
    assert host.device.state == "READY"


def test_an_unknown_command_and_a_zero_session_are_refused() -> None:
    host = Host()
    batch = host.run(0.02, host.message("Command", session=7, code=200, token=1))
    assert status(batch, "CommandReply") == "UNKNOWN"
    assert Decoder(MESSAGES["CommandReply"]).decode(batch)[0]["code"] == 200
    host.beating = False
    other = Host()
    other.beating = False
    batch = other.run(0.02, other.message("Command", session=0, code=1, token=1))
    assert status(batch, "CommandReply") == "WRONG_SESSION"


def test_parameters_are_range_checked_read_back_and_guarded() -> None:
    host = Host()
    host.command("IDENTIFY")  # which takes the controller; heartbeats alone do not
    assert host.set("bias_i", 2.5) == ("OK", 2.5)
    assert host.set("bias_i", 9.0) == ("OUT_OF_RANGE", 2.5)
    assert host.set("bias_i", float("nan")) == ("OUT_OF_RANGE", 2.5)
    batch = host.run(0.02, host.message("ParamSet", index=999, value=1.0, token=3))
    assert status(batch, "ParamReply") == "UNKNOWN"
    assert host.set("bias_i", 3.0) == ("OK", 3.0)
    host.levitate()
    assert host.set("bias_i", 2.0) == ("WRONG_STATE", 3.0)
    assert host.set("ref_yi", 5e-6)[0] == "OK"
    host.run(0.5)
    assert host.telemetry(0.1)["pos_yi"].mean() == pytest.approx(5e-6, abs=4e-6)


def test_without_heartbeats_the_rotor_lands_by_itself() -> None:
    host = Host()
    host.levitate()
    host.beating = False
    seen = host.telemetry(0.12)
    state = MESSAGES["Telemetry"].signal("state").choices
    lost = np.flatnonzero(np.array([state[int(s)] for s in seen["state"]]) != "LEVITATED")
    assert 58 <= lost[0] <= 82  # the watchdog is 80 ms, the last beat up to 20 ms before its loss
    host.run(2.0)
    assert host.device.state == "FAULT"
    assert host.device.fault == "HEARTBEAT_LOST"
    assert np.abs(host.telemetry(0.1)["i_yo_p"]).max() < 0.03


def test_a_spinning_rotor_coasts_down_before_it_lands() -> None:
    host = Host()
    host.levitate()
    host.set("speed_ref", 30.0)
    assert host.command("SPIN") == "OK"
    host.run(3.0)
    assert host.device.state == "SPINNING"
    assert host.command("LAND") == "WRONG_STATE"
    host.beating = False
    seen = host.telemetry(2.5)
    names = [MESSAGES["Telemetry"].signal("state").choices[int(s)] for s in seen["state"]]
    coasting = [k for k, name in enumerate(names) if name == "COASTING"]
    landing = [k for k, name in enumerate(names) if name == "LANDING"]
    assert coasting
    assert landing
    assert seen["speed"][landing[0]] < 5.5
    assert np.abs(seen["pos_yo"][coasting]).max() < 5e-5


def test_a_second_host_is_refused_while_the_first_lives() -> None:
    host = Host()
    host.levitate()
    assert host.command("LAND", session=8) == "WRONG_SESSION"
    batch = host.run(0.02, host.message("ParamSet", index=21, value=5e-6, token=1, session8=8))
    assert status(batch, "ParamReply") == "WRONG_SESSION"
    assert host.device.state == "LEVITATED"


def owner(host: Host, session: int, name: str) -> Session:
    fields = Session(session, 1_767_225_600, name).fields()
    values, _ = Decoder(MESSAGES["Owner"]).decode(host.run(0.02, host.message("Claim", **fields)))
    return Session.of({k: float(v[0]) for k, v in values.items()})


def test_a_claim_is_answered_with_who_owns_the_controller_and_since_when() -> None:
    host = Host()
    assert (
        str(owner(host, 7, "ärger@lab pid 1")) == "ärger@lab pid 1, session 0x00000007, since 2026-01-01 00:00:00 UTC"
    )
    assert owner(host, 8, "second").name == "ärger@lab pid 1"
    host.beating = False
    host.run(0.9)
    assert owner(host, 8, "second").number == 7  # gone for less than a second
    host.run(0.2)
    assert owner(host, 8, "second").name == "second"


def test_an_owner_that_releases_lets_the_next_one_in_at_once_but_not_while_levitated() -> None:
    host = Host()
    host.levitate()
    assert host.command("RELEASE") == "WRONG_STATE"
    host.command("LAND")
    host.run(1.5)
    assert host.command("DISABLE") == "OK"
    host.beating = False
    assert host.command("RELEASE") == "OK"
    assert owner(host, 8, "second").number == 8


def test_a_heartbeat_whose_counter_stands_still_shows_no_life() -> None:
    host = Host()
    host.levitate()
    host.beating = False
    for _ in range(10):
        host.run(0.02, host.message("Heartbeat", session=host.session, counter=host.count))
    assert host.device.fault == "HEARTBEAT_LOST"


def test_a_host_that_enables_and_dies_is_noticed() -> None:
    host = Host()
    host.beating = False
    assert host.command("ENABLE") == "OK"
    host.run(0.1)
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")


def test_a_fault_latches_until_it_is_cleared() -> None:
    host = Host(fault_after_s=1.0)
    host.command("ENABLE")
    host.run(1.0)
    assert host.device.state == "FAULT"
    assert host.command("LEVITATE") == "WRONG_STATE"


def test_dropped_frames_use_up_their_sequence_numbers() -> None:
    host = Host(drop_fraction=0.1)
    batch = host.run(2.0)
    values = Decoder(MESSAGES["Telemetry"]).decode(batch)[0]
    lost = int(values["seq"][-1] - values["seq"][0] + 1) - len(values["seq"])
    assert 120 < lost < 280


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([0x10, 0x11, 0x12, 0x13, 0x21, 0x7FF]), st.binary(max_size=64)), max_size=8))
def test_no_bytes_upset_the_device(frames: list[tuple[int, bytes]]) -> None:
    host = FUZZED
    batch = [frame(identifier, payload, t_ns=host.now) for identifier, payload in frames]
    host.run(0.02, *batch)
    for name, p in RIG.parameters.items():
        value = host.device.parameters.values[name]
        assert p.low - 1e-9 <= value <= p.high * (1 + 1e-6) + 1e-9, name


FUZZED = Host()


def test_a_command_that_comes_again_is_answered_again_and_executed_once() -> None:
    host = Host()
    assert [host.command("ENABLE"), host.command("ENABLE", again=True)] == ["OK", "OK"]
    assert host.command("ENABLE") == "WRONG_STATE"  # with another token it is another command
    assert [host.command("LEVITATE"), host.command("LEVITATE", again=True)] == ["OK", "OK"]
    host.run(2.0)
    assert host.device.state == "LEVITATED"
    assert [host.command("LAND"), host.command("LEVITATE")] == ["OK", "WRONG_STATE"]


def test_a_fault_of_its_own_is_not_cleared_by_a_repeat() -> None:
    host = Host()
    host.levitate()
    host.device.states.fail("LEVITATION_LOST")
    assert host.command("CLEAR_FAULT") == "OK"
    host.device.states.fail("LEVITATION_LOST")
    assert host.command("CLEAR_FAULT", again=True) == "OK"
    assert host.device.state == "FAULT"


def test_what_an_owner_asked_for_is_forgotten_with_it() -> None:
    host = Host()
    assert host.command("ENABLE") == "OK"
    token = host.token
    assert [host.command("DISABLE"), host.command("RELEASE")] == ["OK", "OK"]
    host.token = token
    assert host.command("ENABLE", again=True) == "OK"
    assert host.device.state == "READY"
