"""A chain of procedures on one virtual rig through the whole path (bytes of the simulated controller, decode, envelope,
recorder, MCAP, analysis) against the core alone for as much bench time, in one run. Targets: 50 times real time in all,
and at most twice the core's processor time.

    python benchmarks/chain.py
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bench.cli.opening import SIMULATED
from bench.cli.virtual import simulate
from bench.recording import Recording
from bench.rigfile import load_rig
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.machines.tsbs.plant import Plant
from sim_backend.truth import draw

CHAIN: tuple[tuple[str, Mapping[str, Any]], ...] = (("amb-calibration", {"settle_s": 0.5, "average_s": 0.3}),)
"""Procedures in order, each with a short plan."""
RIG, SEED, REPEATS = "tsbs12", 1, 3
REAL_TIME, RATIO = 50.0, 2.0


def whole_chain(folder: Path) -> list[Path]:
    """Run and analyse every procedure; the recordings."""
    paths = [folder / f"{procedure}.mcap" for procedure, _ in CHAIN]
    for path, (procedure, plan) in zip(paths, CHAIN, strict=True):
        path.unlink(missing_ok=True)
        simulate(procedure, RIG, SEED, plan, path)
    return paths


def bench_time(path: Path) -> float:
    """How long a recording is, s."""
    recording: Recording[Any] = Recording.open(path)
    blocks = [(int(b.t_ns[0]), int(b.t_ns[-1])) for b in recording.blocks("telemetry")]
    return (blocks[-1][1] - blocks[0][0]) * 1e-9


def levitated() -> Plant:
    """The same machine, brought up by its controller."""
    rig = load_rig(RIG)
    simulated = SimulatedRig(rig, draw(rig, SEED))
    controller = Controller(rig, simulated.link, simulated, SIMULATED)
    controller.clock.sleep(0.1)
    controller.enable()
    controller.levitate()
    return simulated.device.plant


def core_alone(plant: Plant, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        plant.run(1000)


def timed(work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall and processor seconds of all threads, and the result."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    return time.perf_counter() - wall, time.process_time() - processor, result


def main() -> int:
    """Run and print; 1 when a target is missed."""
    with tempfile.TemporaryDirectory() as folder:
        chains = [timed(lambda: whole_chain(Path(folder))) for _ in range(REPEATS)]
        seconds = sum(bench_time(path) for path in chains[0][2])
    plant = levitated()
    cores = [timed(lambda: core_alone(plant, seconds)) for _ in range(REPEATS)]
    (wall, cpu), (core_wall, core_cpu) = ([min(t[k] for t in times) for k in (0, 1)] for times in (chains, cores))
    print(f"chain  {', '.join(name for name, _ in CHAIN)}: {seconds:.0f} s of bench time")
    print(f"whole  {cpu:.2f} s of processor, {wall:.2f} s of wall time: {seconds / cpu:.0f} times real time "
          f"(target {REAL_TIME:.0f})")  # fmt: skip
    print(
        f"core   {core_cpu:.2f} s of processor, {core_wall:.2f} s of wall time: {seconds / core_cpu:.0f} times real time"
    )
    print(f"ratio  {cpu / core_cpu:.2f} (target at most {RATIO:g})")
    print(json.dumps({"bench_s": seconds, "chain_cpu_s": cpu, "chain_wall_s": wall, "core_cpu_s": core_cpu,
                      "core_wall_s": core_wall, "ratio": cpu / core_cpu, "real_time": seconds / cpu}))  # fmt: skip
    return int(seconds / cpu < REAL_TIME or cpu / core_cpu > RATIO)


if __name__ == "__main__":
    sys.exit(main())
