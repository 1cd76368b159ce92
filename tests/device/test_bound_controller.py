"""The simulated controller behind a DBC that is not its own: what it says is read by cantools, what it hears is asked for as
the rig file binds it."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from bound_rigs import OWN, plain_text, written

from bench import units
from bench.errors import ConfigError
from bench.link.codec import encode
from bench.link.frames import FD, SENT, FrameBatch, empty_batch, frame, joined, payload
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile, load_rig
from bench.rigfile.busload import frame_seconds
from sim_backend.controller.asked import Recogniser
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

DBC = (OWN / "plainamb.dbc").read_text(encoding="utf-8")
PLAIN = RigFile.parse(plain_text(), DBC, "plainamb.toml")
MS = 1_000_000
DEMAND = {"Arm": 1, "Float": 2, "Descend": 3, "Rotate": 4, "Brake": 5, "Safe": 6, "Reset": 7, "Standby": 0}


def changed(text: str, *swaps: tuple[str, str]) -> str:
    for old, new in swaps:
        assert old in text, old
        text = text.replace(old, new)
    return text


class Host:
    """The other end of the wire: beats every 20 ms unless told not to; a message that is sent stays as it is."""

    def __init__(self, rig: RigFile = PLAIN, **truth: float) -> None:
        self.rig, self.device = rig, SimulatedController(rig, draw(rig, 5, truth))
        self.now, self.count, self.beating = 10**15, 0, True
        self.held: dict[str, dict[str, float]] = {
            "HostControl": {},
            "HostTuning": {"BiasA": 3000, "BiasB": 3000, "BiasZ": 2000},
        }

    def run(self, seconds: float, *sent: FrameBatch) -> FrameBatch:
        out, frames = [], list(sent)
        for _ in range(round(seconds / 0.02)):
            if self.beating:
                self.count += 1
                frames.append(self.message("HostAlive", Count=self.count & 0xFFFF))
            out.append(self.device.advance(200, joined([empty_batch(), *frames]), self.now))
            self.now, frames = self.now + 20 * MS, []
        return joined([empty_batch(), *out])

    def message(self, name: str, **values: float) -> FrameBatch:
        m = self.rig.messages[name]
        return frame(m.identifier, encode(m, values), t_ns=self.now, flags=SENT | (FD if m.fd else 0))

    def ask(self, message: str = "HostControl", seconds: float = 0.04, **values: float | str) -> FrameBatch:
        """Send a message whose other signals stay as they are."""
        given = {k: DEMAND[v] if isinstance(v, str) else v for k, v in values.items()}
        self.held[message] |= given
        return self.run(seconds, self.message(message, **self.held[message]))

    def float(self) -> None:
        self.ask(Demand="Arm")
        self.ask(Demand="Float", seconds=2.0)
        assert self.device.state == "LEVITATED"


@cache
def theirs(dbc: str) -> Any:
    return cantools.database.load_string(dbc, database_format="dbc")


def read(batch: FrameBatch, dbc: str = DBC) -> dict[str, list[dict[str, Any]]]:
    """What cantools makes of frames, by message."""
    out: dict[str, list[dict[str, Any]]] = {}
    for one in batch:
        message = theirs(dbc).get_message_by_frame_id(int(one["id"]))
        out.setdefault(message.name, []).append(message.decode(payload(one), decode_choices=False))
    return out


def rows_of(device: SimulatedController) -> list[np.ndarray]:
    """The plant's rows from here on, as they are made."""
    kept: list[np.ndarray] = []
    real = device.plant.run

    def run(ticks: int) -> np.ndarray:
        kept.append(real(ticks))
        return kept[-1]

    device.plant.run = run  # type: ignore[method-assign]
    return kept


def test_frames_read_by_cantools_are_the_readings() -> None:
    host = Host()
    host.float()
    kept = rows_of(host.device)
    said = read(host.run(0.1, host.message("HostControl", **host.held["HostControl"])))
    truth = np.concatenate(kept)
    columns = {name: truth[:, k] for k, name in enumerate(host.device.truth.machine.channels)}
    columns["angle"] = (columns["angle"] + np.pi) % (2 * np.pi) - np.pi
    first = said["AmbSync"][0]["SeqNo"]
    for name, channel in PLAIN.channels.items():
        message, _, signal = channel.signal.partition(".")
        if name not in columns or name == "flags":
            continue
        s = PLAIN.messages[message].signal(signal)
        unit = units.UNITS[s.unit]
        ours = [m for m in said[message] if message == "AmbSync" or (m["Rolling"] - first) % 16 < len(truth)][
            -len(truth) + 1 :
        ]
        told = np.array([m[signal] for m in ours]) * unit.factor + unit.offset
        real = columns[name][: len(told) + 1]
        off = np.min([np.abs(told - real[k : k + len(told)]).max() for k in (0, 1) if len(real) - k >= len(told)])
        assert off <= 0.5 * s.scale * unit.factor + 1e-12, name
    assert {m["Mode"] for m in said["AmbSync"]} == {3}
    assert {m["Trip"] for m in said["AmbSync"]} == {0}
    assert {m["CoilTemp"] > 20 for m in said["AmbRest"]} == {True}


def test_messages_follow_each_other_as_the_bus_lets_them_and_slices_change_nothing() -> None:
    batches = []
    for slices in ([200] * 10, [7, 1, 3] * 181 + [9] * 3):
        device = SimulatedController(PLAIN, draw(PLAIN, 5))
        now, out = 10**15, []
        for ticks in slices:
            out.append(device.advance(ticks, empty_batch(), now))
            now += ticks * 100_000
            assert not len(out[-1]) or out[-1]["t_ns"].max() <= now
        batches.append(joined(out))
    one, other = batches
    count = min(len(one), len(other))
    assert count > 950
    assert (one[:count] == other[:count]).all()
    order = [PLAIN.messages[name].identifier for name in PLAIN.binding.telemetry]
    assert one["id"][:10].tolist() == order * 2
    gaps = np.diff(one["t_ns"][:5]) * 1e-9
    expected = [frame_seconds(PLAIN.messages[name], 1e6, None) for name in PLAIN.binding.telemetry[1:]]
    assert gaps == pytest.approx(expected, abs=1e-9)
    assert (np.diff(one["t_ns"]) > 0).all()


def test_a_level_that_stays_is_obeyed_once() -> None:
    host = Host()
    host.float()
    host.ask(Demand="Rotate", SpeedDemand=200.0, seconds=3.0)
    assert host.device.plant.speed == pytest.approx(200 * 2 * np.pi / 60, rel=0.05)
    host.ask(SpeedDemand=300.0, seconds=3.0)  # while Rotate stands another speed acts at once
    assert host.device.plant.speed == pytest.approx(300 * 2 * np.pi / 60, rel=0.05)
    host.ask(Demand="Brake", seconds=6.0)
    host.ask(SpeedDemand=100.0, seconds=1.0)
    assert abs(host.device.plant.speed) < 1.0
    host.ask(Demand="Descend", seconds=2.0)
    assert host.device.state == "READY"
    host.ask("HostTuning", BiasA=2500)
    assert (host.device.parameters.values["bias_i"], host.device.state) == (2.5, "READY")


def test_a_reset_that_is_left_standing_clears_no_later_fault() -> None:
    host = Host()
    host.float()
    host.ask(Demand="Reset")  # nothing to clear
    host.beating = False
    host.run(3.0)
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")
    host.beating = True
    host.ask(SpeedDemand=10.0)
    host.ask(AngleDemand=10.0)
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")
    host.ask(Demand="Standby")
    host.ask(Demand="Reset")
    assert (host.device.state, host.device.fault) == ("OFF", "NONE")


def test_parameters_come_before_the_command_of_their_message_and_within_their_range() -> None:
    host = Host()
    host.float()
    host.ask(Demand="Rotate", SpeedDemand=200.0, seconds=0.04)  # both in one message
    assert host.device.parameters.values["speed_ref"] == pytest.approx(200 * 2 * np.pi / 60)
    host.run(3.0)
    assert host.device.state == "SPINNING"
    host.ask(SpeedDemand=3000.0)  # beyond 70 rad/s: refused, and what is in force stays
    assert host.device.parameters.values["speed_ref"] == pytest.approx(200 * 2 * np.pi / 60)
    host.ask("HostTuning", BiasA=2500)  # at rest only
    assert host.device.parameters.values["bias_i"] == 3.0


def test_without_heartbeats_it_lands_and_says_so_by_its_own_name() -> None:
    host = Host()
    host.float()
    host.beating = False
    said = read(host.run(3.0))
    assert host.device.state == "FAULT"
    last = said["AmbSync"][-1]
    assert PLAIN.choices("state")[last["Mode"]] == "Tripped"
    stated = RigFile.parse(
        plain_text() + '\n[simulation.faults]\nHEARTBEAT_LOST = "HostSilent"\n', DBC, "plainamb.toml"
    )
    other = Host(stated)
    other.float()
    other.beating = False
    assert read(other.run(3.0))["AmbSync"][-1]["Trip"] == 4


NARROW = (
    changed(
        DBC,
        ("SG_ SeqNo : 0|16@1+", "SG_ SeqNo : 7|13@0+"),
        ("SG_ Ticks : 16|32@1+", "SG_ Ticks : 19|27@1+"),
        ("SG_ XA : 4|15@1- (0.025,0)", "SG_ XA : 20|32@1- (1,0)"),
        ("SG_ YA : 19|15@1-", "SG_ YA : 4|15@1-"),
        (' SG_ XB : 34|15@1- (0.025,0) [-409.6|409.575] "um" Bench\n', ""),
        ("SG_ YB : 49|15@1-", "SG_ YB : 52|12@1-"),
        ("SG_ Count : 0|16@1+", "SG_ Count : 6|5@0+"),
    )
    + "SIG_VALTYPE_ 144 XA : 1;\n"
)
"""Counters of odd lengths in either byte order, and a float at no byte's edge."""


def narrow() -> RigFile:
    return RigFile.parse(re.sub(r"pos_xo = .*\n", "", plain_text()), NARROW, "plainamb.toml")


def test_counters_and_numbers_of_any_width_and_order() -> None:
    rig = narrow()
    device = SimulatedController(rig, draw(rig, 5))
    kept = rows_of(device)
    decoder = TelemetryDecoder(rig)
    batch = device.advance(20_000, empty_batch(), 10**15)
    blocks = decoder.decode(batch)
    assert {v for k, v in vars(decoder.counters).items() if k != "unknown"} == {0}
    assert sum(len(b.ticks) for b in blocks) == 1999
    told = np.concatenate([b.columns["pos_xi"] for b in blocks])
    assert told == pytest.approx(np.concatenate(kept)[:1999, 0], rel=1e-6)
    assert read(batch[:5], NARROW)["AmbPos"][0]["XA"] == pytest.approx(told[0] * 1e6, rel=1e-6)


def test_a_heartbeat_of_few_bits_keeps_it_alive_and_one_that_stands_does_not() -> None:
    host = Host(narrow())
    beat: Callable[..., FrameBatch] = host.message
    host.message = lambda name, **v: beat(name, **({"Count": v["Count"] % 32} if "Count" in v else v))  # type: ignore[method-assign]
    host.float()
    host.run(1.0)
    assert host.device.state == "LEVITATED"
    host.message = lambda name, **v: beat(name, **({"Count": 3} if "Count" in v else v))  # type: ignore[method-assign]
    host.run(0.3)
    assert host.device.fault == "HEARTBEAT_LOST"


def test_a_command_is_recognised_when_all_its_signals_have_come() -> None:
    binding = {"HostControl.Demand": "Float", "HostTuning.BiasZ": 2000}
    rig = PLAIN.model_copy(deep=True)
    object.__setattr__(
        rig.devices["controller"].binding, "commands", {"LEVITATE": binding, "LAND": {"HostControl.Demand": 3}}
    )
    seen = Recogniser(rig, rig.messages)
    assert seen.take("HostControl", {"Demand": 2.0, "SpeedDemand": 0.0}) == ()
    assert seen.take("HostTuning", {"BiasZ": 1999.0}) == ()
    assert seen.take("HostTuning", {"BiasZ": 2000.0}) == ("LEVITATE",)
    assert seen.take("HostTuning", {"BiasZ": 2000.0}) == ()
    assert seen.take("HostControl", {"Demand": 3.0}) == ("LAND",)
    assert seen.take("HostControl", {"Demand": 2.0}) == ("LEVITATE",)


def test_what_cannot_be_simulated_is_refused_with_its_place(tmp_path: Path) -> None:
    toml = changed(plain_text(), ("temp_o = {", "coil_oil = {"), ("tick_s = 1e-4", "tick_s = 5e-5"))
    rig = load_rig(written(tmp_path, toml + '\n[simulation.faults]\nSENSOR = "SensorGood"\nFIRE = "Ok"\n'))
    with pytest.raises(ConfigError, match="cannot be simulated") as refused:
        draw(rig, 1)
    told = {p.key: str(p) for p in refused.value.problems}
    assert "temp_o" in told["channels.coil_oil"]
    assert "expected 0.0001 s" in told["devices.controller.tick_s"]
    assert "SensorBad" in told["simulation.faults.SENSOR"]
    assert "OVERSPEED" in told["simulation.faults.FIRE"]
    named = changed(plain_text(), ("temp_o = {", "coil_oil = {")) + '\n[simulation.readings]\ncoil_oil = "temp_o"\n'
    assert draw(load_rig(written(tmp_path, named)), 1).machine.name == "tsbs"
