"""The register devices of a served rig over TCP, RTU on a pty, and RTU over TCP, in real time."""

from __future__ import annotations

import selectors
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import pytest
from far_end import until

from bench.clock import WallClock
from bench.errors import LinkError
from bench.rigfile import RigFile, load_rig
from bench.rigfile.envelope import Envelope
from drivers.fieldbus import Fieldbus
from drivers.modbus import open_lines
from drivers.open_devices import open_devices
from sim_backend.controller.controller import SimulatedController
from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.devices.modbus_server import open_fieldbus
from sim_backend.devices.registers import RegisterBank
from sim_backend.serving.loop import Server
from sim_backend.serving.ports import Port
from sim_backend.truth import draw

SCHEMES = ("modbus-tcp", "modbus-rtu-tcp", "modbus-rtu")


@cache
def rig() -> RigFile:
    text = load_rig("tsbs12").toml_text.replace("modbus-tcp:127.0.0.1:28503", "modbus-tcp:127.0.0.1:0")
    return RigFile.parse(text.replace("poll_s = 0.1\n", "poll_s = 0.05\n"), load_rig("tsbs12").dbc_text)


class Served:
    """A served rig whose shaft is held by its bearings and free to turn. `close` is the power cut."""

    def __init__(self) -> None:
        truth = draw(rig(), 1)
        self.controller = SimulatedController(rig(), truth)
        self.plant = self.controller.plant
        self.plant.set("torque_on", 0.0)
        for mode, ticks in ((READY, 1000), (LIFT, 12000), (LEVITATE, 1000)):
            self.plant.mode = mode
            self.plant.run(ticks)
        self.bank = RegisterBank(rig(), truth, self.plant)
        self._selector = selectors.DefaultSelector()
        self.ports: list[Port] = []
        open_fieldbus(rig(), self.bank, "127.0.0.1", self._selector, self.ports)
        self._stopped = threading.Event()
        self.server = Server(
            rig(), self.controller, self._selector, self.ports, WallClock(), lambda _: None, (self.bank,)
        )
        self._thread = threading.Thread(target=self.server.run, args=(self._stopped.is_set,), daemon=True)
        self._thread.start()

    def urls(self) -> dict[str, str]:
        """By scheme, from the lines that `bench serve` prints."""
        lines = [port.line.split() for port in self.ports]
        assert {link for link, _ in lines} == {"fieldbus"}
        return {url.partition(":")[0]: url for _, url in lines}

    def close(self) -> None:
        self._stopped.set()
        self._thread.join(20.0)
        for port in self.ports:
            port.close()
        self._selector.close()


@contextmanager
def served() -> Iterator[Served]:
    machine = Served()
    try:
        yield machine
    finally:
        machine.close()


@contextmanager
def bus_to(url: str, reconnect_s: float = 0.0) -> Iterator[Fieldbus]:
    link = rig().links["fieldbus"].model_copy(update={"url": url, "reconnect_s": reconnect_s})
    file = rig().model_copy(update={"links": {**rig().links, "fieldbus": link}})
    with open_lines(file) as lines:
        line, devices = lines["fieldbus"], file.devices
        with open_devices(
            file, lambda n: line.port(devices[n].unit), WallClock(), Envelope(file), threaded=True
        ) as bus:
            yield bus


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_shaft_spins_up_and_down(scheme: str) -> None:
    with served() as machine, bus_to(machine.urls()[scheme]) as bus:
        assert bus.drive is not None
        assert bus.thermal is not None
        bus.drive.reach(8.0)
        assert machine.plant.shaft_speed == pytest.approx(8, abs=0.6)
        assert bus.thermal.ambient_K == pytest.approx(295, abs=0.01)
        bus.drive.coast()
        bus.wait(lambda: abs(machine.plant.shaft_speed) < 6, 20.0, "coasting")
        bus.drive.stop()
        assert abs(machine.plant.shaft_speed) < 1


def test_a_bench_that_dies_leaves_a_drive_that_coasts() -> None:
    """Nobody asks any more; nobody tells it to coast either."""
    with served() as machine:
        with bus_to(machine.urls()["modbus-tcp"]) as bus:
            assert bus.drive is not None
            bus.drive.reach(8.0)
            for device in bus.devices.values():
                device._port.line.close()  # type: ignore[attr-defined]
        drive = machine.bank.drives["drive"]
        assert drive.state == "running"
        until(lambda: drive.state == "off")
        assert drive.fault == "COMMUNICATION"
        with bus_to(machine.urls()["modbus-tcp"]) as bus:
            assert bus.cleared == "COMMUNICATION"


def test_a_server_that_dies_is_a_lost_link() -> None:
    with served() as machine, bus_to(machine.urls()["modbus-tcp"]) as bus:
        bus.wait(lambda: bool(bus._polls["drive"]._slot > 2), 20.0, "polls")
        machine.close()
        with pytest.raises(LinkError, match=r"device \w+ on link fieldbus: no reading for .*modbus-tcp:127"):
            bus.wait(lambda: False, 20.0, "the loss")
