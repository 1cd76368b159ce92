"""A controller whose clock falls behind the host's, as a simulated one does on a busy computer: steps stay clean."""

from __future__ import annotations

from pathlib import Path

from bench.acquisition import WatchedSteps
from bench.frames import FrameBatch
from bench.progress import Silent
from bench.recorder import Recorder, RunHeader
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.session import Session
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("tsbs12")
BEHIND_S = 0.08


class Host:
    """The host's clock and link. From `starve` on the machine's time is 80 ms behind the host's."""

    def __init__(self) -> None:
        self.machine = SimulatedRig(RIG, draw(RIG, 2), 1)
        self._now = self._least = self.machine.now_ns()
        self.behind_ns = 0
        self.name, self.stats, self.reopening = self.machine.link.name, self.machine.link.stats, False
        self.send, self.close = self.machine.link.send, self.machine.link.close
        self.renew_lease = self.machine.link.renew_lease

    def now_ns(self) -> int:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += round(seconds * 1e9)
        self.machine.sleep(max(0, self._now - self.behind_ns - self.machine.now_ns()) * 1e-9)

    def receive(self) -> FrameBatch:
        batch = self.machine.link.receive().copy()
        batch["t_ns"] = self._now
        return batch


def recorded(path: Path, wait: bool) -> tuple[float, int]:
    """Fall behind, record a step, and command a motor current after it: by how much that current is greater in the last 50 ms
    of the step than before, A, and how many samples the step has."""
    host = Host()
    controller = Controller(RIG, host, host, Session(1, 1_767_225_600, "test"))
    header = RunHeader({"run": {}}, {"rig.toml": RIG.toml_text.encode(), "rig.dbc": RIG.dbc_text.encode()})
    controller.connect()
    with Recorder(path, clock=controller.clock, streams=[controller.telemetry.layout], header=header) as recorder:
        controller.recorder = recorder
        controller.enable()
        controller.levitate()
        controller.set("i_ramp", 5.0)
        host.behind_ns = round(BEHIND_S * 1e9)
        controller.clock.sleep(2.0)
        steps = WatchedSteps(recorder, Silent(), controller.catch_up if wait else lambda: None)
        with steps.step("dwell"):
            controller.clock.sleep(0.2)
        controller.set("i_y", 1.0)
        controller.clock.sleep(0.5)
    step = next(iter(Recording.open(path).steps("dwell")))
    data = step.read("i_m1")["i_m1"]
    return float(data[-50:].mean() - data[:-100].mean()), len(data)


def test_what_is_commanded_after_a_step_does_not_act_within_it(tmp_path: Path) -> None:
    assert recorded(tmp_path / "without.mcap", wait=False)[0] > 0.1
    change, samples = recorded(tmp_path / "with.mcap", wait=True)
    assert samples == 200
    assert abs(change) < 0.05
