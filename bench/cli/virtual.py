"""One virtual rig through the whole path without the trappings of a run: for campaigns over many seeds, and for tests."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench import catalogue
from bench.cli.opening import SIMULATED
from bench.findings import Finding
from bench.linkhealth import Health
from bench.procedure import Measured, Procedure
from bench.recorder import Recorder, RunHeader
from bench.recording import Recording
from bench.rig import Rig
from bench.rigfile import load_rig
from bench.roles import RigState
from bench.states import transition
from drivers.controller import Controller
from drivers.operator import LineOperator
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw


def simulate(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
) -> tuple[Mapping[str, float], list[Measured | Finding]]:
    """Draw a rig, run a procedure on it into `path`, analyse the closed file.

    Returns:
        The true quantities, and what `analyse` yields.
    """
    chosen: Procedure = importlib.import_module(catalogue.entry(procedure).module).procedure
    file = load_rig(rig)
    settings = chosen.plan.model_validate({**file.plans.get(procedure, {}), **plan})
    drawn = draw(file, seed, truth, chosen.settings(settings))
    simulated = SimulatedRig(file, drawn)
    controller = Controller(file, simulated.link, simulated, SIMULATED)
    operator = LineOperator(simulated.request, controller.clock, controller.envelope)
    counters = controller.telemetry.counters
    live = Rig(file, controller.clock, controller, controller, operator, counters,
               lambda: Health(counters, simulated.link.stats, None, 0), simulated.link.close)  # fmt: skip
    header = RunHeader(
        {"run": {"procedure": procedure, "seed": str(seed)}, "versions": {}},
        {
            "rig.toml": file.toml_text.encode(),
            "rig.dbc": file.dbc_text.encode(),
            "plan.json": settings.model_dump_json().encode(),
        },
    )
    layout = controller.telemetry.layout
    with Recorder(path, clock=controller.clock, streams=[layout], header=header) as recorder:
        controller.recorder = operator.recorder = recorder
        controller.clock.sleep(0.1)
        transition(live, RigState.READY)
        for name, value in chosen.settings(settings).items():
            controller.set(name, value)
        transition(live, chosen.state)
        chosen.acquire(live, settings, recorder)
        transition(live, RigState.OFF)
    return drawn.quantities, list(chosen.analyse(Recording.open(path, chosen.plan)))
