"""The simulated register devices: the drive's commands, faults and own watchdog; supply and temperatures of the plant."""

from __future__ import annotations

from functools import cache

import pytest

from bench.errors import ConfigError
from bench.link.frames import empty_batch
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile, load_rig
from bench.rigfile.registers import RegisterRefused
from sim_backend.controller.controller import SimulatedController
from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.devices.registers import Followed, RegisterBank
from sim_backend.machines.tsbs.plant import Plant
from sim_backend.truth import draw

COAST, RUN, STOP, RESET = 0, 1, 2, 4
TICKS_PER_POLL = 1000


@cache
def rig() -> RigFile:
    return load_rig("tsbs12")


class Machine:
    """A levitated plant with its register devices; `go` lets time pass with or without a host that polls."""

    def __init__(self, **truth: float) -> None:
        drawn = draw(rig(), 1, truth)
        self.plant = Plant(drawn.plant, 1)
        self.plant.set("torque_on", 0.0)
        self.plant.mode = READY
        self.plant.run(1000)
        self.plant.mode = LIFT
        self.plant.run(12000)
        self.plant.mode = LEVITATE
        self.bank = RegisterBank(rig(), drawn, self.plant)
        self.port = self.bank.port("drive")
        self.drive = self.bank.drives["drive"]

    def go(self, seconds: float, *, polled: bool = True) -> None:
        for _ in range(round(seconds * 10)):
            self.plant.run(TICKS_PER_POLL)
            self.bank.tick(0)
            if polled:
                self.port.read("input", 0, 5)

    def command(self, code: int) -> None:
        self.port.write(0, (code,))

    def aim(self, rpm: float) -> None:
        raw = round(rpm * 100) & 0xFFFFFFFF
        self.port.write(1, (raw & 0xFFFF, raw >> 16))

    @property
    def words(self) -> tuple[int, ...]:
        """running, fault, speed low, speed high, torque"""
        return self.port.read("input", 0, 5)


def test_it_runs_up_holds_coasts_and_brakes() -> None:
    m = Machine()
    m.aim(382)  # 40 rad/s
    assert m.words == (0, 0, m.words[2], m.words[3], 0)
    m.command(RUN)
    m.go(3)
    assert m.plant.shaft_speed == pytest.approx(39.85, abs=0.1)
    running, fault, low, high, torque = m.words
    assert (running, fault) == (1, 0)
    assert (high << 16 | low) == pytest.approx(m.plant.shaft_speed * 60 / 6.283185307 * 100, abs=1)
    assert torque == pytest.approx(100 * m.plant.drive_torque, abs=0.6)
    assert torque > 250
    m.command(COAST)
    m.go(0.5)
    coasted = m.plant.shaft_speed
    assert 5 < coasted < 25  # by drag alone
    assert m.words[0] == 0
    assert m.words[4] == 0
    m.command(STOP)
    m.go(2.5)
    assert abs(m.plant.shaft_speed) < 0.5
    assert m.words[0] == 0  # it let go at standstill


def test_a_new_speed_takes_effect_while_it_runs_and_backwards_too() -> None:
    m = Machine()
    m.command(RUN)
    m.aim(-191)  # -20 rad/s
    m.go(2)
    assert m.plant.shaft_speed == pytest.approx(-19.9, abs=0.1)
    assert m.words[3] == 0xFFFF
    assert m.words[4] & 0x8000


def test_without_requests_for_a_second_it_coasts_and_latches_a_fault() -> None:
    m = Machine()
    m.aim(382)
    m.command(RUN)
    m.go(3)
    m.go(0.9, polled=False)
    assert m.drive.state == "running"
    m.go(0.2, polled=False)
    assert (m.drive.state, m.drive.fault, m.plant.drive_torque) == ("off", "COMMUNICATION", 0)
    m.go(1, polled=False)
    assert m.plant.shaft_speed < 10
    assert m.words[:2] == (0, 3)
    m.command(RUN)
    assert m.words[:2] == (0, 3)  # not in fault
    m.command(RESET)
    m.command(RUN)
    assert m.words[:2] == (1, 0)


def test_a_request_that_comes_too_late_finds_it_coasting() -> None:
    """The watchdog needs no tick: in-process, time may pass in one piece."""
    m = Machine()
    m.command(RUN)
    m.plant.run(10_001)
    assert m.words[:2] == (0, 3)


def test_silence_while_it_is_off_is_no_fault() -> None:
    m = Machine()
    m.go(3, polled=False)
    assert m.words[:2] == (0, 0)


def test_overload_when_something_else_holds_the_shaft() -> None:
    m = Machine()
    m.plant.set("torque_on", 1.0)
    m.aim(382)
    m.command(RUN)
    m.go(6)
    assert m.words[:2] == (0, 2)


def test_overspeed_switches_off() -> None:
    m = Machine()
    m.aim(1000)  # 105 rad/s; the rig's greatest is 75
    m.command(RUN)
    m.go(6)
    assert m.words[:2] == (0, 1)
    assert m.plant.shaft_speed < 83


def test_planted_fault() -> None:
    m = Machine(drive_fault_after_s=2.0)
    m.aim(382)
    m.command(RUN)
    m.go(1.5)
    assert m.words[:2] == (0, 4)
    m.command(RESET)
    assert m.words[:2] == (0, 0)


def test_what_does_not_exist_is_refused() -> None:
    m = Machine()
    for table, address, count in (("input", 5, 1), ("input", 4, 2), ("holding", 3, 1), ("holding", 100, 1)):
        with pytest.raises(RegisterRefused, match="illegal data address") as refused:
            m.port.read(table, address, count)  # type: ignore[arg-type]
        assert refused.value.code == 2
    with pytest.raises(RegisterRefused, match="illegal data value"):
        m.command(77)
    assert m.port.read("holding", 0, 1) == (0,)


def test_supply_follows_the_currents() -> None:
    m = Machine()
    port = m.bank.port("supply")
    m.go(1)
    copper = sum(0.6 * i * i for i in m.plant.currents[:10]) + sum(0.4 * i * i for i in m.plant.currents[10:])
    voltage, current = port.read("input", 100, 2)
    assert voltage == 14800
    assert current == pytest.approx(100 * (0.35 + copper / 148), abs=1)
    m.plant.load(4.25, 41.7, 0.3)
    m.go(1)
    assert port.read("input", 101, 1)[0] > current


def test_temperatures_are_those_of_the_telemetry() -> None:
    truth = draw(rig(), 1)
    device = SimulatedController(rig(), truth)
    bank, decoder = RegisterBank(rig(), truth, device.plant), TelemetryDecoder(rig())
    for _ in range(3):
        decoder.decode(device.advance(100_000, empty_batch(), 0))
        words = bank.port("thermal").read("input", 0, 3)
        for name, word in zip(("temp_i", "temp_o", "temp_m"), words, strict=True):
            assert word / 10 + 273.15 == pytest.approx(decoder.latest[name], abs=0.06)


def test_the_clock_lets_the_drive_follow() -> None:
    class Stepping:
        """Bench time of the plant alone."""

        def now_ns(self) -> int:
            return m.plant.tick * 100_000

        def sleep(self, seconds: float) -> None:
            m.plant.run(round(seconds * 1e4))

    m = Machine()
    clock = Followed(Stepping(), m.bank)
    m.command(RUN)
    before = clock.now_ns()
    clock.sleep(1.2)
    assert clock.now_ns() - before == 1_200_000_000
    assert m.drive.fault == "COMMUNICATION"


def test_two_devices_on_one_unit_cannot_be() -> None:
    text = rig().toml_text.replace("unit = 2\n", "unit = 1\n")
    twice = RigFile.parse(text, rig().dbc_text)
    with pytest.raises(ConfigError, match=r"devices\.supply\.unit: found 1, which is drive's"):
        RegisterBank(twice, draw(twice, 1), Plant())


def test_a_drive_without_its_numbers_cannot_be_simulated() -> None:
    lines = rig().toml_text.splitlines(keepends=True)
    bare = RigFile.parse("".join(x for x in lines if not x.startswith("drive_limit")), rig().dbc_text)
    with pytest.raises(ConfigError, match=r"simulation: found no drive_limit; a simulated drive needs drive_gain"):
        RegisterBank(bare, draw(bare, 1), Plant())
