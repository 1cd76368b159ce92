"""Captures where no frame is longer than 8 bytes: the plain stand of the examples on a bus without CAN FD, in process."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from bench.errors import Problem
from bench.link import fault_injection
from bench.link.frames import FD
from bench.link.session import Session
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import problems_of
from drivers.capture import ControllerCapture
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

STAND = load_rig("examples/plain-stand/stand.toml")


def classic(dbc: str = STAND.dbc_text) -> RigFile:
    text, count = re.subn(r"(?m)^data_bitrate = .*\n", "", STAND.toml_text)
    assert count == 1
    return RigFile.parse(text, dbc)


def connected(rig: RigFile) -> tuple[SimulatedRig, Controller, ControllerCapture]:
    machine = SimulatedRig(rig, draw(rig, 3), 1, [], substeps=1)
    controller = Controller(rig, machine.link, machine, Session(1, 1_767_225_600, "test"))
    controller.connect()
    assert controller.capture is not None
    return machine, controller, controller.capture


def test_it_arrives_in_frames_of_eight_bytes(tmp_path: Path) -> None:
    rig = classic()
    machine, controller, role = connected(rig)
    header = RunHeader({"run": {}}, {"rig.toml": rig.toml_text.encode(), "rig.dbc": rig.dbc_text.encode()})
    path = tmp_path / "recording.mcap"
    with Recorder(path, clock=controller.clock, streams=[controller.telemetry.layout], header=header) as recorder:
        controller.recorder = recorder
        role.arm(role.channels[:3], seconds=0.05)
        role.wait(1.0)
        data = role.upload()
        controller.clock.sleep(0.05)
    port = machine.device.captures
    assert port is not None
    layout = role._present()[0]
    assert layout.encoded([data.columns[name] for name in layout.channels]) == port.memory.buffer
    raw = np.concatenate(list(Recording.open(path).frames("regler")))
    assert int(raw["length"].max()) == 8
    assert not (raw["flags"] & FD).any()
    asked = rig.messages["CaptureArm"].identifier
    assert raw[raw["id"] == asked]["length"].tolist() == [8, 8, 8, 8, 6]
    assert controller.requests.wrong_length == 0


def test_a_message_that_no_classic_frame_holds_is_refused() -> None:
    longer = STAND.dbc_text.replace("BO_ 513 CaptureData: 64", "BO_ 513 StandLang: 64")
    assert longer != STAND.dbc_text
    found = list(problems_of(classic(re.sub("(?<= 513 )CaptureData|CaptureData(?=:)", "StandLang", longer))))
    assert [p for p in found if "classic CAN" in p.found] == [
        Problem("stand.dbc", "BO_ StandLang", "64 bytes on a bus of classic CAN",
                "at most 8, or data_bitrate in [links.regler] where the bus has CAN FD")
    ]  # fmt: skip


def test_the_file_as_it_is_has_no_problem() -> None:
    assert [p for p in problems_of(classic()) if "bytes" in p.found] == []


@pytest.mark.parametrize("fault", ["drop=0.02", "duplicate=0.02"])
def test_what_is_lost_or_doubled_is_asked_for_again(fault: str) -> None:
    rig = classic()
    machine = SimulatedRig(rig, draw(rig, 3), 1, [fault_injection.parse(fault)], substeps=1)
    controller = Controller(rig, machine.link, machine, Session(1, 1_767_225_600, "test"))
    controller.connect()
    role = controller.capture
    assert role is not None
    role.arm(role.channels[:2], seconds=0.02)
    role.wait(2.0)
    data = role.upload()
    port = machine.device.captures
    assert port is not None
    layout = role._present()[0]
    assert layout.encoded([data.columns[name] for name in layout.channels]) == port.memory.buffer
