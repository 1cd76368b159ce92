"""How a rig is opened: a simulated one in this process, or a live one over its links. Both end in the same OpenRig."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bench.cli import console
from bench.cli.safety import making_safe, may_touch
from bench.cli.stage_safety import making_stage_safe
from bench.cli.touching import approach, standing
from bench.clock import Clock, WallClock
from bench.errors import BenchError, ConfigError
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.link import Link, fault_injection
from bench.link.fault_injection import Fault
from bench.link.health import Health
from bench.link.session import Session, new_session
from bench.procedure.rig import Rig
from bench.procedure.roles import Operator
from bench.question import Answer, Question
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile, linkurl
from bench.rigfile.binding import HELD
from bench.rigfile.registers import RegisterPort
from bench.run.job import Connect, OpenRig, WatchedClock
from bench.run.supervisor import Supervisor
from bench.wire import sign

if TYPE_CHECKING:
    from drivers.controller import Controller
    from drivers.fieldbus import Fieldbus
    from drivers.live_link import LiveLink
    from drivers.operator import LineOperator
    from drivers.registerline import RegisterLine
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
                yield _opened(controller, base, bus, hands, truth.facts, injected)
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
            opened = _opened(controller, base, bus, people, None, injected, lines)
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


def _opened(
    controller: Controller, base: WatchedClock, bus: Fieldbus, operators: Sequence[Any], truth: Mapping[str, Any] | None,
    injected: Sequence[Fault], lines: Mapping[str, RegisterLine] = MappingProxyType({}),
) -> OpenRig:  # fmt: skip
    recording: list[Any] = [controller, bus, *operators]
    controller.companions.append(bus.pump)
    bus.held = lambda: controller.mode in HELD
    if bus.drive is not None:
        bus.drive.may_run = controller.require_levitated

    for person in operators:
        person.may_touch = may_touch(controller, bus.drive)
        person.approach, person.standing = approach(controller), standing(controller)

    def attach(recorder: Recorder | None) -> None:
        for part in recording:
            part.recorder = recorder

    def unguard() -> None:
        controller.guarded = bus.guarded = False

    def health() -> Health:
        telemetry = controller.telemetry
        others = {name: line.stats for name, line in lines.items()}
        return Health(telemetry.counters, controller.link.stats, telemetry.host.drift(), telemetry.host.latest_ns,
                      controller.watch.host_age_s, controller.requests.round_trip_ns, others,
                      repeats=controller.requests.repeats, cut_ns=controller.cut_ns, beyond_drift=telemetry.host.beyond,
                      unknown_s=telemetry.host.unknown_s, gained_ns=telemetry.host.rate.gained_ns,
                      replies_wrong_length=controller.requests.wrong_length, stuck=controller.watch.stuck.found)  # fmt: skip

    rig = Rig(controller.rig, controller.clock, controller, controller.rotation, operators[0], controller.telemetry.counters,
              health, controller.link.close, bus.drive, bus.supply, bus.thermal, controller.capture,
              controller.stage)  # fmt: skip
    found = [fault_injection.announced(injected)] if injected else []
    if controller.cleared:
        found.append(
            Finding("fault-cleared", f"fault {controller.cleared} of an earlier run was cleared", "controller")
        )
    if truth is None and controller.watch.simulated:
        text = "the controller says that it is a simulated one: no machine was measured"
        found.append(Finding(SIMULATED_CONTROLLER, text, "controller"))
    if controller.restored:
        text = f"parameters that an earlier host left were set to the rig file's: {', '.join(controller.restored)}"
        found.append(Finding("parameters-restored", text, "controller"))
    if bus.cleared:
        found.append(Finding("fault-cleared", f"fault {bus.cleared} of an earlier run was cleared", "drive"))
    streams = [controller.telemetry.layout, *bus.layouts]
    steps, aftermath = (
        making_safe(controller, base, bus.drive) if controller.stage is None else making_stage_safe(controller, base)
    )
    return OpenRig(
        rig, streams, attach, unguard, steps, truth, found, controller.catch_up, aftermath, controller.identity
    )
