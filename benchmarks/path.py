"""The whole path against the core alone: 30 channels at 1 kHz for 60 s of bench time, frames, decode, raw and decoded
recording with its 100 Hz view, to disk, closing included. Target: at most 3 times the wall time of the core.

    python benchmarks/path.py
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

from bench.cli.opening import SIMULATED
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import load_rig
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

SECONDS, REPEATS = 60.0, 3


def core_alone() -> float:
    """Wall time of the core for the same machine, levitated, in the same run."""
    rig = load_rig("tsbs12")
    simulated, controller = open_rig(rig)
    levitate(controller)
    plant = simulated.device.plant
    begun = time.perf_counter()
    for _ in range(round(SECONDS / 0.1)):
        plant.run(1000)
    return time.perf_counter() - begun


def whole_path(folder: Path) -> float:
    rig = load_rig("tsbs12")
    _, controller = open_rig(rig)
    levitate(controller)
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    begun = time.perf_counter()
    header = RunHeader({"run": {}}, {})
    with Recorder(path, clock=controller.clock, streams=[controller.telemetry.layout], header=header) as recorder:
        controller.recorder = recorder
        controller.clock.sleep(SECONDS)
        controller.recorder = None
    return time.perf_counter() - begun


def open_rig(rig: object) -> tuple[SimulatedRig, Controller]:
    simulated = SimulatedRig(rig, draw(rig, 1))  # type: ignore[arg-type]
    return simulated, Controller(rig, simulated.link, simulated, SIMULATED)  # type: ignore[arg-type]


def levitate(controller: Controller) -> None:
    controller.clock.sleep(0.1)
    controller.enable()
    controller.levitate()


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        pairs = [(core_alone(), whole_path(Path(folder))) for _ in range(REPEATS)]
    core, path = (min(p[k] for p in pairs) for k in (0, 1))
    print(f"core alone  {core:.2f} s for {SECONDS:.0f} s: {SECONDS / core:.0f} times real time (target 100)")
    print(f"whole path  {path:.2f} s: {path / core:.2f} times the core (target at most 3)")
    print(json.dumps({"core_s": core, "path_s": path, "ratio": path / core, "core_real_time": SECONDS / core}))


if __name__ == "__main__":
    main()
