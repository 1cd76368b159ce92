"""Balancing against the rigid rotor whose response ROSS confirmed, and against what ISO 21940-11 works out."""

from __future__ import annotations

import numpy as np
import pytest

from bench.analysis.balance import G_MM, Trial, allocated, bound, correct, permissible, reached, split
from bench.analysis.vectors import Vectors, contains
from bench.errors import AnalysisError

MASS, IT, IP, A, K, C = 9.513495, 0.0684072, 0.0137230, 0.12, 2e6, 800.0
"""Rigid rotor on two bearings, a m from its centre of mass; kg, kg m2, N/m, N s/m per bearing."""


def response(speed: float, unbalance: complex, at: float, to: float) -> complex:
    """Of a forward whirl at `to` m from the centre of mass to an unbalance at `at` m."""
    bearing = K + 1j * C * speed
    force = unbalance * speed**2
    shift = force / (2 * bearing - MASS * speed**2)
    tilt = force * at / (2 * A**2 * bearing - (IT - IP) * speed**2)
    return shift + to * tilt


def test_the_oracle_is_ross() -> None:
    """Unbalance of 1e-5 kg m at node 9 (0.09 m), seen at node 10 (0.12 m); values of ROSS 2.3.0."""
    for speed, size, degrees in ((1281.1558, 5.28747e-6, -145.5889), (788.693, 2.90586e-6, -99.4301)):
        z = response(speed, 1e-5, 0.09, 0.12)
        assert abs(z) == pytest.approx(size, rel=5e-6)
        assert np.degrees(np.angle(z)) == pytest.approx(degrees, abs=1e-3)


PROBES, PLANES, SPEED = (-0.11, 0.11), (-0.07, 0.09), 900.0


def run(unbalance: np.ndarray, rng: np.random.Generator, u: float) -> Vectors:
    """What both probes read, with scatter u m in each part."""
    z = np.array([sum(response(SPEED, w, at, to) for w, at in zip(unbalance, PLANES, strict=True)) for to in PROBES])
    noise = rng.normal(0, u, 4).view(np.complex128)
    return Vectors(z + noise, (u**2 + 1e-30) * np.eye(4), 14)


def balanced(seed: int, u: float) -> tuple[np.ndarray, Vectors, list[Trial], np.random.Generator]:
    rng = np.random.default_rng(seed)
    there = (rng.normal(0, 2e-5, 2) + 1j * rng.normal(0, 2e-5, 2)).astype(np.complex128)
    start = run(there, rng, u)
    trials = []
    for plane in (0, 1):
        trial = 2e-5 * np.exp(1j * rng.uniform(0, 6.28))
        with_it = there.copy()
        with_it[plane] += trial * (1 + rng.normal(0, 0.005)) * np.exp(1j * rng.normal(0, 0.01))
        trials.append(Trial(plane, complex(trial), run(with_it, rng, u), 0.005, 0.01))
    return there, start, trials, rng


def test_without_scatter_the_correction_is_the_unbalance_negated() -> None:
    rng = np.random.default_rng(1)
    there = np.array([2e-5 + 1e-5j, -1.5e-5j])
    trials = [Trial(k, 1e-5 + 0j, run(there + 1e-5 * np.eye(2)[k], rng, 0.0)) for k in (1, 0)]
    found = correct(run(there, rng, 0.0), trials)
    assert np.allclose(found.weights.values, -there, rtol=1e-6)
    assert np.abs(found.residual.values).max() < 1e-12
    assert found.influence[0, 1] == pytest.approx(response(SPEED, 1.0, PLANES[1], PROBES[0]), rel=1e-6)


def test_regions_of_the_found_unbalance_hold_the_truth() -> None:
    """95 % of 300: 0.908 to 0.992, with trial weights that are not what they say."""
    hits = []
    for seed in range(300):
        there, start, trials, _ = balanced(seed, 2e-8)
        found = correct(start, trials)
        hits.append(contains(found.weights.one(0), -there[0]))
    assert 0.908 <= np.mean(hits) <= 0.992


def test_a_run_with_the_weights_on_gives_the_residual_unbalance() -> None:
    there, start, trials, rng = balanced(3, 2e-8)
    first = correct(start, trials)
    left = there + first.weights.values
    after = correct(start, trials, run(left, rng, 2e-8))
    assert np.abs(-after.weights.values - left).max() < 4 * after.weights.u_amplitude.max()
    assert np.abs(left).max() < 0.05 * np.abs(there).max()
    assert after.weights.u_amplitude.max() < 0.5 * first.weights.u_amplitude.max()  # trial weights matter less


def test_more_probes_than_planes_are_least_squares() -> None:
    rng = np.random.default_rng(2)
    a = rng.normal(size=(4, 2)) + 1j * rng.normal(size=(4, 2))
    start = rng.normal(size=4) + 1j * rng.normal(size=4)
    tiny = 1e-12 * np.eye(8)
    weight = np.array([1.0, 2.0, 1.0, 0.5])
    trials = [Trial(k, 1.0 + 0j, Vectors(start + a[:, k], tiny)) for k in (0, 1)]
    found = correct(Vectors(start, tiny), trials, weight=weight)
    root = np.sqrt(weight)
    expected = np.linalg.lstsq(root[:, None] * a, -root * start, rcond=None)[0]
    assert np.allclose(found.weights.values, expected)
    assert np.allclose(found.residual.values, start + a @ expected)


def test_a_trial_weight_that_moved_nothing_is_refused() -> None:
    there, start, trials, rng = balanced(5, 2e-8)
    nothing = Trial(1, 2e-5 + 0j, run(there, rng, 2e-8))
    with pytest.raises(AnalysisError, match="plane 1 moved no vector"):
        correct(start, [trials[0], nothing])


def test_planes_that_look_alike_are_refused() -> None:
    start = Vectors(np.array([1.0 + 0j, 1.0]), 1e-12 * np.eye(4))
    alike = [Trial(k, 1.0 + 0j, Vectors(np.array([2.0 + 0j, 2.0 + 1e-4 * k]), 1e-12 * np.eye(4))) for k in (0, 1)]
    with pytest.raises(AnalysisError, match="tell the planes apart"):
        correct(start, alike)
    with pytest.raises(AnalysisError, match="one in each"):
        correct(start, alike[:1] * 2)


def test_the_standards_worked_example() -> None:
    """4 kg at 30 000 r/min: G2.5 is 3.18 g mm, G0.4 is 0.51 g mm; U_per = 9549 G m/n."""
    speed = 30_000 * np.pi / 30
    assert permissible(2.5e-3, 4.0, speed) / G_MM == pytest.approx(3.18, abs=0.005)
    assert permissible(0.4e-3, 4.0, speed) / G_MM == pytest.approx(0.51, abs=0.005)
    assert permissible(6.3e-3, 12.0, 1500 * np.pi / 30) / G_MM == pytest.approx(9549.3 * 6.3 * 12 / 1500, rel=1e-5)
    assert allocated(10.0, 0.1, 0.3) == pytest.approx((7.0, 3.0))
    assert allocated(10.0, 0.2, 0.3) == pytest.approx((6.0, 4.0))
    with pytest.raises(AnalysisError, match="above 0"):
        permissible(0, 1, 1)


def test_reached_means_that_the_uncertainty_fits_too() -> None:
    residual = Vectors(np.array([1.0 + 0j, 2.0]), np.diag([0.01, 0.01, 0.01, 0.01]))
    assert reached(residual, (1.2, 2.3)) == [False, True]  # U = 2.448 x 0.1


def test_a_short_vector_is_bound_by_its_ellipse_not_by_what_lies_along_it() -> None:
    narrow = Vectors(np.array([0.1 + 0j]), np.diag([0.01**2, 0.2**2]))
    along = 0.1 + 2.448 * 0.01
    assert bound(narrow) == pytest.approx(np.hypot(0.1, 2.448 * 0.2), rel=0.01)
    assert bound(narrow) > 3 * along
    assert reached(narrow, (0.3,)) == [False]
    assert bound(Vectors(np.array([1.0 + 0j]), 0.01 * np.eye(2))) == pytest.approx(1.245, abs=1e-3)


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, 4.5, 2 * np.pi - 1e-12])
def test_a_weight_on_two_positions_adds_up(angle: float) -> None:
    weight = 3e-6 * np.exp(1j * angle)
    parts = split(complex(weight), 8)
    assert len(parts) <= 2
    assert abs(sum(parts) - weight) < 1e-14
    steps = np.angle(parts) / (np.pi / 4)
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert split(complex(weight), 0) == [complex(weight)]
    with pytest.raises(AnalysisError, match="three or more"):
        split(complex(weight), 2)
