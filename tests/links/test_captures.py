"""Captures over live links: a served rig as a process of its own, and an interface of python-can in this one."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import numpy as np
import processes
import pytest

from bench.cli.opening import LIVE_SLICE_S, beat_of
from bench.clock import WallClock
from bench.link.session import new_session
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import RigFile, load_rig
from drivers.canframes import batch_of, messages_of
from drivers.controller import Controller
from drivers.live_link import LiveLink
from drivers.wires import open_wire
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

RIG = load_rig("amb5dof")
URL = "slcan:socket://127.0.0.1:28511"
CHANNELS = ("pos_yi", "pos_zi", "pos_yo", "pos_zo", "pulse_age")
SLICE_S = 5e-3


def captured(url: str, path: Path) -> Recording:
    """A recording with two captures over a live link, one of them cut by a trigger before which nothing else happens."""
    rig, wall, session = RigFile.parse(RIG.toml_text.replace(URL, url), RIG.dbc_text), WallClock(), new_session()
    link = LiveLink("controller", lambda: open_wire(rig.link, "controller", (), wall.now_ns), beat_of(rig, session))
    with contextlib.closing(link):
        controller = Controller(rig, link, wall, session, LIVE_SLICE_S)
        controller.connect()
        assert controller.capture is not None
        header = RunHeader({"run": {}}, {"rig.toml": rig.toml_text.encode(), "rig.dbc": rig.dbc_text.encode()})
        with Recorder(
            path, clock=controller.clock, streams=[controller.telemetry.layout], header=header, live=True
        ) as recorder:
            controller.recorder = recorder
            controller.clock.sleep(0.1)
            for seconds in (0.4, 0.1):
                controller.capture.arm(CHANNELS, seconds=seconds)
                controller.capture.wait(30.0)
                controller.capture.upload(seconds=seconds)
            controller.clock.sleep(0.1)
        controller.recorder = None
        controller.release()
    return Recording.open(path)


def judge(recording: Recording) -> None:
    first, second = recording.captures()
    assert (first.samples, second.samples, first.labels) == (4000, 1000, {"seconds": 0.4})
    told = recording.channel("pos_yi")
    x = first.arrays("pos_yi", "pulse_age")
    means = {int(t): x["pos_yi"][k - 10 : k].mean() for k, t in enumerate(x["t_ns"]) if k >= 10}
    common = [k for k, t in enumerate(told["t_ns"].tolist()) if t in means]
    assert len(common) > 300
    np.testing.assert_allclose(told["pos_yi"][common], [means[int(told["t_ns"][k])] for k in common], atol=1.2e-8)
    assert first.start_ns + 400_000_000 <= second.start_ns
    np.testing.assert_allclose(np.diff(x["pulse_age"]), 1e-4, rtol=0.01)  # it stands: the last pulse gets older


@pytest.mark.timeout(120)
def test_from_a_served_rig(tmp_path: Path) -> None:
    with processes.served(tmp_path, rig="amb5dof", patience_s=None) as rig:
        for kind in ("slcan:socket", "serial:pty"):
            judge(captured(rig.endpoints[kind], tmp_path / f"{kind.replace(':', '-')}.mcap"))


@contextmanager
def on_a_bus(channel: str) -> Iterator[None]:
    """A simulated controller on python-can's `virtual`, in a thread, in real time."""
    ended = threading.Event()
    device, period_ns = SimulatedController(RIG, draw(RIG, 2), substeps=1), round(SLICE_S * 1e9)

    def work() -> None:
        now = time.monotonic_ns()
        with can.Bus(channel, interface="virtual", ignore_config=True) as bus:
            while not ended.wait(max(now + period_ns - time.monotonic_ns(), 0) * 1e-9):
                heard = list(iter(lambda: bus.recv(0), None))
                for message in messages_of(device.advance(period_ns // 100_000, batch_of(heard, now), now), brs=True):
                    bus.send(message)
                now += period_ns

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.timeout(120)
def test_over_an_interface_of_python_can(tmp_path: Path) -> None:
    with on_a_bus("lev-capture"):
        judge(captured("can:virtual:lev-capture", tmp_path / "virtual.mcap"))
