"""Delays of position sensors: the bare fit on made phasors, the drawn machine's through the whole path, refusals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.sensor_delay import checks, estimates, fit
from procedures.sensor_delay.plan import Plan
from procedures.sensor_delay.procedure import check, procedure
from procedures.sensor_delay.sines import crossover_hz, probes, sines
from procedures.sensor_delay.steps import Taken

RIG = load_rig("lira")
PLAN = Plan()
DELAYS = np.array([0.0, 5e-6, 10e-6, 20e-6])
COUPLED = np.array([[1, 0.1, 0.05, 0], [0.08, 1.1, 0, -0.04], [-0.05, 0, 0.9, 0.12], [0, 0.03, 0.1, 1]])
"""Planes that share a shaft, and a field that is turned by 3 degrees: real, whatever they are."""
COUNTS, NOISE = 17_500, 0.3e-6


def taken(delays: np.ndarray = DELAYS, noise: float = NOISE, seed: int = 0, damped: float = 0.0) -> list[Taken]:
    """Every sine of the plan into loops that answer with currents of their own phases, worked out without the fit."""
    rng, out = np.random.default_rng(seed), []
    for loop_number, probe in enumerate(probes(RIG)):
        for number, one in enumerate(sines(RIG, PLAN, probe.loop)):
            w = 2 * math.pi * one.hz
            currents = np.full(4, 0.1 * np.exp(0.5j)) + 2.0 * np.exp(-1j * number) * np.eye(4)[loop_number]
            answer = -COUPLED * 3.7 / (0.67 * (w**2 + 748.0**2 + 1j * w * damped))
            position = np.exp(-1j * w * delays) * (answer @ currents)
            turn = np.exp(2j * np.pi * one.periods * np.arange(one.samples) / one.samples)
            x, i = ((p[:, None] * turn).real for p in (position, currents))
            x = x + noise * rng.normal(size=x.shape)
            states = ("LEVITATED",)
            out.append(Taken(probe.loop, number, one.hz, one.periods, x, i, 1.0, 0.0, states, 0, 100))
    return out


def told(some: list[Taken], plan: Plan = PLAN) -> set[str]:
    found = [*checks.of_signals(some, RIG, plan)]
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_results(estimates.results(some, RIG, plan), RIG, plan)
    return {f.code for f in found if f.effect is not Effect.NOTE}


def test_the_bare_fit() -> None:
    """Each probe its own delay, however planes and directions are coupled."""
    found = [r.delay.seconds for r in estimates.results(taken(noise=1e-12), RIG, PLAN)]
    assert found == pytest.approx(DELAYS, abs=1e-10)


def test_its_uncertainty_is_that_of_the_noise() -> None:
    off = []
    for seed in range(12):
        off += [
            (r.delay.seconds - t) / r.delay.u
            for r, t in zip(estimates.results(taken(seed=seed), RIG, PLAN), DELAYS, strict=True)
        ]
    assert np.std(off) == pytest.approx(1, abs=0.25)
    assert abs(np.mean(off)) < 0.45


def test_one_current_alone_is_not_enough() -> None:
    """By its own current alone a probe is as late as what couples into it makes it."""
    some = [t for t in taken(noise=1e-12) if t.line == 2 and t.loop == probes(RIG)[0].loop]
    one = fit.line(some[0].hz, [some[0].positions[:1]], [some[0].currents[:1]], some[0].periods)
    assert abs(one.phase[0] / (2 * math.pi * some[0].hz)) > 1e-6


def test_what_findings_need() -> None:
    sound = taken()
    assert told(sound) == set()
    assert told([]) == {"no-sines"}
    assert told([replace(sound[0], positions=np.empty((4, 0))), *sound[1:]]) == {"sine-not-captured"}
    assert told([replace(sound[0], states=("LANDING",)), *sound[1:]]) == {"not-levitated"}
    assert told([replace(sound[0], lost=50), *sound[1:]]) == {"missing-samples"}
    assert told([replace(sound[0], wave=0.5), *sound[1:]]) == {"sine-wrong"}
    assert told(sound[:3]) == {"lines-missing"}
    assert told(taken(noise=5e-6)) == {"delay-not-told"}
    assert told(taken(delays=np.array([-1e-5, 0.0, 0.0, 0.0]))) == {"position-early"}
    assert told(taken(damped=40.0)) == {"misfit"}
    alike = [replace(t, currents=t.currents[:1] * np.ones((4, 1))) for t in sound]
    assert "currents-alike" in told(alike)


def test_what_a_delay_costs() -> None:
    """k_D/M = 2550/0.67 rad/s is 606 Hz without spring and integrator; 360 * 583 * 10 us = 2.1 degrees."""
    at = crossover_hz(RIG, "x1")
    assert at == pytest.approx(583, abs=2)
    s = 2j * math.pi * at
    assert abs((680e3 + 10.2e6 / s + 2550 * s) / (0.67 * s * s - 375e3)) == pytest.approx(1, abs=2e-3)
    said = {f.where: f.text for f in checks.of_results(estimates.results(taken(noise=1e-12), RIG, PLAN), RIG, PLAN)}
    assert said[probes(RIG)[2].channel].startswith("2.10°")


def run(folder: Path, truth: Mapping[str, float], seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("sensor-delay", "lira", seed, plan, folder / "recording.mcap", truth)


def off(done: Simulated) -> dict[str, float]:
    """Errors in U."""
    out, true = {}, truth_of_motion(done)
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            out[f"{r.quantity.name}@{r.where}"] = (r.estimate.value - true[f"{r.quantity.name}@{r.where}"]) / (
                (i.high - i.low) / 2
            )
    return out


def test_the_machine(tmp_path: Path) -> None:
    done = run(tmp_path, {"reduced": 1.0, "filter_delay": 2e-5}, lines=3, record_s=0.3)
    assert {r.code for r in done.results if isinstance(r, Finding)} == {"margin-cost"}
    assert set(off(done)) == {f"delay@{name}" for name in ("x1", "x2", "y1", "y2")}
    assert all(abs(x) < 2 for x in off(done).values()), off(done)
    assert figures_drawn(done)


@pytest.mark.long
def test_with_all_electronics_and_a_field_that_is_turned(tmp_path: Path) -> None:
    """10 degrees electrical: a current along x pushes along y, too."""
    done = run(tmp_path, {"zero_off_ra": math.radians(10)}, seed=2)
    assert {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE} == set()
    assert all(abs(x) < 2 for x in off(done).values()), off(done)


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, PLAN)) == []
    assert "observer" in next(iter(check(RIG, Plan(observer="other"))))
    assert "high_hz" in next(iter(check(RIG, Plan(high_hz=12e3))))
    assert "high_hz" in next(iter(check(RIG, Plan(high_hz=200.0))))
    can = RIG.capabilities.loop_injection
    assert can is not None
    deaf = can.model_copy(update={"places": {"sensor": 0.0}})
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"loop_injection": deaf})})
    assert procedure.lacking(bare) == ("capabilities.loop_injection.places: found no force",)
