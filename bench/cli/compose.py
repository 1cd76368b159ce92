"""The composition root: from names on the command line to a procedure, a rig file, a plan and an open rig.

The only module that knows every room. What is simulated is imported only when a simulated rig is opened, so that
stored runs are analysed without it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import catalogue, plans
from bench.clock import Clock
from bench.envelope import Envelope
from bench.errors import ConfigError, OperatorAbort
from bench.opened import Connect, Job, OpenRig, WatchedClock
from bench.procedure import Procedure
from bench.recorder import Recorder
from bench.rig import Rig
from bench.rigfile import RigFile, load_rig
from bench.roles import Operator
from bench.specs import load_spec
from bench.supervisor import SafeStep, Supervisor

if TYPE_CHECKING:
    from drivers.controller import CanController

RESTING = ("OFF", "READY", "FAULT")
LAND_S, STOP_S, COMMAND_S = 20.0, 90.0, 5.0


@dataclass(frozen=True)
class Request:
    """A run as it was asked for."""

    procedure: str
    rig: str
    backend: str = "sim"
    seed: int | None = None
    plan: tuple[str, ...] = ()
    plan_file: Path | None = None
    truth: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    out: Path = Path("runs")
    operator: str | None = None
    report: bool = True


def load_procedure(name: str) -> Procedure:
    """The procedure of that name in the catalogue.

    Raises:
        ConfigError: there is none.
    """
    found: Procedure = importlib.import_module(catalogue.entry(name).module).procedure
    return found


def prepare(request: Request) -> tuple[Job, Connect]:
    """Everything that can be wrong before a machine is touched, found out.

    Raises:
        ConfigError: usage, rig file, plan or spec; every problem of the first of them that has one.
    """
    _refuse_mixed_backends(request)
    procedure = load_procedure(request.procedure)
    rig = load_rig(request.rig)
    defaults = (f"{rig.path} [plans.{procedure.name}]", rig.plans.get(procedure.name, {}))
    plan = plans.assemble(procedure.plan, defaults, request.plan_file, request.plan)
    problems = [*procedure.check(rig, plan), *Envelope(rig).problems_of(dict(procedure.settings(plan)))]
    if problems:
        raise ConfigError("\n  ".join(["the plan does not fit the rig; nothing was started:", *problems]))
    limits = load_spec(rig.name, procedure.name, [q.name for q in procedure.measures])
    if request.backend == "live":
        raise _no_live(rig)
    seed = 0 if request.seed is None else request.seed
    overrides = dict(plans.assignment(text) for text in request.truth)
    _refuse_words(overrides)
    connect = simulated(rig, seed, overrides, request.operator or "auto", procedure.settings(plan))
    return Job(procedure, rig, plan, limits, request.backend, seed), connect


def _refuse_mixed_backends(request: Request) -> None:
    if request.backend == "live":
        given = [name for name, value in (("--truth", request.truth), ("--seed", request.seed is not None)) if value]
        if given:
            raise ConfigError(
                f"{' and '.join(given)}: a real rig has no seed and no truth to set; expected --backend sim, or none of these"
            )
    elif request.links:
        raise ConfigError("--link: the simulated rig runs in this process; expected --backend live, or leave it out")


def _no_live(rig: RigFile) -> ConfigError:
    urls = ", ".join(f"{name} is {link.url!r}" for name, link in rig.links.items())
    return ConfigError(
        f"--backend live: rig {rig.name}: {urls}; links of this rig exist only within one process, in simulation. "
        "Next: leave --backend out"
    )


def _refuse_words(overrides: Mapping[str, Any]) -> None:
    for key, value in overrides.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"--truth {key}: found {value!r}; expected a number, SI")


def simulated(
    rig: RigFile,
    seed: int,
    overrides: Mapping[str, float],
    operator: str,
    settings: Mapping[str, float] | None = None,
) -> Connect:
    """How to open a simulated rig. The truth is drawn now, so that a wrong override is found before the start.

    Raises:
        ConfigError: an override names nothing.
    """
    from sim_backend.endpoint import SimulatedRig
    from sim_backend.truth import draw

    truth = draw(rig, seed, overrides, settings)
    facts = {
        "schema": 1, "seed": seed, "quantities": dict(truth.quantities), "values": dict(truth.values),
        "defects": dict(truth.defects),
    }  # fmt: skip

    @contextmanager
    def connect(supervisor: Supervisor) -> Iterator[OpenRig]:
        from drivers.controller import CanController
        from drivers.operator import ConsoleOperator, LineOperator

        machine = SimulatedRig(rig, truth)
        base = WatchedClock(machine, machine.link.renew_lease, supervisor.check)
        controller = CanController(rig, machine.link, base)
        line = LineOperator(machine.request, controller.clock, controller.envelope)
        person: Operator = line
        recorders: list[Any] = [controller, line]
        if operator == "console":
            person = ConsoleOperator(_prompt(supervisor), controller.clock, controller.envelope, line)
            recorders.append(person)
        try:
            yield _opened(rig, controller, person, recorders, facts, machine.link.close)
        finally:
            machine.link.close()

    return connect


def _opened(
    rig: RigFile, controller: CanController, operator: Operator, recorders: Sequence[Any], truth: Mapping[str, Any],
    close: Callable[[], None],
) -> OpenRig:  # fmt: skip
    def attach(recorder: Recorder | None) -> None:
        for part in recorders:
            part.recorder = recorder

    def unguard() -> None:
        controller.guarded = False

    live = Rig(rig, controller.clock, controller, controller, operator, controller.telemetry.counters, close)
    return OpenRig(live, [controller.telemetry.layout], attach, unguard, safe_steps(controller), truth)


def safe_steps(controller: CanController) -> tuple[SafeStep, ...]:
    """The ordered make-safe of a controller: stop the rotor, land it, switch the amplifiers off; if that fails, the
    controller's own. Levitation is not released while the rotor turns above the landing speed: the controller refuses.
    """

    def look() -> None:
        controller.clock.sleep(0.02)  # a command may have been sent whose effect nobody has seen yet

    def stop() -> None:
        if controller.mode == "SPINNING":
            controller.stop()

    def land() -> None:
        if controller.mode == "LEVITATED":
            controller.land()
        elif controller.mode == "LIFTING":
            controller.make_safe()
        _until(lambda: controller.mode in RESTING, controller.clock)

    def disable() -> None:
        if controller.mode == "READY":
            controller.disable()

    def own() -> None:
        if controller.mode not in ("OFF", "FAULT"):
            controller.make_safe()
            _until(lambda: controller.mode in ("OFF", "FAULT"), controller.clock)

    return (
        SafeStep("see where the machine stands", look, COMMAND_S),
        SafeStep("stop the rotor", stop, STOP_S),
        SafeStep("land the rotor", land, LAND_S),
        SafeStep("switch the amplifiers off", disable, COMMAND_S),
        SafeStep("the controller's own make-safe", own, STOP_S + LAND_S),
    )


def _until(done: Callable[[], bool], clock: Clock) -> None:
    """Wait; the supervisor ends it when the step runs out of time."""
    while not done():
        clock.sleep(0.05)


def _prompt(supervisor: Supervisor) -> Callable[[str], str]:
    """Asks on standard error (standard output belongs to the run directory); a signal ends the waiting at once."""

    def ask(question: str) -> str:
        sys.stderr.write(question)
        sys.stderr.flush()
        with supervisor.interruptible():
            answer = sys.stdin.readline()
        if not answer:
            raise OperatorAbort("standard input is closed: nobody can answer")
        return answer

    return ask
