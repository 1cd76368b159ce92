"""The vertical spindle turned: unbalance, passages, balance and spindown by edges, without captures, against its truth."""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import Estimate
from procedures.balance.planes import planes_of
from procedures.synchronous.dwells import Dwell, read_dwells

pytestmark = pytest.mark.long
SPINDLE = str(Path(__file__).resolve().parent.parent / "examples/vertical-spindle/spindle.toml")
SHORT = {"slow_s": 5.0, "settle_s": 1.0, "dwell_s": 1.0}
COAST = {"speed_rad_s": 1000.0, "end_speed_rad_s": 300.0, "coast_s": 30.0, "repeats": 2}


def told(run: Simulated) -> dict[tuple[str, str], Estimate]:
    return {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}


def wrong(run: Simulated) -> set[str]:
    return {f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}


def vectors(run: Simulated, dwell: Dwell) -> np.ndarray:
    """(4,) m: readings freed of what only the simulator knows, gain and runout of order 1 from the mark."""
    p: Any = run.drawn.plant
    runout = np.array([(p.runout_c[k] - 1j * p.runout_s[k]) * cmath.exp(-1j * p.pulse_angle) for k in range(4)])
    return np.asarray(dwell.readings().values / np.array(p.position_gain[:4]) - runout)


def test_vectors_are_those_of_the_shaft_whose_bearings_nobody_knows(tmp_path: Path) -> None:
    """Axes at 30 and 120 degrees, probes off the bearings, no capture, no model in the controller."""
    run = simulated_run("unbalance", SPINDLE, 1, {**SHORT, "repeat": False}, tmp_path / "a.mcap")
    assert not wrong(run)
    notes = {f.code for f in run.results if isinstance(f, Finding)}
    assert {"telemetry-alone", "bearings", "slow-roll"} <= notes
    found, off = told(run), []
    assert not any(name in ("current_peak", "voltage_peak") for name, _ in found)
    for dwell in read_dwells(run.recording):
        for k, axis in enumerate(dwell.machine.axes if dwell.kind == "dwell" else ()):
            true = vectors(run, dwell)[k]
            for name, value in (("vector_cos", true.real), ("vector_sin", -true.imag)):
                e = found[name, f"{axis}, {dwell.where}"]
                assert e.u < 0.06e-6
                off.append((e.value - value) / (2 * e.u))
    assert len(off) == 32
    assert max(map(abs, off)) < 1.5


@pytest.mark.parametrize("name", ["run-up", "coast-down"])
def test_a_passage_says_what_the_dwells_say(tmp_path: Path, name: str) -> None:
    ramp = {"acceleration_rad_s2": 45.0} if name == "run-up" else {"deceleration_rad_s2": 45.0}
    speeds = (4000 * math.pi / 30, 7000 * math.pi / 30, 10000 * math.pi / 30)
    plan = {"slow_s": 5.0, "settle_s": 1.0, "blocks": 60, "speeds_rad_s": speeds, **ramp}
    passed = simulated_run(name, SPINDLE, 1, plan, tmp_path / "a.mcap")
    still = simulated_run("unbalance", SPINDLE, 1, {**SHORT, "repeat": False}, tmp_path / "b.mcap")
    assert not wrong(passed)
    way = name.partition("-")[2] if name == "run-up" else "down"
    moving, at_rest = told(passed), told(still)
    for speed in ("4000", "7000", "10000"):
        for axis in ("LowU", "LowV", "UppU", "UppV"):
            for part in ("vector_cos", "vector_sin"):
                a, b = moving[part, f"{axis}, {speed} r/min, {way}"], at_rest[part, f"{axis}, {speed} r/min, off"]
                assert a.value == pytest.approx(b.value, abs=0.03e-6)


def test_it_is_balanced_on_the_scales_that_the_operator_reads(tmp_path: Path) -> None:
    """Scales that run backwards from elsewhere than the mark: weights where the sheet says leave a fifth of what was there."""
    run = simulated_run("balance", SPINDLE, 1, {**SHORT, "corrections": 1}, tmp_path / "a.mcap")
    assert not wrong(run)
    found = told(run)
    for plane in planes_of(run.recording.rig):
        zero = run.drawn.values[f"balancing.{plane.name}.zero"]
        there = cmath.rect(run.truth[f"unbalance@{plane.name}"], run.truth[f"unbalance_phase@{plane.name}"])
        true = plane.told(there, zero)
        for name, value in (("unbalance_cos", true.real), ("unbalance_sin", true.imag)):
            e = found[name, plane.name]
            assert abs(e.value - value) < 3 * e.u < 0.35e-6
        left = [p.value for key, p in found.items() if key[0].startswith("residual_") and key[1] == plane.name][:2]
        assert math.hypot(*left) < 0.2 * abs(there)


@pytest.mark.parametrize(
    ("truth", "code"),
    [
        ({"weight_turned": 1, "weight_turned_rad": 0.5}, "weight-angle"),
        ({"weight_lost": 1}, "trial-moved-nothing"),
        ({"weight_astray": 1}, "weight-in-other-plane"),
    ],
)
def test_a_weight_that_is_not_where_it_should_be_is_found(tmp_path: Path, truth: dict[str, float], code: str) -> None:
    run = simulated_run("balance", SPINDLE, 3, {**SHORT, "corrections": 1}, tmp_path / "a.mcap", truth)
    assert code in wrong(run)
    assert not told(run)


def test_a_missing_edge_is_told_and_no_phase_stated(tmp_path: Path) -> None:
    plan = {**SHORT, "repeat": False}
    run = simulated_run("unbalance", SPINDLE, 3, plan, tmp_path / "a.mcap", {"pulse_missing": 7})
    assert "pulse-missing" in wrong(run)
    assert not told(run)


@pytest.mark.parametrize("rig", [SPINDLE, "amb5dof"], ids=["spindle", "amb5dof"])
def test_a_drive_lets_go_and_the_shaft_coasts_down(tmp_path: Path, rig: str) -> None:
    run = simulated_run("spindown", rig, 1, COAST, tmp_path / "a.mcap")
    assert not wrong(run)
    found, p = told(run), run.drawn.plant
    true: dict[str, float] = {"B": p.viscous, "T_c": p.coulomb, "J_z": p.polar_inertia}  # type: ignore[attr-defined]
    assert {name for name, _ in found} == set(true)
    for name, value in true.items():
        assert abs(found[name, ""].value - value) < 2.5 * found[name, ""].u < 0.03 * value
