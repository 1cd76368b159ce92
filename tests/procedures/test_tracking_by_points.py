"""Tracking by set points on the rigs of other laboratories: the arithmetic by hand, and the truth of the same twin."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from odd_rig import odd_rig
from twin_facts import SILENT, true_facts

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.tracking import checks
from procedures.tracking.ellipse import of_points, turns
from procedures.tracking.plan import Plan
from procedures.tracking.points import Points, contour
from procedures.tracking.procedure import check, placed, procedure
from procedures.tracking.steps import Orbit, read_orbits

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = (str(EXAMPLES / name) for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml"))
QUICK = {"revolutions": 6, "settle_s": 1.0}


def test_the_first_harmonic_of_a_staircase_is_that_of_its_steps() -> None:
    """By hand: n steps of a sine have its amplitude times sin(pi/n)/(pi/n), later by half a step; a delay turns it further."""
    n, hz, late = 12, 0.5, 3e-3
    k = np.arange(3 * n)
    points = Points(k / (n * hz), 40e-6 * np.sin(2 * math.pi * k / n), 60e-6 * np.cos(2 * math.pi * k / n))
    y, z = points.harmonic(0.7, 0.7 + 1 / hz, hz, late)
    shrinks, turned = math.sin(math.pi / n) / (math.pi / n), math.pi / n + 2 * math.pi * hz * late
    assert y == pytest.approx(40e-6 * shrinks * -1j * np.exp(-1j * turned), rel=1e-9)
    assert z == pytest.approx(60e-6 * shrinks * np.exp(-1j * turned), rel=1e-9)


def test_a_contour_error_is_across_the_ellipse_whatever_the_place_along_it() -> None:
    """By hand: at its ends, and a larger ellipse of the same kind along the normals."""
    off = contour(np.array([43e-6, 0.0, -38e-6]), np.array([0.0, 58e-6, 0.0]), 40e-6, 60e-6)
    assert off == pytest.approx([3e-6, -2e-6, -2e-6], abs=1e-10)
    turn = np.linspace(0, 6, 50)
    normal = np.array([60 * np.sin(turn), 40 * np.cos(turn)])
    normal /= np.hypot(*normal)
    y, z = np.array([40e-6 * np.sin(turn), 60e-6 * np.cos(turn)]) + 2e-6 * normal
    assert contour(y, z, 40e-6, 60e-6) == pytest.approx(np.full(50, 2e-6), abs=1e-9)


LONG = pytest.mark.long


@pytest.mark.parametrize("path", [STAND, pytest.param(SPINDLE, marks=LONG), pytest.param("odd", marks=LONG)],
                         ids=["stand", "spindle", "odd"])  # fmt: skip
def test_a_shaft_follows_set_points_as_the_same_twin_without_noise(path: str, tmp_path: Path) -> None:
    path = odd_rig(tmp_path) if path == "odd" else path
    run = simulated_run("tracking", path, 1, QUICK, tmp_path / "s.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    silent = simulated_run("tracking", path, 1, QUICK, tmp_path / "t.mcap", SILENT)
    wired_wrong(*read_orbits(run.recording))  # with its noise: readings that stand still look like a sensor at its end
    (orbit,) = read_orbits(silent.recording)
    found = of_points(turns(orbit.path, true_facts(silent.recording.rig, silent.drawn)), orbit.path.wave)
    true = {(quantity.name, where): found[name] for name, quantity, where in placed(orbit, found)}
    told = {(m.quantity.name, m.where): m for m in run.results if isinstance(m, Measured)}
    assert told.keys() == true.keys()
    assert {where.split("as set, 0.5 Hz")[0] for _, where in told} == {"", "y, ", "z, ", "psi, ", "theta, "}
    for place, m in told.items():
        assert m.estimate.value == pytest.approx(true[place], abs=1.7 * interval(m.estimate).U), place
    followed = truth_of_motion(run)
    assert {name for name, _ in told} == {name.partition("@")[0] for name in followed} | {"ring_distance"}
    for (name, where), m in told.items():
        if name != "ring_distance":
            assert followed[f"{name}@{where}"] == pytest.approx(true[name, where], abs=0.5 * interval(m.estimate).U), (
                name
            )


def wired_wrong(orbit: Orbit) -> None:
    """Every probe whose sign is wrong is named by the set points alone, also one that neither weight nor nudges show."""
    for k, name in enumerate(orbit.machine.stations.channels):
        turned = orbit.path.readings.copy()
        turned[k] *= -1
        seen = replace(orbit, path=replace(orbit.path, readings=turned))
        told = [(f.code, f.where) for f in checks.of_signals([seen], Plan())]
        assert told == [("sensor-polarity", name)]
    assert not list(checks.of_signals([orbit], Plan()))


def test_what_set_points_cannot_do_is_told_before_anything_starts() -> None:
    rig = load_rig(STAND)
    assert not [*procedure.problems(rig, Plan()), *procedure.problems(load_rig(SPINDLE), Plan())]
    for plan, said in (
        (Plan(z_m=150e-6), "by rings and set points"),
        (Plan(speed_rad_s=100.0), "a shaft at rest"),
        (Plan(ratio=2), "make an ellipse"),
        (Plan(points=60, points_hz=2.0), "set points in a second"),
        (Plan(laws=("CCS",)), "laws: found CCS"),
    ):
        assert any(said in line for line in check(rig, plan)), said
