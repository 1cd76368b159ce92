"""A simulated rig with a line to each of its register devices, on virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache

from bench.errors import BenchError
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from bench.rigfile.registers import RegisterPort, Table, Words
from drivers.controller import Controller
from drivers.fieldbus import Fieldbus
from drivers.open_devices import open_devices
from sim_backend.devices.registers import Followed, RegisterBank
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw


@cache
def rig() -> RigFile:
    return load_rig("tsbs12")


def changed(*replacements: tuple[str, str]) -> RigFile:
    """The rig file with parts of its text replaced."""
    text = rig().toml_text
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return RigFile.parse(text, rig().dbc_text)


@dataclass
class Line:
    """What lies between a driver and a device: counts requests, and fails as told."""

    port: RegisterPort
    reads: list[tuple[Table, int, int]] = field(default_factory=list)
    writes: list[tuple[int, Words]] = field(default_factory=list)
    failure: BenchError | None = None
    changed: Callable[[Table, int, Words], Words] = lambda table, address, words: words

    def read(self, table: Table, address: int, count: int) -> Words:
        self.reads.append((table, address, count))
        if self.failure is not None:
            raise self.failure
        return self.changed(table, address, self.port.read(table, address, count))

    def write(self, address: int, words: Words) -> None:
        self.writes.append((address, words))
        if self.failure is not None:
            raise self.failure
        self.port.write(address, words)


class Bench:
    """A simulated rig whose shaft is held by its bearings and free to turn, and a line to each register device."""

    def __init__(self, file: RigFile, truth: Mapping[str, float]) -> None:
        drawn = draw(file, 1, truth)
        self.machine = SimulatedRig(file, drawn, 1)
        self.bank = RegisterBank(file, drawn, self.machine.device.plant)
        self.lines = {name: Line(self.bank.port(name)) for name in self.bank.devices}
        base = Followed(self.machine, self.bank)
        self.controller = Controller(file, self.machine.link, base, Session(1, 1_767_225_600, "test"))
        self.clock = self.controller.clock
        self.controller.connect()

    def levitate(self) -> None:
        self.controller.enable()
        self.controller.levitate()
        for gain in ("kp_theta", "ki_theta", "kd_theta"):
            self.controller.set(gain, 0.0)

    @property
    def plant_speed(self) -> float:
        return self.machine.device.plant.shaft_speed


@contextmanager
def opened(file: RigFile | None = None, *, up: bool = True, **truth: float) -> Iterator[tuple[Bench, Fieldbus]]:
    bench = Bench(file or rig(), truth)
    if up:
        bench.levitate()
    with open_devices(file or rig(), bench.lines.__getitem__, bench.clock, bench.controller.envelope) as bus:
        yield bench, bus


def go(bench: Bench, bus: Fieldbus, seconds: float) -> None:
    for _ in range(round(seconds * 10)):
        bench.clock.sleep(0.1)
        bus.pump()
