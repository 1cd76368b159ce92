"""The simulated AMB stand with its messages, codes and states under other names: the protocol's answers, captures and restarts
work by the binding, and in one process with the driver."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bench.errors import DeviceFault
from bench.link import fault_injection
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import problems_of
from drivers.controller import Controller
from sim_backend.controller.meanings import fault_codes, state_codes
from sim_backend.controller.telemetry import TelemetryEncoder
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIGS = Path(__file__).resolve().parents[2] / "rigs"
BINDING = """
[devices.controller.binding]
telemetry = ["Werte"]
sequence = "nummer"
heartbeat = "Puls"
commands = { ENABLE = { "Command.code" = "EIN" } }
states = { HEBT = "LIFTING", SCHWEBT = "LEVITATED" }
no_fault = ["KEINE"]
"""
WORDS = (
    (r"\bTelemetry\b", "Werte"), (r"\bHeartbeat\b", "Puls"), (r'"ENABLE"', '"EIN"'), (r'"LIFTING"', '"HEBT"'),
    (r'"LEVITATED"', '"SCHWEBT"'), (r'"NONE"', '"KEINE"'), (r"\bseq\b", "nummer"),
)  # fmt: skip


def renamed() -> RigFile:
    toml, dbc = ((RIGS / f"amb5dof.{kind}").read_text(encoding="utf-8") for kind in ("toml", "dbc"))
    for old, new in WORDS:
        dbc = re.sub(old, new, dbc)
    toml = re.sub(r"\bTelemetry\.", "Werte.", toml)
    return RigFile.parse(toml.replace("\n[devices.operator]", f"{BINDING}\n[devices.operator]", 1), dbc, "amb5dof.toml")


RENAMED = renamed()


class Stand:
    def __init__(self, rig: RigFile, *injected: str) -> None:
        found = [fault_injection.parse(text) for text in injected]
        self.machine = SimulatedRig(rig, draw(rig, 3), 1, found, substeps=1)
        self.controller = Controller(rig, self.machine.link, self.machine, Session(1, 1_767_225_600, "test"))
        self.controller.connect()


def test_the_renamed_rig_is_sound_and_not_the_machines_own() -> None:
    assert problems_of(RENAMED) == []
    assert not isinstance(Stand(RENAMED).machine.device._encoder, TelemetryEncoder)
    assert isinstance(Stand(load_rig("amb5dof")).machine.device._encoder, TelemetryEncoder)


def test_commands_parameters_and_captures_are_those_of_the_machines_own_map() -> None:
    buffers, samples = [], []
    for rig in (load_rig("amb5dof"), RENAMED):
        stand = Stand(rig)
        c = stand.controller
        assert c.identity["serial"] == 0
        c.enable()
        c.set("bias", 0.6)
        assert c.get("bias") == pytest.approx(0.6)
        c.levitate()
        assert c.capture is not None
        c.capture.arm(("pos_yi", "pos_zi"), seconds=0.05)
        c.capture.wait(1.0)
        port = stand.machine.device.captures
        assert port is not None
        buffers.append(port.memory.buffer)
        data = c.capture.upload()
        assert len(data.columns["pos_yi"]) > 400
        samples.append(dict(c.telemetry.latest))
        c.land()
        c.disable()
    assert buffers[0] == buffers[1]
    assert samples[0] == samples[1]


def test_a_restart_counts_from_the_start_and_is_seen() -> None:
    stand = Stand(RENAMED, "reboot@1.5+0.3")
    stand.controller.enable()
    with pytest.raises(DeviceFault, match="restarted"):
        stand.controller.clock.sleep(3.0)
    assert stand.controller.telemetry.counters.reboots == 1


def test_modes_without_a_name_of_their_own_are_told_as_the_nearest() -> None:
    choices = {3: "Off", 1: "Rest", 5: "Hung", 7: "Hung2", 9: "Dead"}
    binding = RENAMED.binding.model_copy(
        update={"states": {"Off": "OFF", "Rest": "READY", "Hung": "LEVITATED", "Hung2": "LEVITATED", "Dead": "FAULT"}}
    )
    assert state_codes(binding, choices) == {
        "OFF": 3, "READY": 1, "LEVITATED": 5, "FAULT": 9, "LIFTING": 1, "LANDING": 5, "SPINNING": 5, "COASTING": 5,
    }  # fmt: skip


def test_faults_have_the_code_of_their_name_or_the_first_that_means_one() -> None:
    codes = fault_codes(RENAMED, {0: "KEINE", 2: "Overspeed", 4: "over_current", 6: "Anything"})
    assert (codes["NONE"], codes["OVERSPEED"], codes["OVERCURRENT"], codes["SENSOR"]) == (0, 2, 4, 2)
    assert fault_codes(RENAMED, {})["SENSOR"] == 1
