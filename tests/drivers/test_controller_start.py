"""What a bench finds when it opens a controller, and what it does about it; a controller that reports nonsense."""

from __future__ import annotations

import pytest

from bench.cli import safety
from bench.errors import ConfigError, DeviceFault
from bench.link import Link, LinkStats
from bench.link.frames import SENT, FrameBatch, frame
from bench.link.session import Session
from bench.rigfile import load_rig
from bench.run.job import WatchedClock
from bench.run.supervisor import Supervisor
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("tsbs12")
STATE_AT = 56  # byte of Telemetry


class Altered:
    """A link that replaces the state in the telemetry once `state` is set, and brings another host's frames."""

    def __init__(self, link: Link) -> None:
        self._link, self.name = link, link.name
        self.state: int | None = None
        self.reopening = False

    @property
    def stats(self) -> LinkStats:
        return self._link.stats

    def send(self, batch: FrameBatch) -> None:
        self._link.send(batch)

    def receive(self) -> FrameBatch:
        batch = self._link.receive().copy()
        if self.state is not None:
            batch["data"][batch["id"] == 0x100, STATE_AT] = self.state
        return batch

    def renew_lease(self) -> None:
        self._link.renew_lease()

    def close(self) -> None:
        self._link.close()


class Bench:
    """A simulated machine and who talks to it."""

    def __init__(self, **truth: float) -> None:
        self.machine = SimulatedRig(RIG, draw(RIG, 2, truth), 1)
        self.link = Altered(self.machine.link)
        self.supervisor = Supervisor()
        self.base = WatchedClock(self.machine, self.link.renew_lease, self.supervisor.check)
        self.controller = Controller(RIG, self.link, self.base, Session(1, 1_767_225_600, "test"))


def test_a_state_that_nobody_knows_is_not_taken_for_safe() -> None:
    bench = Bench()
    bench.controller.connect()
    bench.controller.enable()
    bench.controller.levitate()
    bench.link.state = 99
    bench.controller.clock.sleep(0.9)  # a code that comes for less than a second ends nothing
    with pytest.raises(DeviceFault, match="its state is 99, which its DBC does not name"):
        bench.controller.clock.sleep(0.3)
    bench.controller.guarded = False
    assert bench.machine.device.state == "LEVITATED"
    found = bench.supervisor.make_safe(safety.making_safe(bench.controller, bench.base)[0], bench.machine.now_ns)
    assert bench.machine.device.state == "OFF"
    assert found == ()  # its replies told that it landed


def test_parameters_that_another_host_left_are_set_back_and_named() -> None:
    bench = Bench()
    bench.controller.connect()
    assert bench.controller.restored == ()
    bench.controller.set("kp_theta", 0.0)
    bench.controller.set("watchdog_s", 0.5)
    bench.controller.release()
    again = Controller(RIG, bench.link, bench.base, Session(2, 1_767_225_700, "next"))
    again.connect()
    assert again.restored == ("kp_theta 0", "watchdog_s 0.5")
    assert (again.get("kp_theta"), again.get("watchdog_s")) == (50.0, pytest.approx(0.08))


def test_a_fault_of_the_machine_is_looked_at_before_it_is_cleared() -> None:
    bench = Bench()
    bench.machine.device.states.state, bench.machine.device.states.fault = "FAULT", "LEVITATION_LOST"
    with pytest.raises(ConfigError, match=r"the fault LEVITATION_LOST of an earlier run: check sensor.*--clear-fault"):
        bench.controller.connect()
    assert bench.machine.device.state == "FAULT"
    bench.controller.connect(clear_fault=True)
    assert bench.controller.cleared == "LEVITATION_LOST"
    assert bench.machine.device.state == "OFF"
    bench.machine.device.states.state, bench.machine.device.states.fault = "FAULT", "HEARTBEAT_LOST"
    bench.controller.connect()
    assert bench.controller.cleared == "HEARTBEAT_LOST"


class Listening:
    """Stands for the recorder: frames go to `seen`."""

    def __init__(self, seen: list[FrameBatch]) -> None:
        self._seen = seen

    def frames(self, link: str, batch: FrameBatch, **_: int) -> None:
        self._seen.append(batch)

    def samples(self, block: object) -> None: ...


def test_frames_of_a_host_that_come_in_are_marked_as_such() -> None:
    bench = Bench()
    bench.controller.connect()
    heartbeat = frame(0x010, bytes(8))
    bench.machine.link._arrived.append(heartbeat)
    seen: list[FrameBatch] = []
    bench.controller._recorder = Listening(seen)  # type: ignore[assignment]
    bench.controller.guarded = False
    bench.controller.poll()
    assert [int(f["flags"]) & SENT for b in seen for f in b if f["id"] == 0x010] == [SENT]


def test_what_was_said_before_anything_recorded_is_recorded() -> None:
    """A controller's claim, identity and parameters are part of what came and went."""
    bench = Bench()
    bench.controller.connect()
    seen: list[FrameBatch] = []
    bench.controller.recorder = Listening(seen)  # type: ignore[assignment]
    (early,) = seen
    names = {m.identifier: name for name, m in RIG.messages.messages.items()}
    said = [(names[int(f["id"])], bool(f["flags"] & SENT)) for f in early]
    asked = sum(p.index is not None for p in RIG.parameters.values())
    assert said[:4] == [("Claim", True), ("Owner", False), ("Command", True), ("Identity", False)]
    assert (said.count(("ParamGet", True)), said.count(("ParamReply", False))) == (asked, asked)
    assert (early["t_ns"][1:] >= early["t_ns"][:-1]).all()
    bench.controller.recorder = Listening(seen)  # type: ignore[assignment]
    assert len(seen) == 1
