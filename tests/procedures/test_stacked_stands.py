"""The balance of forces of a stack of stands is that of each of them: oracles are one stand at a time, and least squares of
numpy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import load_rig
from procedures.amb_rotor.stations import row
from procedures.balance.solution import solve
from procedures.synchronous import bearings, identified, runout
from procedures.synchronous.runout import Stand, Turning

SPINDLE = str(Path(__file__).resolve().parents[2] / "examples/vertical-spindle/spindle.toml")
COUNT = 5
RNG = np.random.default_rng(16)
MEANS = np.concatenate([RNG.normal(0, 1e-6, 4), RNG.uniform(1.5, 2.5, 8)])


def vectors() -> np.ndarray:
    z = RNG.normal(size=12) + 1j * RNG.normal(size=12)
    return z * np.array([2e-6] * 4 + [0.1] * 8)


SLOW = {n: Turning(30.0, MEANS, vectors()) for n in (1.0, 2.0)}
FAST = Turning(900.0, MEANS, vectors(), {2.0: vectors()})
TRIALS = [
    (u, [Turning(900.0, MEANS, vectors())], [Turning(900.0, MEANS, vectors())]) for u in (2e-6 + 0j, 1e-6 + 1e-6j)
]


def several(rig: str) -> dict[str, np.ndarray]:
    """What the rig file says of the stand, moved by some hundredths, (COUNT,) each; one of them turns the other way."""
    rng = np.random.default_rng(5)
    known = bearings.collect_inputs(load_rig(rig), bearings.Known(None, 0.05, 1e-5))
    moved = {n: e.value * (1 + 0.02 * rng.normal(size=COUNT)) + 0.1 * e.u for n, e in known.items()}
    hands = np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    betas = {f"beta_{k}": 4e-7 * (1 + 0.1 * rng.normal(size=COUNT)) for k in range(4)}
    return moved | betas | {"hand": hands}


ASKED: dict[str, Callable[[Stand], object]] = {
    "stand": lambda s: [getattr(s, f.name) for f in fields(s)],
    "slopes": lambda s: runout.slopes(s, MEANS),
    "mean forces": lambda s: [runout.mean_forces(s, MEANS)],
    "left over": lambda s: runout.left_over(s, FAST, np.full(4, 1e-6 + 2e-6j)),
    "unbalances": lambda s: runout.unbalances(s, FAST, np.zeros(4, complex)),
    "as unbalance": lambda s: [runout.as_unbalance(s, MEANS, np.full(4, 1e-6 + 2e-6j), 900.0)],
    "runout": lambda s: list(runout.find_runout(s, SLOW, FAST).runout.values()),
    "beyond slopes": lambda s: list(runout.mixed_forces(s, SLOW, {1.0: FAST, 2.0: FAST}).slow.values()),
    "influences": lambda s: [
        getattr(solve(s, SLOW[1.0], TRIALS, TRIALS[0][1]), n)
        for n in ("influence", "placed", "mark", "runout", "taken")
    ],
}


@pytest.mark.parametrize("rig", [SPINDLE, "amb5dof"])
@pytest.mark.parametrize("asked", ASKED)
def test_a_stack_of_stands_gives_what_each_gives(rig: str, asked: str) -> None:
    v = several(rig)
    together = ASKED[asked](Stand.of(v))
    for k in range(COUNT):
        alone = ASKED[asked](Stand.of({n: float(x[k]) for n, x in v.items()}))
        for a, b in zip(together, alone, strict=True):  # type: ignore[call-overload]
            assert np.shape(a)[1:] == np.shape(b)
            assert np.abs(a[k] - b).max() <= 1e-10 * np.abs(b).max()


def test_rows_of_places_are_those_of_the_stations() -> None:
    at, turn = np.array([-0.11, 0.0, 0.09, 0.2]), np.array([0.0, math.pi / 2, math.radians(30), -math.pi])
    expected = np.array([row(float(a), float(t)) for a, t in zip(at, turn, strict=True)])
    assert np.array_equal(runout.placed(at, turn)[:2], expected[:2])  # no rounding of a right angle is left
    assert runout.placed(at, turn) == pytest.approx(expected, rel=1e-15)


def test_speeds_go_with_stands() -> None:
    v = several("amb5dof")
    w, wide = np.array([30.0, 400.0, 1000.0]), Stand.of({n: x[:, None] for n, x in v.items()})
    together = runout.impedance(wide, np.full(4, 1e5), w, w)
    assert together.shape == (COUNT, 3, 4, 4)
    s = Stand.of({n: float(x[2]) for n, x in v.items()})
    assert together[2, 1] == pytest.approx(runout.impedance(s, np.full(4, 1e5), 400.0, 400.0), rel=1e-12)


def test_least_squares_of_a_stack_say_nan_where_columns_make_up_another() -> None:
    rng = np.random.default_rng(7)
    design, target = rng.normal(size=(3, 9, 4)) * np.array([1.0, 1e-3, 10.0, 1.0]), rng.normal(size=(3, 9))
    design[1, :, 3] = design[1, :, 0] - 2e3 * design[1, :, 1]
    terms, left = identified._least_squares(design, target)
    assert np.isnan(terms[1]).all()
    assert np.isnan(left[1])
    for k in (0, 2):
        expected, squares, *_ = np.linalg.lstsq(design[k], target[k], rcond=None)
        assert terms[k] == pytest.approx(expected, rel=1e-9)
        assert left[k] == pytest.approx(math.sqrt(squares[0]), rel=1e-9)
    design[0, :, 2] = 0.0
    assert np.isnan(identified._least_squares(design, target)[1][0])
