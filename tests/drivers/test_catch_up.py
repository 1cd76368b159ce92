"""A controller whose clock falls behind the host's, as a simulated one does on a busy computer: steps stay clean."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from host_clock import RIG, HostClock

from bench.errors import DeviceFault, LinkError
from bench.link.frames import FrameBatch
from bench.link.session import Session
from bench.progress import Silent
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.run.machine_phase import WatchedSteps
from drivers.controller import Controller


class Host(HostClock):
    """The machine's time is `behind_ns` behind the host's."""

    def __init__(self) -> None:
        super().__init__()
        self.behind_ns = 0

    def sleep(self, seconds: float) -> None:
        self._now += round(seconds * 1e9)
        self.machine.sleep(max(0, self._now - self.behind_ns - self.machine.now_ns()) * 1e-9)

    def stand_still(self, seconds: float) -> None:
        """The whole computer: bench and machine."""
        self._now += round(seconds * 1e9)
        self.behind_ns += round(seconds * 1e9)

    def receive(self) -> FrameBatch:
        batch = self.machine.link.receive().copy()
        batch["t_ns"] = self._now
        return batch


@contextmanager
def levitated(path: Path) -> Iterator[tuple[Host, Controller, WatchedSteps]]:
    """A controller that holds the shaft, recorded; its heartbeats end where `renew_lease` of the host does nothing."""
    host = Host()
    controller = Controller(RIG, host, host, Session(1, 1_767_225_600, "test"))
    header = RunHeader({"run": {}}, {"rig.toml": RIG.toml_text.encode(), "rig.dbc": RIG.dbc_text.encode()})
    controller.connect()
    with Recorder(path, clock=controller.clock, streams=[controller.telemetry.layout], header=header) as recorder:
        controller.recorder = recorder
        controller.enable()
        controller.levitate()
        yield host, controller, WatchedSteps(recorder, Silent(), controller.catch_up)


def recorded(path: Path, behind_s: float, wait: bool = True) -> tuple[float, int, Controller]:
    """Fall behind, record a step, and command a motor current after it: by how much that current is greater in the last 50 ms
    of the step than before, A, how many samples the step has, and the driver."""
    with levitated(path) as (host, controller, steps):
        controller.set("i_ramp", 5.0)
        host.stand_still(behind_s)
        controller.clock.sleep(2.0)
        if not wait:
            assert isinstance(controller.recorder, Recorder)
            steps = WatchedSteps(controller.recorder, Silent(), lambda: None)
        with steps.step("dwell"):
            controller.clock.sleep(0.2)
        controller.set("i_y", 1.0)
        controller.clock.sleep(0.5)
    step = next(iter(Recording.open(path).steps("dwell")))
    data = step.read("i_m1")["i_m1"]
    return float(data[-50:].mean() - data[:-100].mean()), len(data), controller


def test_without_waiting_what_is_commanded_after_a_step_acts_within_it(tmp_path: Path) -> None:
    assert recorded(tmp_path / "without.mcap", 0.08, wait=False)[0] > 0.1


@pytest.mark.parametrize("behind_s", [0.08, 3.0])
def test_what_is_commanded_after_a_step_does_not_act_within_it(tmp_path: Path, behind_s: float) -> None:
    change, samples, controller = recorded(tmp_path / "with.mcap", behind_s)
    assert samples == 200
    assert abs(change) < 0.05
    assert controller.cut_ns <= 0


def test_a_controller_that_is_too_far_behind_is_not_waited_for_and_the_run_says_so() -> None:
    host = Host()
    controller = Controller(RIG, host, host, Session(1, 1_767_225_600, "test"))
    controller.connect()
    controller.guarded = False
    controller.clock.sleep(1.0)
    host.behind_ns = 20_000_000_000
    controller.clock.sleep(0.1)
    controller.catch_up()
    assert controller.cut_ns > 0


def handled(host: Host, controller: Controller, steps: WatchedSteps) -> None:
    """A step in which heartbeats are lost, which is handled; telemetry lacks its end."""
    host.renew_lease = lambda: None
    with steps.step("lift"):
        with pytest.raises(DeviceFault, match="HEARTBEAT_LOST"):
            controller.clock.sleep(3.0)
        host.stand_still(0.08)


def left_behind(host: Host, controller: Controller, steps: WatchedSteps, within_s: float, behind_s: float) -> None:
    """A step at whose end telemetry is behind."""
    with steps.step("dwell"):
        controller.clock.sleep(within_s)
        host.stand_still(behind_s)


def test_a_fault_that_was_handled_in_a_step_is_not_raised_by_leaving_it(tmp_path: Path) -> None:
    """But by the next poll."""
    with levitated(tmp_path / "handled.mcap") as (host, controller, steps):
        handled(host, controller, steps)
        with pytest.raises(DeviceFault, match="HEARTBEAT_LOST"):
            controller.clock.sleep(0.1)


def test_a_fault_that_comes_within_a_step_or_while_it_is_caught_up_ends_the_run(tmp_path: Path) -> None:
    for name, within_s, behind_s in (("within", 3.0, 0.0), ("after", 0.1, 3.0)):
        with levitated(tmp_path / f"{name}.mcap") as (host, controller, steps):
            host.renew_lease = lambda: None
            with pytest.raises(DeviceFault, match="HEARTBEAT_LOST"):
                left_behind(host, controller, steps, within_s, behind_s)


def test_another_fault_than_the_one_that_was_handled_ends_the_run(tmp_path: Path) -> None:
    """Also of the same name, once the first was cleared."""
    with levitated(tmp_path / "again.mcap") as (host, controller, steps):
        handled(host, controller, steps)
        host.renew_lease = host.machine.link.renew_lease
        controller.guarded = False
        controller.clock.sleep(5.0)  # it lands
        controller.reach("CLEAR_FAULT", "OFF", 1.0)
        controller.guarded = True
        controller.enable()
        controller.levitate()
        host.renew_lease = lambda: None
        with pytest.raises(DeviceFault, match="HEARTBEAT_LOST"):
            left_behind(host, controller, steps, 0.1, 3.0)
    with levitated(tmp_path / "other.mcap") as (host, controller, steps):
        handled(host, controller, steps)
        controller.telemetry.latest["fault"] = 1
        assert controller.fault not in ("NONE", "HEARTBEAT_LOST")
        with pytest.raises(DeviceFault), steps.step("dwell"):
            host.stand_still(0.08)


def test_a_bench_that_stood_still_does_not_take_the_controller_for_dead() -> None:
    """Nor where that was in the middle of a look at it, before or after the link was read."""
    host = Host()
    controller = Controller(RIG, host, host, Session(1, 1_767_225_600, "test"))
    controller.connect()
    receive = host.receive
    host.renew_lease = lambda: host.stand_still(0.6)
    for _ in range(3):
        host.stand_still(4)
        controller.clock.sleep(0.3)
    assert controller.mode == "OFF"
    host.renew_lease = lambda: None
    host.receive = lambda: receive()[:0]  # type: ignore[method-assign]
    with pytest.raises(LinkError, match=r"no telemetry for 0\.[56]"):
        controller.clock.sleep(2.0)
