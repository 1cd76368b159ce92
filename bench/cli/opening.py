"""How a rig is opened: a simulated one in this process, or a live one over its links. Both end in the same OpenRig."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from bench.cli import console
from bench.cli.openrig import rig_of
from bench.clock import Clock, WallClock
from bench.errors import BenchError, ConfigError
from bench.findings import Finding
from bench.link import Link, fault_injection
from bench.link.fault_injection import Fault
from bench.link.session import Session, new_session
from bench.procedure.roles import Operator
from bench.question import Answer, Question
from bench.rigfile import RigFile, linkurl
from bench.rigfile.registers import RegisterPort
from bench.run.job import Connect, OpenRig, WatchedClock
from bench.run.supervisor import Supervisor
from bench.wire import sign

if TYPE_CHECKING:
    from drivers.controller import Controller
    from drivers.live_link import LiveLink
    from drivers.operator import LineOperator
    from sim_backend.machine import Truth

logger = logging.getLogger("bench.opening")
LIVE_SLICE_S = 0.02
SUBSTEPS, SLICE_S = 2, 0.1  # of a simulated rig
SIMULATED = Session(1, 1_767_225_600, "simulation")


def simulated(
    rig: RigFile,
    seed: int,
    overrides: Mapping[str, float],
    operator: str,
    settings: Mapping[str, float] | None = None,
    injected: Sequence[Fault] = (),
    asking: console.Asking = console.quietly,
    *,
    visit: int = 0,
    stretch: int = 0,
    start_ns: int | None = None,
) -> Connect:
    """How to open a simulated rig. The truth is drawn now, so that a wrong override is found before the start.

    Raises:
        ConfigError: an override names nothing.
    """
    from sim_backend.truth import draw

    drawn = draw(rig, seed, overrides, settings, visit=visit, stretch=stretch)
    return of_truth(rig, drawn, operator, injected, asking, start_ns=start_ns)


def of_truth(
    rig: RigFile, truth: Truth, operator: str, injected: Sequence[Fault] = (), asking: console.Asking = console.quietly,
    *, substeps: int = SUBSTEPS, slice_s: float = SLICE_S, start_ns: int | None = None,
) -> Connect:  # fmt: skip
    """How to open the simulated rig of a truth.

    Args:
        substeps: integration steps of the plant in a tick.
        slice_s: the longest sleep in one piece; links, envelope and supervisor are looked at after each.
        start_ns: when it is switched on; the simulation's epoch by default.
    """
    from sim_backend.endpoint import EPOCH_NS, SimulatedRig

    @contextmanager
    def connect(supervisor: Supervisor) -> Iterator[OpenRig]:
        from drivers.controller import Controller
        from drivers.open_devices import open_devices
        from drivers.operator import LineOperator
        from sim_backend.devices.registers import Followed, RegisterBank

        machine = SimulatedRig(rig, truth, SIMULATED.number, injected, substeps, start_ns or EPOCH_NS)
        bank = RegisterBank(rig, truth, machine.device.plant)
        base = WatchedClock(Followed(machine, bank), machine.link.renew_lease, supervisor.check)
        controller = Controller(rig, machine.link, base, SIMULATED, slice_s)
        line = LineOperator(machine.request, controller.clock, controller.envelope)
        try:
            controller.connect()
            with open_devices(rig, bank.port, controller.clock, controller.envelope) as bus:
                hands = _operators(operator, line, controller, lambda _: console.blocking(supervisor, asking))
                yield rig_of(controller, base, bus, hands, truth.facts, injected)
        finally:
            machine.link.close()

    return connect


def live(
    rig: RigFile,
    operator: str,
    injected: Sequence[Fault] = (),
    clear_fault: bool = False,
    asking: console.Asking = console.quietly,
) -> Connect:
    """How to open a live rig: its controller's link with its heartbeat, its other devices, and the operator.

    Raises:
        ConfigError: a link's URL is none, or of a kind that its device cannot have; a fault that only a simulated
            controller can have.
    """
    fault_injection.divided(injected, simulated=False)
    spec = rig.link
    scheme = linkurl.parse(spec.url).scheme
    if scheme not in (able := linkurl.controller_schemes()[1:]):
        known = ", ".join(map(linkurl.example, able))
        raise ConfigError(f"link {rig.devices['controller'].link}: found {spec.url!r}; expected such as {known}")

    @contextmanager
    def connect(supervisor: Supervisor) -> Iterator[OpenRig]:
        from drivers.controller import Controller
        from drivers.modbus import open_lines
        from drivers.open_devices import open_devices

        session = new_session()
        with ExitStack() as stack:
            stack.enter_context(supervisor.finishing())
            wall = WallClock()
            real = _live_link(rig, session, wall)
            link = _with_faults(rig, real, wall, injected)
            stack.callback(link.close)

            def renew() -> None:
                if controller.owned:
                    link.renew_lease()

            base = WatchedClock(wall, renew, supervisor.check)
            controller = Controller(rig, link, base, session, LIVE_SLICE_S)
            controller.watch.simulated = real.simulated
            controller.connect(clear_fault)
            stack.callback(_released, controller)
            hands = _operator_on_a_line(rig, controller, stack) if operator != "console" else None
            lines = stack.enter_context(open_lines(rig))

            def port_of(device: str) -> RegisterPort:
                return lines[rig.devices[device].link].port(rig.devices[device].unit)

            bus = stack.enter_context(
                open_devices(
                    rig, port_of, controller.clock, controller.envelope, threaded=True, clear_fault=clear_fault
                )
            )
            people = _operators(operator, hands, controller, lambda clock: console.attentive(clock, asking))
            opened = rig_of(controller, base, bus, people, None, injected, lines)
            yield replace(opened, findings=[*opened.findings, *_priority(real)])

    return connect


def _live_link(rig: RigFile, session: Session, wall: Clock) -> LiveLink:
    """The controller's link with its heartbeat."""
    from drivers.live_link import LiveLink
    from drivers.wires import open_wire

    spec, name = rig.link, rig.devices["controller"].link
    identifiers = [sign.IDENTIFIER, *(m.identifier for m in rig.messages.messages.values())]
    return LiveLink(name, lambda: open_wire(spec, name, identifiers, wall.now_ns, rig), beat_of(rig, session),
                    heartbeat=spec.heartbeat, reconnect_s=spec.reconnect_s)  # fmt: skip


def _with_faults(rig: RigFile, real: LiveLink, wall: Clock, injected: Sequence[Fault]) -> Link:
    """The link with the faults that are to happen on it."""
    from drivers.faulty_link import FaultyLink

    if not injected:
        return real
    telemetry = [rig.messages[m].identifier for m in rig.binding.telemetry]
    return FaultyLink(real, injected, 0, wall, telemetry=telemetry, hush=real.hush,
                      reconnect_s=rig.link.reconnect_s)  # fmt: skip


def _priority(link: LiveLink) -> list[Finding]:
    """What the record says where heartbeats run like any other program."""
    if not link.unpreferred:
        return []
    text = (
        f"heartbeats run without real-time priority ({link.unpreferred}): on a busy host they may be late. Next: let this "
        "user have it (`ulimit -r`, CAP_SYS_NICE)"
    )
    return [Finding("heartbeat-unprioritised", text, link.name)]


def _operator_on_a_line(rig: RigFile, controller: Controller, stack: ExitStack) -> LineOperator | None:
    """The operator of a rig whose operator is a device, such as the simulated person of `bench serve`."""
    from drivers.background import Background
    from drivers.operator import LineOperator
    from drivers.operator_line import OperatorLine

    name = rig.link_of("operator")
    if name is None:
        return None
    line = stack.enter_context(OperatorLine.open(rig.links[name].url))
    asking = Background(controller.clock, "requests to the operator")
    stack.callback(asking.close)
    return LineOperator(asking.of(line.request), controller.clock, controller.envelope)


def beat_of(rig: RigFile, session: Session) -> Any:
    """The heartbeat that a rig's DBC describes: its counter has any width and byte order."""
    from bench.link.codec import encode, places_of
    from drivers.heartbeat import Beat

    b = rig.binding
    message = rig.messages[b.heartbeat]
    counter = message.signal(b.heartbeat_counter)
    owned = {"session": session.number} if any(s.name == "session" for s in message.signals) else {}
    period = message.period_s or 0.02
    return Beat(message.identifier, encode(message, owned), places_of(counter), message.fd, period_s=period)


def _released(controller: Controller) -> None:
    """A bench that ends well lets the next one in at once; one that does not is forgotten after a second."""
    with suppress(BenchError):
        controller.release()


def _operators(
    kind: str,
    line: LineOperator | None,
    controller: Controller,
    prompt: Callable[[Clock], Callable[[Question], Answer]],
) -> list[Operator]:
    """The operator, and whoever else records what is done by hand. `prompt` makes what asks a person."""
    from drivers.person import ConsoleOperator

    if kind == "console" or line is None:
        person = ConsoleOperator(prompt(controller.clock), controller.clock, controller.envelope, line)
        person.attended = kind == "console"
        return [person, line] if line is not None else [person]
    return [line]
