"""The balance of torques at the segments' limit, against numbers by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.uncertainty import interval
from procedures.maximum_speed import fit, steps
from procedures.maximum_speed.estimates import scatter
from procedures.maximum_speed.plan import HALF, OP, Plan
from procedures.maximum_speed.running import order

N = np.array


def test_what_a_limit_leaves_for_torque_by_hand() -> None:
    """I_s 8 A beside i_x -1, i_y 4 A: a half leaves 4 A; (6.24) leaves 8 - 2.5 = 5.5 A with lambda 4/11."""
    x, y = N([-1.0, 1.0, 9.0]), N([4.0, -4.0, 0.0])
    assert fit.bound(8.0, x, y, HALF) == pytest.approx([4.0, 4.0, 0.0])
    assert fit.bound(8.0, x, y, OP) == pytest.approx([5.5, 5.5, 4.0])
    assert fit.share(8.0, x, y, OP) == pytest.approx([4 / 11, 4 / 11, 1.0])
    assert fit.share(8.0, x, y, HALF) == pytest.approx([0.5, 0.5, 0.5])
    i = fit.bound(8.0, x, y, OP) * fit.share(8.0, x, y, OP)
    assert (2 * i + np.abs(y))[0] == pytest.approx(8.0)  # segment 1 is at its limit for good


def test_the_mean_of_sizes_is_no_size_of_means() -> None:
    """A current that swings by 0.3 A about nothing takes 0.19 A of torque current on average."""
    x = 0.3 * np.sin(np.linspace(0, 20 * math.pi, 10000, endpoint=False))
    found = fit.bound(8.0, x, np.full(10000, 4.0), OP).mean()
    assert found == pytest.approx(8 - 2 - 0.3 / math.pi, abs=1e-4)


@pytest.mark.parametrize("way", [1, -1])
def test_speed_of_whole_turns_and_ripple_of_an_uneven_rotor(way: int) -> None:
    """42.0 rad/s with orders 1 and 2 of 0.2 and 0.1 rad/s, told in counts of 4096: rms 0.158; the part of a turn that is left
    over would be 0.3 % of the speed."""
    t = np.arange(2000) * 1e-3
    fine = np.arange(20000) * 1e-4
    angle = np.zeros(20000)
    for k in range(1, 20000):  # w = 42 + 0.2 cos(angle) + 0.1 sin(2 angle)
        a = angle[k - 1]
        angle[k] = a + 1e-4 * (42.0 + 0.2 * math.cos(a) + 0.1 * math.sin(2 * a))
    counted = np.round(angle[::10] / (2 * math.pi) * 4096) / 4096 * 2 * math.pi
    told = (way * counted + 0.4 + math.pi) % (2 * math.pi) - math.pi
    found = fit.turning(t, told)
    turns = int(angle[-1] / (2 * math.pi))
    true = 2 * math.pi * turns / np.interp(2 * math.pi * turns, angle, fine)
    assert found.turns == turns == 13
    assert found.speed == pytest.approx(way * true, abs=4 * fit.count_u(found, 4096))
    assert fit.count_u(found, 4096) < 5e-5  # the two ends alone leave 3e-4
    turned = [0.2 * math.cos(0.4), 0.2 * math.sin(0.4), way * 0.1 * math.sin(-0.8), way * 0.1 * math.cos(0.8)]
    whole = slice(found.samples)
    swings = fit.swings(t[whole], np.unwrap(told)[whole])
    assert way * swings[:4] == pytest.approx(turned, abs=5e-3)
    assert fit.ripple(np.array([swings] * 2)).size == pytest.approx(math.sqrt((0.2**2 + 0.1**2) / 2), rel=0.02)


def test_counts_that_beat_with_the_samples_look_like_an_order_at_1_khz_and_not_at_10() -> None:
    """At 65.977 rad/s 43.01 counts pass in a millisecond: their rounding goes round with the rotor, once a turn, as pulses of a
    count. Each order of a rotor without any ripple shows twice a count times 10.5 Hz, 32 mrad/s, together 46 rms."""
    w, count, sizes = 2 * math.pi * 43000 / 4095, 2 * math.pi / 4096, []
    for rate in (1e3, 1e4):
        t = np.arange(round(10 * 2 * math.pi / w * rate)) / rate
        found = fit.swings(t, np.round((w * t + 1e-4) / count) * count)
        sizes.append(math.sqrt(float(found @ found) / 2))
    assert sizes[0] == pytest.approx(2 * count * w / (2 * math.pi) * math.sqrt(2), rel=0.05)
    assert sizes[1] < 2e-3


def test_the_speed_swings_by_the_captured_angle_and_by_telemetry_where_none_was_captured() -> None:
    """43.01 counts a millisecond: by telemetry 46 mrad/s rms of an even rotor. Older recordings have no captured angle."""
    w, count = 2 * math.pi * 43000 / 4095, 2 * math.pi / 4096

    def told(rate: float, seconds: float) -> tuple[Any, Any]:
        t = np.arange(round(seconds * rate)) / rate
        return t, np.angle(np.exp(1j * np.round(w * t / count) * count))

    t, angle = told(1e3, 1.0)
    turning = fit.turning(t, angle)
    whole = slice(turning.samples)
    for names, least, most in ((("angle", "lambda"), 0.0, 4e-3), (("lambda",), 0.04, 0.05)):
        capture: Any = SimpleNamespace(
            channels=names, samples=5000, rate_hz=1e4, arrays=lambda name: {name: told(1e4, 0.5)[1]}
        )
        found = steps.swings_of(capture, turning, t[whole], angle[whole])
        assert least <= math.sqrt(float(found @ found) / 2) < most


def test_noise_does_not_lengthen_the_ripple_and_its_interval_holds_it() -> None:
    """0.1 rad/s rms under 0.06 of noise on each of eight parts of five windows: their own lengths are 0.16 on average, and the
    length of their mean still 0.106."""
    true, noise = np.array([0.1, 0.1, 0, 0, 0, 0, 0, 0]), np.random.default_rng(7)
    sizes, inside = [], []
    for _ in range(4000):
        found = fit.ripple(true + 0.06 * noise.standard_normal((5, 8)))
        sizes.append(found.size)
        u = math.sqrt(float((found.off**2).sum()) / 4 / 5)
        inside.append(abs(found.size - 0.1) < 2.78 * u)
    assert np.mean(sizes) == pytest.approx(0.1, abs=0.003)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)
    assert fit.ripple(np.zeros((3, 8))).size == 0


def test_directions_of_different_scatter_have_an_interval_of_their_own_degrees_of_freedom() -> None:
    """Backward five times forward, five windows each: nearly all of it has four degrees of freedom, and with the eight of both
    together 0.93 of the intervals would hold."""
    noise, inside = np.random.default_rng(11), []
    for _ in range(1500):
        rows = {"forward": 1e-3 * noise.standard_normal((5, 3)), "backward": 5e-3 * noise.standard_normal((5, 3))}
        mean = sum(r.mean(axis=0) for r in rows.values()) / 2
        found = scatter(HALF, {way: r - r.mean(axis=0) for way, r in rows.items()})
        inside.append([abs(m) < interval(e).U for m, e in zip(mean, found.values(), strict=True)])
    assert np.mean(inside, axis=0) == pytest.approx(0.95, abs=0.017)


def test_a_rotor_that_hardly_turns_has_no_speed() -> None:
    with pytest.raises(AnalysisError, match=r"turns 0\.\d+ times"):
        fit.turning(np.arange(1000) * 1e-3, 2.0 * np.arange(1000) * 1e-3)


def test_whole_turns_of_a_capture() -> None:
    """At 10 kHz and 50 rad/s a turn is 1256.6 samples: seven of them in 10 000."""
    assert fit.whole_turns(10000, 1e4, 50.0) == 8796
    assert fit.whole_turns(1000, 1e4, -50.0) == 0


def test_printed_speeds_need_three_times_the_printed_drag() -> None:
    """T Fig. 6.8 and Table 6.2: alpha_tau (i_y - i_x)/2 = B dw whatever I_s is, as half of i_y is what (6.24) gains."""
    dw = (601 - 403) * math.pi / 30
    assert 2.87 * (4.02 - 0.23) / 2 / dw == pytest.approx(0.262, abs=0.001)
    for limit in (5.0, 7.8, 10.0):
        found = fit.expected(limit, 4.02, 2.87, 0.081, 0.05)
        assert found.speed[OP] - found.speed[HALF] == pytest.approx(2.87 * 4.02 / 2 / 0.081)  # 71 rad/s, 680 r/min


def test_both_sharings_alternate_and_an_even_drift_cancels() -> None:
    for repeats in (3, 4, 5):
        found = {s: [] for s in (HALF, OP)}
        for direction, at in ((1, 0.0), (-1, 100.0)):
            for k, (sharing, repeat) in enumerate(order(Plan(repeats=repeats), direction)):
                found[sharing].append(at + k)
                assert repeat == k // 2
        assert np.mean(found[HALF]) == pytest.approx(np.mean(found[OP]))
    assert "".join(s[0] for s, _ in order(Plan(repeats=4), 1)) == "hpphhpph"
