"""Runout on a loop that is not the same along the load and across it: what no unbalance reads like; parts that say another."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from benchmarks import drawn_rigs
from procedures.balance import apart, loop
from procedures.balance.estimates import Result, readings
from procedures.synchronous import runout
from procedures.synchronous.runout import Stand, Turning, arms, placed

INCLINE = str(Path(__file__).resolve().parents[1] / "strangers/incline.toml")
W = 800.0
MEANS = np.array([0, 0, 0, 0, 1.2, 0.8, 2.6, 0.3, 1.1, 0.9, 2.9, 0.4])
OFF = np.array([2e-6, -2e-6j, 1e-6 * np.exp(1j), -1e-6j * np.exp(1j)])


def stand(axes: np.ndarray) -> Stand:
    beta = np.array([2e-7, 6e-7, 5e-7, 1.5e-6])
    return Stand(
        beta, np.full(4, 1e-5), np.ones(4), np.zeros(4), np.ones(8), np.zeros(8), np.full(4, 5e-4), 0.0,
        0.98, 5.84e-3, 1.71e-4, 0.097, 0.081, 0.078, 0.1, 0.097, 0.081, 0.155, axes, arms(0.078, 0.1),
    )  # fmt: skip


def stiff(s: Stand, plane: str) -> np.ndarray:
    """A controller by the axes, each with gains of its own; or one that answers each plane's tilt in its own way."""
    if plane == "axes":
        return np.asarray(s.axes.T @ np.diag([9e4 + 40j * W, 1.4e5 + 60j * W, 8e4 + 30j * W, 2e5 + 50j * W]) @ s.axes)
    c = np.zeros((4, 4), complex)
    c[np.ix_([0, 3], [0, 3])] = [[2e5 + 80j * W, 300], [900, 1200 + 0.5j * W]]
    c[np.ix_([1, 2], [1, 2])] = [[3e5 + 90j * W, -200], [500j, 2500 + 0.8j * W]]
    return c


@pytest.mark.parametrize(
    ("axes", "plane"),
    [
        (arms(0.097, 0.081), "axes"),
        (arms(0.097, 0.081), "planes"),
        (placed(np.array([-0.097, -0.097, 0.081, 0.081]), np.radians([10, 90, 20, 100])), "axes"),
    ],
)
def test_the_probes_read_a_runout_as_the_loop_has_it(axes: np.ndarray, plane: str) -> None:
    """Against the loop itself: (D + C) q = F with the probes at A_s q + R."""
    s, t = stand(axes), Turning(W, MEANS, np.zeros(12, complex))
    d, c = runout.impedance(s, runout.slopes(s, MEANS)[2], W, W), stiff(s, plane)
    acts = W**2 * arms(s.l_iu, s.l_ou).T @ runout.waves(s)
    influence = s.probes @ np.linalg.solve(d + c, acts)
    read = s.probes @ np.linalg.solve(d + c, -c @ np.linalg.solve(s.probes, OFF)) + OFF
    as_unbalance = influence @ runout.as_unbalance(s, MEANS, OFF, W)
    assert np.abs(read - as_unbalance).max() > 0.1e-6  # what no unbalance reads like
    assert np.abs(read - as_unbalance - loop.beside_unbalance(s, t, OFF, influence)).max() < 1e-12


@pytest.fixture(scope="module")
def inclined(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, dict[str, float]]:
    """A fan whose rear bearing carries little: K_x from 0.02 to 0.34 N/um by axis. Off the truth in U, by `name@where`."""
    run = simulated_run("balance", INCLINE, 9, {}, tmp_path_factory.mktemp("balance") / "run.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    result = run.procedure.evaluated(run.recording).result
    assert isinstance(result, Result)
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    return result, {
        k: (told[k].value - true) / interval(told[k]).U for k, true in truth_of_motion(run).items() if k in told
    }


def test_unbalance_of_a_shaft_whose_bearings_carry_unlike_loads(inclined: tuple[Result, dict[str, float]]) -> None:
    """Without what the probes read beside an unbalance it was up to 7 U off: .43 g mm told as +-.06."""
    assert len(inclined[1]) == 8
    assert max(map(abs, inclined[1].values())) < 1.2


def test_parts_that_say_another_unbalance_are_told(inclined: tuple[Result, dict[str, float]]) -> None:
    b = inclined[0].balance
    base = b.trials.base
    read, whole = readings(base) / b.gain, b.unbalance[base.name]
    assert not list(apart.parts_apart(b.apart, whole, b.planes))
    blind = dataclasses.replace(b.solved, beside=0 * b.solved.beside)
    wrong = blind.unbalance(read)
    moved = {}
    for name, part in apart.parts_of([r.speed for r in base.reads]).items():
        by = apart.share_of(blind, part) * (apart.said(blind, read, part) - wrong)
        told = np.array([p.told(complex(x)) for p, x in zip(b.planes, by, strict=True)])
        moved[name] = (dataclasses.replace(b.apart[name][0], values=told), b.apart[name][1])
    found = list(apart.parts_apart(moved, dataclasses.replace(whole, values=wrong), b.planes))
    assert {f.code for f in found} == {"unbalances-apart"}
    assert {"probes along y", "readings at 4772 r/min"} <= {f.where for f in found}


def test_bearings_that_are_turned_to_each_other_make_no_parts_apart(tmp_path: Path) -> None:
    """What nobody knows of their stiffness moves the probes along y one way and those along z the other: by the uncertainty of
    the whole they were 3.0 apart on this sound spindle, 2.4 by that of their difference."""
    path = drawn_rigs.write("spindle", 17, tmp_path)
    run = simulated_run("balance", str(path), 1, {}, tmp_path / "run.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
