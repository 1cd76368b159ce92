"""The fit of a step's swing, and what is read from it: on made responses whose poles, peaks and scatter are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.errors import AnalysisError
from procedures.amb_rotor.onset import onset
from procedures.step import coupled, fit, oscillation, response, scatter
from sim_backend.machines import stepping


def test_damping_of_two_oscillations_that_are_almost_one() -> None:
    """Either pole is ill determined; the mean pole of the swing is not, and the time from which it counts hardly matters."""
    rng = np.random.default_rng(1)
    poles, parts = np.array([-90 + 425j, -85 + 421j]), np.array([-0.5 + 0.1j, -0.3 + 0.1j])
    tilt = np.array([0.05 + 0.02j, -0.05 - 0.02j])
    t = np.arange(-5, 60) * 1e-3
    both = np.array(
        [1.0 + (np.exp(np.outer(t, poles)) @ (c * oscillation.shrinks(poles, 1e-3))).real for c in (parts, tilt)]
    )
    true = oscillation.Swing(poles, parts, 1.0, 0.0, 0.0)
    exact = fit.swing([oscillation.One(t, both)])
    assert exact.damping == pytest.approx(true.damping, rel=1e-3)
    assert exact.peak == pytest.approx(true.peak, abs=1e-4)
    found = [fit.swing([oscillation.One(t, both + 1e-3 * rng.normal(size=both.shape))]) for _ in range(10)]
    assert np.mean([s.damping for s in found]) == pytest.approx(true.damping, rel=0.015)
    assert np.std([s.damping for s in found]) < 0.03 * true.damping
    later = exact.later(1e-4)
    assert later.damping == pytest.approx(exact.damping, rel=2e-3)


def test_a_fast_integrator_is_fitted_beside_the_swing() -> None:
    """A quarter of the step with a time constant as long as the swing is fitted: by a straight line the pole is a percent and
    more off. The second oscillation of a shaft in two like bearings hardly shows in position, and its pole does not run off."""
    rng = np.random.default_rng(4)
    poles, parts = np.array([-320 + 447j, -470 + 480j]), np.array([-1.2 + 1.0j, 0.0])
    t, period = np.arange(-20, 1500) * 5e-4, 5e-4
    swung = (np.exp(np.outer(t, poles)) @ (parts * oscillation.shrinks(poles, period))).real
    y = np.where(t > 0, 1.0 + 0.25 * np.exp(-np.maximum(t, 0) / 0.057) + np.where(t > 0, swung, 0.0), 0.0)
    ones = [oscillation.One(t, np.array([y, 0 * y]) + 2e-3 * rng.normal(size=(2, t.size))) for _ in range(12)]
    found = fit.swing(ones)
    assert found.constant == pytest.approx(0.057, rel=0.02)
    assert found.pole == pytest.approx(poles[0], rel=0.02)
    assert found.at(np.array([5e-3]))[0] == pytest.approx(
        1.0 + 0.25 * math.exp(-5 / 57) + (np.exp(poles[0] * 5e-3) * parts[0]).real, abs=2e-3
    )
    slow = [
        oscillation.One(s.t, np.array([y - 0.25 * np.exp(-t / 0.057) + 0.25 * np.exp(-t / 0.58), s.both[1]]))
        for s in ones
    ]
    assert fit.swing(slow).constant == 0.0  # a straight line does while the shaft swings


@pytest.mark.parametrize("second_s", [0.048, 0.025])
def test_what_two_integrators_leave_may_fade_unlike(second_s: float) -> None:
    """Two heavily damped oscillations of position and tilt by equation 1 (numpy's eigenvectors), and what the integrators of
    unlike bearings leave, 0.05 and 0.025 s. Taken to fade alike it moves the mean pole by 23 %."""
    rng, t, period = np.random.default_rng(5), np.arange(-20, 1500) * 5e-4, 5e-4
    p, d, e = -410 + 270j, -20 + 150j, 20 + 110j
    poles, shapes = np.linalg.eig(np.array([[p, 0.6 * e], [e, p + d]]))
    parts = shapes * np.linalg.solve(shapes, np.array([-1.0 + 0.9j, 0.1 - 0.05j]))
    after = np.maximum(t, 0)
    swung = (np.exp(np.outer(after, poles)) @ (parts * oscillation.shrinks(poles, period)).T).real.T
    first, second = (np.exp(-after / c) for c in (0.05, second_s))
    seen = np.array([1 + 0.15 * first + 0.1 * second, 0.08 * (first - second)]) + swung
    seen = np.where(t > 0, seen, 0.0)
    ones = [oscillation.One(t, seen + 1.5e-3 * rng.normal(size=seen.shape)) for _ in range(16)]
    found = fit.swing(ones, tilting=coupled.Tilting(math.log(0.6), 0.25))
    true = (parts[0] * poles).sum() / parts[0].sum()
    assert found.unlike is (second_s == 0.025)
    assert abs(found.pole) == pytest.approx(abs(true), rel=0.04)
    assert found.damping == pytest.approx(-true.real / abs(true), abs=0.02)
    near = (t > oscillation.FROM_S) & (t < 0.3)
    assert np.abs(found.means(t[near], period) - seen[0, near]).max() < 2e-3


def test_oscillations_that_lie_apart_are_not_averaged() -> None:
    """A shaft that leans, its centre of mass beyond a bearing: 146 Hz that hardly swings, and 23.7 Hz that goes on."""
    poles, parts = np.array([-862.7 + 316.8j, -17.0 + 147.7j]), np.array([-0.11 + 0.7j, -0.48 + 0.05j])
    for found in (oscillation.Swing(poles, parts, 1.0, 0.0, 0.0), stepping.Small(poles, parts)):
        assert found.pole == pytest.approx(poles[1])
        assert found.frequency == pytest.approx(23.66, abs=0.01)


def test_a_tilt_says_what_the_second_oscillation_has_of_the_position() -> None:
    """Envelopes by the matrix exponential; the second pole has a tenth of the position. By another weight of the tilt the mean
    pole is off, and that is what is told of it. Two integrators that are almost alike leave 0.3 % of the step in the tilt."""
    from scipy.linalg import expm

    rng = np.random.default_rng(5)
    p, apart, leans, weighs = -320 + 447j, -165 + 30j, -80 + 15j, 0.6
    loop = np.array([[p, weighs * leans], [leans, p + apart]])
    t, period = np.arange(-20, 1500) * 5e-4, 5e-4
    fine = period / 40
    step = expm(loop * fine)
    states = np.empty((round(0.06 / fine), 2), complex)
    states[0] = -1.2 + 1.0j, 0.25 - 0.3j
    for k in range(1, len(states)):
        states[k] = step @ states[k - 1]
    means = np.zeros((2, t.size))
    whole = states.real[1:].reshape(-1)[: (len(states) - 1) // 40 * 80].reshape(-1, 40, 2).mean(axis=1).T
    means[:, 21 : 21 + whole.shape[1]] = whole
    means[0] += np.where(t > 0, 1.0 + 0.25 * np.exp(-np.maximum(t, 0) / 0.057), 0.0)
    means[1] += np.where(t > 0, 0.16 * (np.exp(-np.maximum(t, 0) / 0.0585) - np.exp(-np.maximum(t, 0) / 0.0555)), 0.0)
    ones = [oscillation.One(t, means + 2e-4 * rng.normal(size=means.shape)) for _ in range(16)]
    true = p + weighs * leans * states[0, 1] / states[0, 0]
    found = fit.swing(ones, tilting=coupled.Tilting(math.log(weighs), 0.2))
    assert len(found.poles) == 2
    assert abs(found.pole - true) < 0.004 * abs(true)
    doubts = math.hypot(*(abs(d.pole - found.pole) for d in found.doubts))
    wrong = fit.swing(ones, tilting=coupled.Tilting(math.log(3 * weighs), 0.05))
    assert abs(wrong.pole - true) > 3 * abs(found.pole - true)
    assert 0 < doubts < 0.03 * abs(true)


def second_order(w: float, z: float, shift: float, seconds: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    """Times and means over 1 ms of the exact response, whose step comes `shift` before the first full period."""
    fine = np.arange(-0.02, seconds, 1e-5)
    x, wd = np.maximum(fine + shift, 0), w * math.sqrt(1 - z * z)
    y = 1 - np.exp(-z * w * x) * (np.cos(wd * x) + z * w / wd * np.sin(wd * x))
    return (np.arange(len(fine) // 100) + 1) * 1e-3 - 0.02, y[: len(fine) // 100 * 100].reshape(-1, 100).mean(axis=1)


@pytest.mark.parametrize("z", [0.15, 0.3, 0.5])
@pytest.mark.parametrize("shift", [0.0, 3e-4, 7e-4])
def test_a_second_order_step_from_means(z: float, shift: float) -> None:
    w = 2 * math.pi * 70
    t, y = second_order(w, z, shift)
    one = oscillation.One(t + shift, np.array([y, 0 * y]))
    fitted = fit.swing([one])
    assert fitted.peak - 1 == pytest.approx(math.exp(-math.pi * z / math.sqrt(1 - z * z)), abs=1e-3)
    b = math.sqrt(1 - 2 * z * z + math.sqrt((1 - 2 * z * z) ** 2 + 1))
    assert response.bandwidth([one], fitted) == pytest.approx(70 * b, rel=0.005)
    assert fitted.damping == pytest.approx(z, rel=0.003)
    assert fitted.frequency == pytest.approx(70, rel=0.002)
    assert float(y.max()) < fitted.peak  # the largest mean is below the largest value


@pytest.mark.parametrize("begun", [0.0, 2.3e-4, 6.1e-4])
def test_when_a_set_point_acted_is_told_finer_than_the_telemetry(begun: float) -> None:
    lag, tick = 4e-4, 1e-4
    t = np.arange(-30, 20) * 1e-3
    reads = t[:, None] - tick * np.arange(1, 11) - begun - 2 * tick
    since = np.maximum(reads, 0)
    current = (1 - np.exp(-since / lag) - 8e3 * since**2).mean(axis=1)
    found, _ = onset(t, current, begun - 4e-4, begun + 8e-4, tick=tick, ticks=10, lag_s=lag)
    assert found == pytest.approx(begun, abs=4e-5)


def test_a_position_that_does_not_get_there_is_told() -> None:
    with pytest.raises(AnalysisError, match="90 %"):
        response.rise_time(*response.curve(np.arange(50) * 1e-3, np.full(50, 0.3)))


def test_the_scatter_of_a_fit_that_large_steps_carry() -> None:
    """A mean of three steps each of two sizes, whose noise is 1 and 1/2: by hand its variance is 1/15. That from leaving out
    has it on average; as if all steps weighed alike it would be 19 % more."""
    rng, kinds = np.random.default_rng(5), ["small"] * 3 + ["large"] * 3
    shares = np.repeat([1.0, 4.0], 3) / 15
    draws = rng.normal(size=(4000, 6)) * np.repeat([1.0, 0.5], 3)
    left = (draws @ shares)[:, None] - shares / (1 - shares) * (draws - (draws @ shares)[:, None])
    found = [scatter.left_out(kinds, row, shares) for row in left]
    assert np.mean(found) == pytest.approx(1 / 15, rel=0.03)
