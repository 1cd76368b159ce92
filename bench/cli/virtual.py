"""One virtual rig through the whole path without the trappings of a run: for campaigns over many seeds, and for tests."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench import catalogue
from bench.adoption import calibration_of
from bench.calibration import Calibration, Need, facts_of, settings_differ
from bench.calibrationfile import attachment
from bench.cli.opening import SIMULATED
from bench.cli.safety import may_touch
from bench.errors import ConfigError
from bench.findings import Finding
from bench.linkhealth import Health
from bench.procedure import Measured, Procedure
from bench.recorder import Recorder, RunHeader
from bench.recording import Recording
from bench.rig import Rig
from bench.rigfile import RigFile, load_rig
from bench.roles import RigState
from bench.states import transition
from drivers.controller import Controller
from drivers.fieldbus import Fieldbus, open_devices
from drivers.operator import LineOperator
from sim_backend.endpoint import SimulatedRig
from sim_backend.registers import Followed, RegisterBank
from sim_backend.truth import Truth, draw

SUBSTEPS = 1
SLICE_S = 0.5  # five times the live bench's: each slice costs a round of Python


@dataclass(frozen=True)
class Simulated:
    """One finished run on one virtual rig: what was drawn, and what `analyse` yields."""

    procedure: Procedure
    recording: Recording[Any]
    seed: int
    drawn: Truth
    results: list[Measured | Finding]

    @property
    def truth(self) -> Mapping[str, float]:
        """The true quantities."""
        return self.drawn.quantities

    def calibration(self) -> Calibration:
        """What `bench adopt` would make of this run; its run id and its date follow from the seed, so that a chain of
        such runs gives the same numbers each time. The file's digest is left out."""
        facts = facts_of(self.procedure, self.recording, self.results)
        run_id = f"{self.procedure.name}-sim-{self.seed}"
        return calibration_of(self.procedure, self.recording, facts, run_id=run_id)


def simulate(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
) -> tuple[Mapping[str, float], list[Measured | Finding]]:
    """Draw a rig, run a procedure on it into `path`, analyse the closed file.

    Returns:
        The true quantities, and what `analyse` yields.
    """
    done = simulated_run(procedure, rig, seed, plan, path, truth, calibrations)
    return done.truth, done.results


def simulated_run(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
) -> Simulated:
    """As `simulate`; the result can also be adopted. `calibrations` are by procedure; those that are needed are used.

    Raises:
        ConfigError: one that is needed is not given, or was made at other settings.
    """
    chosen: Procedure = importlib.import_module(catalogue.entry(procedure).module).procedure
    file = load_rig(rig)
    settings = chosen.plan.model_validate({**file.plans.get(procedure, {}), **plan})
    used = given(chosen.needs(settings), calibrations or {})
    drawn = draw(file, seed, truth, chosen.settings(settings))
    simulated = SimulatedRig(file, drawn, substeps=SUBSTEPS)
    bank = None if drawn.machine.turns else RegisterBank(file, drawn, simulated.device.plant)
    base = simulated if bank is None else Followed(simulated, bank)
    controller = Controller(file, simulated.link, base, SIMULATED, SLICE_S)
    operator = LineOperator(simulated.request, controller.clock, controller.envelope)
    counters = controller.telemetry.counters
    header = RunHeader(
        {"run": {"procedure": procedure, "seed": str(seed), "backend": "sim"}, "versions": {}},
        {
            "rig.toml": file.toml_text.encode(),
            "rig.dbc": file.dbc_text.encode(),
            "plan.json": settings.model_dump_json().encode(),
            "calibrations.json": attachment(used).encode(),
        },
    )
    with (
        _driven(file, drawn, controller, bank) as bus,
        Recorder(path, clock=controller.clock, streams=[controller.telemetry.layout, *(bus.layouts if bus else ())],
                 header=header, plain=True) as recorder,
    ):  # fmt: skip
        live = Rig(file, controller.clock, controller, controller, operator, counters,
                   lambda: Health(counters, simulated.link.stats, None, 0), simulated.link.close,
                   bus.drive if bus else None, capture=controller.capture)  # fmt: skip
        controller.recorder = operator.recorder = recorder
        operator.may_touch = may_touch(controller, bus.drive if bus else None)
        if bus is not None:
            bus.recorder = recorder
        controller.clock.sleep(0.1)
        transition(live, RigState.READY)
        for name, value in chosen.settings(settings).items():
            controller.set(name, value)
        transition(live, chosen.state)
        chosen.acquire(live, settings, recorder)
        transition(live, RigState.OFF)
    recording: Recording[Any] = Recording.open(path, chosen.plan)
    return Simulated(chosen, recording, seed, drawn, list(chosen.analyse(recording)))


@contextmanager
def _driven(
    file: RigFile, drawn: Truth, controller: Controller, bank: RegisterBank | None
) -> Iterator[Fieldbus | None]:
    """The register devices, where the controller cannot turn its shaft by itself; they cost time, and others need none."""
    if bank is None:
        yield None
        return
    controller.clock.sleep(0.1)
    with open_devices(file, bank.port, controller.clock, controller.envelope) as bus:
        controller.companions.append(bus.pump)
        if bus.drive is not None:
            bus.drive.may_run = controller.require_levitated
        yield bus


def given(needs: Sequence[Need], calibrations: Mapping[str, Calibration]) -> list[Calibration]:
    """The calibrations that a run needs, out of those at hand.

    Raises:
        ConfigError: one is missing, or was made at other settings.
    """
    for need in needs:
        if need.procedure not in calibrations:
            if need.optional:
                continue
            raise ConfigError(f"calibrations: found no {need.procedure}; expected one among `calibrations`")
        differ = settings_differ(calibrations[need.procedure].settings, need.settings)
        if differ:
            raise ConfigError(f"calibration {need.procedure}: {'; '.join(differ)}")
    return [calibrations[need.procedure] for need in needs if need.procedure in calibrations]
