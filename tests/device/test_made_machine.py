"""A machine that is made of the rig file, with a tick of its own, behind the rig's own DBC: a plant of the test's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bound_rigs import OWN, plain_text

from bench.link.session import Session
from bench.rigfile import RigFile
from drivers.controller import Controller
from sim_backend.core import DriveLaw
from sim_backend.endpoint import SimulatedRig
from sim_backend.machine import Truth
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.unspoken import unspoken

TICK_S, PERIOD = 2e-4, 5
MACHINE = """
[bearings.outboard]
kind = "radial"
at = "geometry/com_to_outboard_amb"
axes.yo = { direction = { value = 0, unit = "deg", u = 1, distribution = "normal", source = "-" }, coils = ["i_yo_p"] }

[rings.outboard]
clearance = "geometry/clearance"

[capabilities]
bias = { outboard = "bias_o" }

[capabilities.status]
contact = { outboard = { channel = "flags", mask = 32 } }
current_limit = { channel = "flags", mask = 2 }
"""


def made_rig() -> RigFile:
    """plainamb, in schema 2, with a tick of 200 us and the status bits where it says."""
    text = plain_text().replace("tick_s = 1e-4", f"tick_s = {TICK_S}").replace("schema = 1", "schema = 2")
    kept = text[: text.index("[machine]\n")] + text[text.index("[masses]\n") :]
    return RigFile.parse(kept.replace("[masses]\n", f"{MACHINE}\n[masses]\n", 1), DBC, "made.toml")


DBC = (OWN / "plainamb.dbc").read_text(encoding="utf-8")
COLUMNS = ("pos_yo", "pos_xi", "i_yo_p", "angle", "speed", "status.contact.outboard", "status.current_limit")


class Plant:
    """It stands in its place; its position counts samples, its status bits take turns."""

    tick_s, period_ticks = TICK_S, PERIOD
    moved, speed, shaft_speed, drive_torque, trips = True, 0.0, 0.0, 0.0, 0
    pulse_age_s = turn_s = None

    def __init__(self) -> None:
        self.mode, self.tick = 0, 0
        self.controls: dict[str, float] = {}

    def clear_trips(self) -> None: ...

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None: ...

    def set(self, name: str, value: float) -> None:
        if name not in ("bias.outboard", "lift_time_s", "speed_ref", "torque_on"):
            raise KeyError(name)
        self.controls[name] = value

    def run(self, ticks: int) -> np.ndarray:
        first, self.tick = self.tick // PERIOD, self.tick + ticks
        n = np.arange(first + 1, self.tick // PERIOD + 1)
        rows = np.zeros((len(n), len(COLUMNS)))
        rows[:, 0], rows[:, 5], rows[:, 6] = 25e-9 * (n % 100), n % 2, n % 3 == 0
        return rows


def made(rig: RigFile) -> Truth:
    machine = replace(
        TSBS, name="made", columns=lambda _: COLUMNS, make=lambda *_: Plant(), spoil=lambda *_: None, windings={},
        radial=slice(0, 1), turns=False, operator=lambda *_: None,
    )  # fmt: skip
    return Truth(1, {}, machine.defects, None, {}, machine)


def test_its_own_tick_its_columns_its_controls_and_its_status_bits() -> None:
    rig = made_rig()
    truth = made(rig)
    stand = SimulatedRig(rig, truth, 1)
    controller = Controller(rig, stand.link, stand, Session(1, 1_767_225_600, "test"))
    controller.connect()
    controller.enable()
    controller.set("bias_o", 2.5)
    blocks = []
    decode = controller.telemetry.decode
    controller.telemetry.decode = lambda batch: blocks.append(decode(batch)) or blocks[-1]  # type: ignore[method-assign,func-returns-value]
    controller.levitate()
    found = [b for several in blocks for b in several]
    assert controller.mode == "LEVITATED"
    assert stand.device.plant.controls["bias.outboard"] == 2.5  # type: ignore[attr-defined]
    ticks = np.concatenate([b.ticks for b in found]).astype(int)
    assert set(np.diff(ticks)) == {PERIOD}
    assert set(np.diff(np.concatenate([b.t_ns for b in found]))) == {1_000_000}
    n = ticks // PERIOD
    assert np.concatenate([b.columns["pos_yo"] for b in found]) == pytest.approx(25e-9 * (n % 100), abs=1e-12)
    assert (np.concatenate([b.columns["flags"] for b in found]) == 32 * (n % 2) + 2 * (n % 3 == 0)).all()
    assert {v for k, v in vars(controller.telemetry.counters).items() if k != "unknown"} == {0}
    assert float(found[0].columns["temp_o"][0]) == pytest.approx(295.0, abs=0.1)


def test_what_it_does_not_tell_is_named_and_its_tick_is_its_own() -> None:
    rig = made_rig()
    keys = [p.key for p in unspoken(rig, made(rig).machine)]
    assert "channels.pos_xo" in keys
    assert "channels.temp_o" not in keys
    assert not [k for k in keys if "tick" in k]
