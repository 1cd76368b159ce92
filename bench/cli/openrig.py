"""An open rig of its parts, simulated or live: what is recorded, guarded, made safe and told of how it was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bench.cli.safety import making_safe, may_touch
from bench.cli.stage_safety import making_stage_safe
from bench.cli.touching import approach, standing
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.link import fault_injection
from bench.link.fault_injection import Fault
from bench.link.health import Health
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile.binding import HELD
from bench.run.job import OpenRig, WatchedClock

if TYPE_CHECKING:
    from drivers.controller import Controller
    from drivers.fieldbus import Fieldbus
    from drivers.registerline import RegisterLine


def rig_of(
    controller: Controller, base: WatchedClock, bus: Fieldbus, operators: Sequence[Any], truth: Mapping[str, Any] | None,
    injected: Sequence[Fault], lines: Mapping[str, RegisterLine] = MappingProxyType({}),
) -> OpenRig:  # fmt: skip
    """The rig of a controller, its register devices and who works on it; `truth` is None of a real one."""
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
                      replies_wrong_length=controller.requests.wrong_length, simulated=controller.watch.simulated,
                      stuck=controller.watch.stuck.found)  # fmt: skip

    rig = Rig(controller.rig, controller.clock, controller, controller.rotation, operators[0], controller.telemetry.counters,
              health, controller.link.close, bus.drive, bus.supply, bus.thermal, controller.capture,
              controller.stage)  # fmt: skip
    found = _found(controller, bus, injected, real=truth is None)
    streams = [controller.telemetry.layout, *bus.layouts]
    steps, aftermath = (
        making_safe(controller, base, bus.drive) if controller.stage is None else making_stage_safe(controller, base)
    )
    return OpenRig(
        rig, streams, attach, unguard, steps, truth, found, controller.catch_up, aftermath, controller.identity
    )


def _found(controller: Controller, bus: Fieldbus, injected: Sequence[Fault], *, real: bool) -> list[Finding]:
    """How the controller and the drive were found, and what is done to them on purpose."""
    found = [fault_injection.announced(injected)] if injected else []
    if controller.cleared:
        found.append(
            Finding("fault-cleared", f"fault {controller.cleared} of an earlier run was cleared", "controller")
        )
    if real and controller.watch.simulated:
        text = "the controller says that it is a simulated one: no machine was measured"
        found.append(Finding(SIMULATED_CONTROLLER, text, "controller"))
    if controller.restored:
        text = f"parameters that an earlier host left were set to the rig file's: {', '.join(controller.restored)}"
        found.append(Finding("parameters-restored", text, "controller"))
    if bus.cleared:
        found.append(Finding("fault-cleared", f"fault {bus.cleared} of an earlier run was cleared", "drive"))
    return found
