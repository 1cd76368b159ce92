"""`bench serve`: the simulated rig in real time on its endpoints. A part of the composition root."""

from __future__ import annotations

import json
import selectors
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.cli.compose import with_links
from bench.cli.live import PageRequest
from bench.cli.opening import SUBSTEPS
from bench.cli.serve_live import Heard, ServedPage, watched
from bench.clock import WallClock
from bench.errors import ConfigError
from bench.link import fault_injection
from bench.os_signals import delivered_to
from bench.procedure import plans
from bench.rigfile import RigFile, linkurl, load_rig

if TYPE_CHECKING:
    from sim_backend.machine import SimulatedPlant, Truth
    from sim_backend.serving.peers import Peer
    from sim_backend.serving.ports import Port
    from sim_backend.serving.service import Service
    from sim_backend.serving.wirefaults import WireFaults

LOOPBACK = "127.0.0.1"
SOCKET = "socket://"


@dataclass(frozen=True)
class ServeRequest:
    """A rig to serve, as it was asked for. `bind`: the address of every TCP port."""

    rig: str
    seed: int = 0
    visit: int = 0
    truth: tuple[str, ...] = ()
    bind: str = LOOPBACK
    truth_file: Path | None = None
    links: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    page: PageRequest | None = None


def serve_command(request: ServeRequest) -> int:
    """Serve until SIGINT or SIGTERM; endpoints and `ready` on standard output, status on standard error.

    Raises:
        ConfigError: usage, rig file, an address that cannot be listened on, an unwritable truth file.
    """
    from sim_backend.controller.controller import SimulatedController
    from sim_backend.devices.modbus_server import open_fieldbus
    from sim_backend.devices.registers import RegisterBank
    from sim_backend.serving.loop import Server
    from sim_backend.serving.wirefaults import WireFaults
    from sim_backend.truth import draw

    rig = with_links(load_rig(request.rig), request.links)
    _check_links(rig, request.links)
    on_link, in_device = fault_injection.divided(
        [fault_injection.parse(text) for text in request.faults], simulated=True
    )
    truth = draw(rig, request.seed, _overrides(request.truth), visit=request.visit)
    if truth.machine.served is not None:
        on_link, in_device = fault_injection.of_a_line(on_link, in_device)
        if request.page is not None:
            raise ConfigError(f"--live: {rig.name} speaks a command line, of which no page is made; expected a rig that sends "
                              "messages. Next: leave --live out, or give it to `bench run` on this rig")  # fmt: skip
    controller: Any = (truth.machine.served or SimulatedController)(rig, truth, in_device, SUBSTEPS)
    wire = WireFaults(on_link, truth.noise, [rig.messages[name].identifier for name in rig.binding.telemetry])
    stopped: list[str] = []
    with ExitStack() as stack:
        stack.enter_context(delivered_to(stopped.append))
        selector = stack.enter_context(selectors.DefaultSelector())
        bank = RegisterBank(rig, truth, controller.plant)
        services: Sequence[Service] = (bank,)
        ports: list[Port] = []
        stack.callback(_close, ports)
        open_ports(rig, controller.plant, truth, request.bind, selector, ports, wire)
        open_fieldbus(rig, bank, request.bind, selector, ports)
        lines = [port.line for port in ports]
        for service in services:
            stack.callback(service.stop)
            lines += service.start()
        if request.truth_file is not None:
            write_truth(request.truth_file, truth)
        page = None if request.page is None else stack.enter_context(watched(request.page, _say))
        say = _say
        if page is not None:
            controller, say = Heard(rig, controller), partial(_say_both, page)
        server = Server(rig, controller, selector, ports, WallClock(), say, services, wire)
        if page is not None:
            page.begin(rig, controller, server.pacer.bench_ns(), request.seed, request.visit)
        sys.stdout.write("".join(f"{line}\n" for line in [*lines, "ready"]))
        sys.stdout.flush()
        if request.faults:
            _say(fault_injection.announced([*on_link, *in_device]).text)
        server.run(lambda: bool(stopped))
        _say(f"{stopped[0]}: stopped, controller {controller.state}; {server.statistics()}")
        if page is not None:
            page.end(f"{stopped[0]}: the rig is not served any more")
    return 0


def _close(ports: Sequence[Port]) -> None:
    for port in ports:
        port.close()


def open_ports(
    rig: RigFile, plant: SimulatedPlant, truth: Truth, bind: str, selector: selectors.BaseSelector, ports: list[Port],
    wire: WireFaults,
) -> None:  # fmt: skip
    """Open the endpoints of the controller and the operator, into `ports` one by one.

    Raises:
        ConfigError: a port is in use, or `bind` is no address of this host.
    """
    from sim_backend.serving import ptys
    from sim_backend.serving.adapter import SlcanAdapter
    from sim_backend.serving.peers import BytesPeer, LinePeer, PacketPeer
    from sim_backend.serving.ports import PtyPort, TcpPort

    name = rig.devices["controller"].link
    spec = rig.link

    def adapter() -> SlcanAdapter:
        return SlcanAdapter(spec.bitrate, spec.data_bitrate, wire.bus_off)

    kinds: tuple[tuple[str, Callable[[], Peer]], ...] = (
        ("slcan", adapter),
        ("serial", lambda: PacketPeer(wire.corrupt)),
    )
    if truth.machine.served is not None:
        kinds = (("cli", BytesPeer),)
    for scheme, peer in kinds:
        if ptys.AVAILABLE:
            ports.append(PtyPort(f"{name} {scheme}:{{}}", peer, selector))
        address = (bind, _port(spec.url, scheme))
        ports.append(TcpPort(f"{name} {scheme}:{SOCKET}{{}}", address, peer, selector))
    hands = rig.link_of("operator")
    if hands is not None:
        operator = truth.machine.operator(rig, plant, truth)
        address = (bind, _port(rig.links[hands].url, "line"))
        ports.append(TcpPort(f"{hands} line:{{}}", address, lambda: LinePeer(operator.request), selector))


def _port(url: str, scheme: str) -> int:
    """The TCP port that a link's URL names for a scheme; 0, any free one, when it names none."""
    parsed = linkurl.parse(url)
    if parsed.scheme != scheme or (scheme != "line" and not parsed.rest.startswith(SOCKET)):
        return 0
    return linkurl.LinkUrl(scheme, parsed.rest.removeprefix(SOCKET)).address[1]


def _check_links(rig: RigFile, assignments: Sequence[str]) -> None:
    """An address given on purpose must be one that can be listened on; the rig file may name a real adapter."""
    expected: dict[str, tuple[str, ...]] = {}
    forms: tuple[str, ...] = ("slcan:socket://HOST:PORT", "serial:socket://HOST:PORT")
    if rig.commandline is not None:
        forms = ("cli:socket://HOST:PORT",)
    expected[rig.devices["controller"].link] = forms
    if hands := rig.link_of("operator"):
        expected[hands] = ("line:HOST:PORT",)
    for device in rig.devices.values():
        if device.registers:
            expected[device.link] = ("modbus-tcp:HOST:PORT", "modbus-rtu-tcp:HOST:PORT")
    for text in assignments:
        name, _, url = text.partition("=")
        if name in expected and not any(url.startswith(form.partition("HOST")[0]) for form in expected[name]):
            such = " or ".join(expected[name])
            raise ConfigError(f"--link {text}: cannot listen there; expected {name}={such}; port 0 takes any free one")


def _overrides(assignments: Sequence[str]) -> Mapping[str, float]:
    values = dict(plans.assignment(text) for text in assignments)
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"--truth {key}: found {value!r}; expected a number, SI")
    return values


def write_truth(path: Path, truth: Truth) -> None:
    """What was drawn, as `truth.json` of a simulated run has it.

    Raises:
        ConfigError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(truth.facts, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--truth-file {path}: cannot be written: {error.strerror or error}") from error


def _say_both(page: ServedPage, text: str) -> None:
    _say(text)
    page.say(text)


def _say(text: str) -> None:
    with suppress(OSError):  # whoever listened has gone; the rig is still served
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()
