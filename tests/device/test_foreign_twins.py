"""The foreign rigs of examples/ as twins behind their own DBC: levitated by the driver, their frames read by cantools."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest

from bench import units
from bench.link.frames import FrameBatch, payload
from bench.link.session import Session
from bench.rigfile import load_rig
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("name", ["vertical-spindle/spindle.toml", "plain-stand/stand.toml"])
def test_a_foreign_rig_is_levitated_and_its_frames_say_what_its_plant_does(name: str) -> None:
    rig = load_rig(str(EXAMPLES / name))
    machine = SimulatedRig(rig, draw(rig, 1), 1)
    frames: list[FrameBatch] = []
    real = machine.link.receive
    machine.link.receive = lambda: frames.append(real()) or frames[-1]  # type: ignore[method-assign,func-returns-value]
    controller = Controller(rig, machine.link, machine, Session(1, 1_767_225_600, "test"), 0.05)
    controller.connect()
    controller.enable()
    controller.levitate()
    plant: Any = machine.device.plant
    rows: list[np.ndarray] = []
    run = plant.run
    plant.run = lambda ticks: rows.append(run(ticks)) or rows[-1]
    frames.clear()
    controller.clock.sleep(0.2)
    said = _read(rig.dbc_text, np.concatenate(frames))
    truth = dict(zip(plant.channels, np.concatenate(rows).T, strict=True))
    shown = [p.channel for p in rig.probes.values()] + [
        c for b in rig.bearings.values() for a in b.axes.values() for c in a.coils
    ]
    for channel in shown:
        s = rig.messages[rig.channels[channel].signal.partition(".")[0]].signal(
            rig.channels[channel].signal.partition(".")[2]
        )
        unit = units.UNITS[s.unit]
        told = np.array(said[rig.channels[channel].signal]) * unit.factor + unit.offset
        off = [np.abs(told[2 : 2 + 300] - truth[channel][k : k + 300][: len(told[2 : 2 + 300])]).max() for k in range(4)
               if len(truth[channel]) - k >= len(told[2 : 2 + 300])]  # fmt: skip
        assert min(off) <= 0.5001 * abs(s.scale) * unit.factor, channel
    controller.land()
    controller.disable()
    assert {v for k, v in vars(controller.telemetry.counters).items() if k != "unknown"} == {0}


@pytest.mark.parametrize(
    ("name", "message", "values"),
    [
        ("plain-stand/stand.toml", "VorgabeLage", {"SollYVorn": 2e-5, "SollYHinten": 2e-5}),
        ("vertical-spindle/spindle.toml", "SpindleTarget", {}),
    ],
)
def test_what_one_message_carries_is_written_at_once(name: str, message: str, values: dict[str, float]) -> None:
    """One frame with both values; the plant is told both before its next tick."""
    rig = load_rig(str(EXAMPLES / name))
    values = values or {p: 1e-5 for a, p in rig.capabilities.set_points.axes.items() if a in ("LowU", "UppU")}
    machine = SimulatedRig(rig, draw(rig, 1), 1)
    controller = Controller(rig, machine.link, machine, Session(1, 1_767_225_600, "test"), 0.05)
    controller.connect()
    controller.enable()
    controller.levitate()
    sent: list[FrameBatch] = []
    real, held = machine.link.send, machine.device.plant.set
    machine.link.send = lambda batch: (sent.append(batch), real(batch))[1]  # type: ignore[method-assign]
    told: dict[int, int] = {}
    machine.device.plant.set = lambda control, value: (  # type: ignore[method-assign]
        told.update({machine.now_ns(): told.get(machine.now_ns(), 0) + 1}), held(control, value))[1]  # fmt: skip
    controller.write(values)
    controller.clock.sleep(0.02)
    frames = [one for batch in sent for one in batch if int(one["id"]) == rig.messages[message].identifier]
    assert len(frames) == 1
    assert list(told.values()) == [len(values)]
    said = _read(rig.dbc_text, np.array(frames))
    for parameter, value in values.items():
        path = rig.parameters[parameter].signal
        unit = units.UNITS[rig.messages[message].signal(path.partition(".")[2]).unit]
        assert said[path][0] * unit.factor == pytest.approx(value, abs=1e-8)


def _read(dbc: str, batch: FrameBatch) -> dict[str, list[float]]:
    """Values by "Message.signal", as cantools reads them, in order."""
    database: Any = cantools.database.load_string(dbc, database_format="dbc")
    out: dict[str, list[float]] = {}
    for one in batch:
        message = database.get_message_by_frame_id(int(one["id"]) & ~(1 << 31))
        for signal, value in message.decode(payload(one), decode_choices=False).items():
            out.setdefault(f"{message.name}.{signal}", []).append(float(value))
    return out
