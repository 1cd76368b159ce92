"""Coverage of S_max and its frequency by procedure `sensitivity` over virtual rigs: the share of 95 % intervals that hold the
true peak.

python benchmarks/sensitivity_coverage.py --first 3000 --count 100 --law CCS [--rpm 10000] [--whole]

By a light path, passes and estimator of the procedure on the plant itself; `--whole`: the procedure with its links and its
recording, some five times slower.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.responses import Response
from bench.cli.virtual import simulated_run
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import coverage_factor, interval
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.sensitivity import estimates
from procedures.sensitivity.injection import Comb, parameters_of
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.procedure import MARGIN_S, refinements, surveys
from procedures.sensitivity.steps import REFINED, WIRING, Grid, Taken, captured_channels, sensitivity
from sim_backend.machines.amb5dof import truth_sensitivity
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.machines.amb5dof.plant import TRACE, AmbPlant
from sim_backend.machines.amb5dof.truth_step import floating
from sim_backend.truth import draw

RIG = "amb5dof"
PLAN: dict[str, Any] = {"modes_hz": (), "refined_periods": 4, "start_s": 0.3}
Row = tuple[float, float, float, float]
"""Error, half width, standard uncertainty and true value."""
Found = Iterator[tuple[str, str, float, float, float]]  # axis, quantity, value, half width, standard uncertainty
AMB_ROTOR = conventions(load_rig("amb5dof"))
INJECTION = load_rig("amb5dof").capabilities.injection


def light(p: AmbParams, settings: Mapping[str, float], plan: Plan, seed: int) -> Found:
    """Of each axis the peak, by the passes on a plant with noise."""
    plant = floating(p, settings, plan.speeds_rad_s[0], noise=seed)
    for axis in plan.axes:
        combs = surveys(plan, plan.speeds_rad_s[0])
        seen = [_taken(plant, plan, axis, kind, 0.0, comb) for kind, _, comb in combs if kind != WIRING]
        refined = [
            _taken(plant, plan, axis, kind, about, comb)
            for c in estimates.candidates([t.response for t in seen])
            for kind, about, comb in refinements(plan, c, plan.speeds_rad_s[0])
            if kind == REFINED
        ]
        best = max(estimates.found_peaks(refined), key=lambda peak: peak.top.value)
        k = coverage_factor(best.taken.dof)
        yield axis, "s_max", best.top.value, k * best.top.u, best.top.u
        yield axis, "s_max_hz", best.top.at, k * best.top.u_at, best.top.u_at


def _taken(plant: AmbPlant, plan: Plan, axis: str, kind: str, about: float, comb: Comb) -> Taken:
    speed = plan.speeds_rad_s[0]
    for name, value in {**parameters_of(INJECTION, comb), "inject_axis": float(AMB_ROTOR.all_axes.index(axis))}.items():
        plant.set(name, value)
    plant.run(round(plan.start_s * 1e4))
    pulses = MARGIN_S + 4 * math.pi / speed if speed else 0.0
    periods = plan.refined_periods if kind == REFINED else plan.periods
    start, trace = plant.tick, plant.run(round((comb.period_s * periods + pulses) * 1e4), 1)[1]
    plant.set("inject_axis", -1.0)
    names = captured_channels(AMB_ROTOR, REFINED, speed)
    columns = {n: trace[:, TRACE.index(n)] for n in names}
    grid = Grid(np.array(comb.hz), comb.period_s, comb.amplitude)
    response: Response
    response, injected, excluded = sensitivity(
        columns, (start + np.arange(len(trace))) * 1e-4, 1e4, grid, ("pulses", "pulse_age")
    )
    return Taken(axis, speed, 0.0, kind, about, grid, response, excluded, injected, 0.0, 0.0, None, 1e4, 0, 0, 0, 1,
                 AMB_ROTOR)  # fmt: skip


def whole(seed: int, plan: dict[str, Any], folder: Path) -> Found:
    """The same by the procedure."""
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    for m in simulated_run("sensitivity", RIG, seed, plan, path).results:
        if isinstance(m, Measured) and m.quantity.name in ("s_max", "s_max_hz"):
            i = interval(m.estimate)
            yield m.where.split(",")[0], m.quantity.name, m.estimate.value, (i.high - i.low) / 2, m.estimate.u


def one(seed: int, plan: dict[str, Any], folder: Path | None) -> Iterator[tuple[str, Row]]:
    """A rig's axes."""
    rig, made = load_rig(RIG), Plan(**plan)
    plant, speed = draw(rig, seed).plant, made.speeds_rad_s[0]
    settings = {**{n: p.default for n, p in rig.parameters.items()}, **AMB_ROTOR.select(made.law)}
    loop = None if speed else truth_sensitivity.loop(plant, settings)
    known: dict[str, tuple[float, float]] = {}
    for name, quantity, value, half, u in (
        light(plant, settings, made, seed) if folder is None else whole(seed, plan, folder)
    ):
        axis = AMB_ROTOR.all_axes.index(name)
        if name not in known:
            known[name] = (
                loop.peak(axis, made.low_hz, made.high_hz)
                if loop is not None
                else truth_sensitivity.quiet_peak(plant, settings, axis, speed)
            )
        true = known[name][quantity == "s_max_hz"]
        yield quantity, (value - true, half, u, true)


def main() -> None:
    """Print coverage, width and bias."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=3000)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--law", default="PID", choices=["PID", "CCS"])
    parser.add_argument("--axes", default="yi,zo")
    parser.add_argument("--rpm", type=float, default=0.0)
    parser.add_argument("--whole", action="store_true")
    chosen = parser.parse_args()
    plan = {**PLAN, "law": chosen.law, "axes": tuple(chosen.axes.split(",")), "speeds_rad_s": (chosen.rpm / RPM,)}
    found: dict[str, list[Row]] = {"s_max": [], "s_max_hz": []}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.count):
            for quantity, row in one(seed, plan, Path(folder) if chosen.whole else None):
                found[quantity].append(row)
    for quantity, rows in found.items():
        error, half, u, true = np.array(rows).T
        held = (np.abs(error) <= half).mean()
        width = 1 / np.quantile(np.abs(error) / half, 0.95)
        print(f"{quantity}, {chosen.law} {chosen.axes} {chosen.rpm:g} r/min: {held:.3f} of {error.size} hold the truth, "
              f"{true.min():.2f} to {true.max():.2f}; 1/p95(|e|/U) {width:.2f}; U {np.median(half / true):.2%}; "
              f"e/u rms {np.sqrt(np.mean((error / u) ** 2)):.2f}, mean {np.mean(error / u):+.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
