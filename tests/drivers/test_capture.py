"""Captures through the driver on the virtual link: arming, triggers, refusals, upload, and what lands in the recording."""

from __future__ import annotations

import csv
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from capture_stand import POSITIONS, RIG, Stand

from bench.errors import AnalysisError, BenchError, NoReply
from bench.link.frames import FrameBatch
from bench.recording import Recording
from bench.rigfile import capture
from bench.rigfile.capture import CaptureData
from bench.run.export import export

CHANNELS = ("pos_yi", "i_yi_p", "u_yi_p", "speed", "pulses", "pulse_age")
LEVEL = 8e-6


@dataclass
class Session:
    recording: Recording
    run: Path
    data: list[CaptureData]
    progress: list[tuple[int, int]]
    lost: int
    host_age_s: float
    modes: list[str]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """One capture at rest, one of a step while levitated with its trigger, one at half the rate; with the recorder's thread."""
    run = tmp_path_factory.mktemp("amb5dof")
    stand, progress = Stand(), list[tuple[int, int]]()
    controller, role = stand.controller, stand.capture
    with stand.recorder(run / "recording.mcap"):
        controller.clock.sleep(0.2)
        modes = [controller.mode]
        role.arm(POSITIONS, seconds=0.3)
        role.wait(1.0)
        data = [role.upload(lambda done, of: progress.append((done, of)), state="off", number=1)]
        controller.enable()
        controller.levitate()
        modes.append(controller.mode)
        role.arm(CHANNELS, seconds=0.2, before_s=0.05, trigger=capture.rises("pos_yi", LEVEL))
        controller.clock.sleep(0.1)
        controller.set("ref_y", 20e-6)
        role.wait(2.0)
        data.append(role.upload(state="levitated", number=2))
        role.arm(("pos_zo", "inject"), seconds=0.1, rate_hz=5000)
        role.wait(1.0)
        data.append(role.upload(state="levitated", number=3))
        controller.clock.sleep(0.1)
    counters = controller.telemetry.counters
    (run / "record.json").write_text("{}")
    return Session(
        Recording.open(run / "recording.mcap"), run, data, progress, counters.lost, controller.watch.host_age_s, modes
    )


def test_captures_lie_beside_the_telemetry(session: Session) -> None:
    recording = session.recording
    assert session.modes == ["OFF", "LEVITATED"]
    assert list(recording.streams) == ["telemetry"]
    assert list(recording.capture_streams) == ["capture/1", "capture/2", "capture/3"]
    first, step, slow = recording.captures()
    assert (first.samples, step.samples, slow.samples) == (3000, 2000, 500)
    assert (first.rate_hz, slow.rate_hz) == (10000.0, 5000.0)
    assert recording.captures(number=2) == (step,)
    assert recording.captures(state="levitated") == (step, slow)
    assert recording.captures(state="none") == ()
    assert recording.integrity is not None
    assert recording.integrity["samples"]["capture/2"] == 2000
    assert recording.rig.name == "amb5dof"


def test_the_upload_disturbs_nothing(session: Session) -> None:
    assert session.lost == 0
    assert session.host_age_s < 0.03
    telemetry = session.recording.channel("fault")
    assert (telemetry["fault"] == 0).all()
    assert (np.diff(telemetry["index"]) == 1).all()


def test_time_is_the_telemetrys(session: Session) -> None:
    """A sample of telemetry is the mean of the ten readings before its tick, on the same time axis."""
    recording = session.recording
    for captured in recording.captures()[:2]:
        x, told = captured.arrays("pos_yi"), recording.channel("pos_yi")
        np.testing.assert_allclose(x["t_s"], (x["t_ns"] - recording.start_ns) * 1e-9)
        assert (np.diff(x["t_ns"]) == 100_000).all()
        assert (x["t_ns"][0], x["tick"][0]) == (captured.start_ns, captured.first_tick)
        means = {int(t): x["pos_yi"][k - 10 : k].mean() for k, t in enumerate(x["t_ns"]) if k >= 10}
        common = [k for k, t in enumerate(told["t_ns"].tolist()) if t in means]
        assert len(common) >= 190
        assert told["pos_yi"][common] == pytest.approx([means[int(told["t_ns"][k])] for k in common], abs=1.2e-8)


def test_the_trigger_and_what_came_before_it(session: Session) -> None:
    step = session.recording.captures(number=2)[0]
    x = step.arrays()
    assert step.channels == CHANNELS
    assert step.trigger == 500
    assert step.waited_for == {"kind": "RISES", "channel": "pos_yi", "level": LEVEL}
    assert x["pos_yi"][499] < LEVEL <= x["pos_yi"][500]
    assert step.trigger_ns == x["t_ns"][500]
    assert x["pos_yi"][:300].max() < LEVEL
    assert x["pos_yi"][-500:].mean() == pytest.approx(25e-6, abs=13e-6)  # on its way to 20 um
    assert x["i_yi_p"].mean() > 0.3
    assert x["u_yi_p"].std() > 0


def test_what_upload_returns_is_what_is_recorded(session: Session) -> None:
    for data, captured in zip(session.data, session.recording.captures(), strict=True):
        x = captured.arrays()
        assert (data.stream, data.trigger, data.first_tick) == (captured.stream, captured.trigger, captured.first_tick)
        for name, values in data.columns.items():
            np.testing.assert_allclose(x[name], values, rtol=1e-6, err_msg=name)


def test_progress(session: Session) -> None:
    assert session.progress == [(24000, 24000)]


def test_as_a_table(session: Session) -> None:
    table = session.recording.captures(number=3)[0].frame("inject")
    assert list(table.columns) == ["tick", "inject"]
    assert table.index.name == "t_s"
    assert len(table) == 500
    with pytest.raises(AnalysisError, match=r"capture/3: found no pos_yi; it holds pos_zo, inject"):
        session.recording.captures(number=3)[0].arrays("pos_yi")


def test_exports(session: Session, tmp_path: Path) -> None:
    paths = export(session.run, "csv", tmp_path)
    captures = {"capture-1.csv", "capture-2.csv", "capture-3.csv"}
    assert {p.name for p in paths} == {"telemetry.csv", *captures, "steps.csv", "events.csv", "columns.csv"}
    with (tmp_path / "capture-3.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["t_s", "t_ns", "index", "tick", "pos_zo", "inject", "step", "step_kind"]
    assert len(rows) == 501
    assert int(rows[2][3]) - int(rows[1][3]) == 2
    assert export(session.run, "mcap", tmp_path)[0].stat().st_size > 100_000


@pytest.fixture(scope="module")
def stand() -> Stand:
    return Stand()


def test_more_than_the_memory_is_refused_with_both_numbers(stand: Stand) -> None:
    with pytest.raises(
        BenchError, match=r"200000 samples of 4 channels take 1600000 bytes; .* memory holds 1048576, which is 131072"
    ):
        stand.capture.arm(POSITIONS, seconds=20)
    assert stand.machine.device.captures.memory.number == 0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("channels", "more", "match"),
    [
        (("pos_q",), {}, "cannot record pos_q; it can record pos_yi"),
        ((), {}, "no channel is chosen"),
        (POSITIONS, {"rate_hz": 3000.0}, "found a rate of 3000 Hz; expected 10000 Hz divided by"),
        (POSITIONS, {"rate_hz": 20000.0}, "found a rate of 20000 Hz"),
        (POSITIONS, {"rate_hz": 0.0}, "found a rate of 0 Hz"),
        (POSITIONS, {"seconds": 0.0}, "found 0 samples, 0 of them before"),
        (POSITIONS, {"before_s": 0.1}, "found 1000 samples, 1000 of them before"),
        (POSITIONS, {"trigger": capture.rises("pos_q", 0.0)}, "cannot record pos_q"),
        (POSITIONS, {"trigger": capture.at_speed(float("inf"))}, "a trigger level of inf"),
    ],
)  # fmt: skip
def test_what_cannot_be_armed(stand: Stand, channels: tuple[str, ...], more: dict, match: str) -> None:
    with pytest.raises(BenchError, match=match):
        stand.capture.arm(channels, **{"seconds": 0.1, **more})


def test_one_at_a_time(stand: Stand) -> None:
    role = stand.capture
    for call in (lambda: role.wait(0.1), role.upload):
        with pytest.raises(BenchError, match="nothing is armed"):
            call()
    role.arm(POSITIONS, seconds=0.1, before_s=0.02, trigger=capture.at_speed(100.0))
    with pytest.raises(BenchError, match="one is ARMED already, and the controller records one at a time"):
        role.arm(POSITIONS, seconds=0.1)
    with pytest.raises(BenchError, match="it is ARMED: nothing to upload yet"):
        role.upload()
    with pytest.raises(BenchError, match=r"not recorded within 0.2 s: it is ARMED for SPEED 100, 200 samples so far"):
        role.wait(0.2)
    role.cancel()
    role.arm(POSITIONS, seconds=0.1)
    role.wait(1.0)
    assert len(role.upload().columns["pos_yi"]) == 1000  # nobody records: it is returned all the same
    role.arm(POSITIONS, seconds=0.1)  # what was recorded is given up
    stand.machine.device.captures.memory.cancel()  # type: ignore[union-attr]
    with pytest.raises(BenchError, match=r"does not have it any more \(OK, IDLE\)"):
        role.wait(1.0)


def test_what_a_bench_that_is_gone_left_armed_is_given_up() -> None:
    stand = Stand()
    stand.capture.arm(POSITIONS, seconds=0.1, trigger=capture.at_speed(100.0))
    stand.capture._armed = None  # another driver, which knows nothing of it
    stand.capture.arm(POSITIONS, seconds=0.1)
    stand.capture.wait(1.0)


@pytest.mark.parametrize("lost", [2, 3])
def test_an_answer_that_is_lost_is_asked_for_again(lost: int) -> None:
    stand, seen = Stand(), 0
    stand.capture.arm(POSITIONS, seconds=0.1)
    receive = stand.machine.link.receive

    def without() -> FrameBatch:
        nonlocal seen
        batch = receive()
        mine = batch["id"] == RIG.messages["CaptureStatus"].identifier
        seen += int(mine.sum())
        return batch[~mine] if seen <= lost else batch

    stand.machine.link.receive = without  # type: ignore[method-assign]
    with (
        nullcontext()
        if lost < 3
        else pytest.raises(NoReply, match=r"waited 0\.5 s for the state of the capture.* asked for 3 times")
    ):
        stand.capture.wait(5.0)


def test_what_it_says_of_itself(stand: Stand) -> None:
    assert stand.capture.rate_hz == 10000.0
    assert stand.capture.memory_bytes == 1 << 20
    assert stand.capture.channels == tuple(RIG.capture.channels)  # type: ignore[union-attr]


def test_a_rig_without_captures_has_no_such_role() -> None:
    from bench.link.session import Session as HostSession
    from bench.rigfile import load_rig
    from drivers.controller import Controller
    from sim_backend.endpoint import SimulatedRig
    from sim_backend.truth import draw

    rig = load_rig("examples/vertical-spindle/spindle.toml")
    machine = SimulatedRig(rig, draw(rig, 1), 1)
    assert Controller(rig, machine.link, machine, HostSession(1, 0, "test")).capture is None
