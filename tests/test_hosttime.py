"""Device ticks against host time: drift with an interval that holds, a first sample that was late, a link that stalls."""

from __future__ import annotations

import numpy as np
import pytest

from bench.hosttime import HostMap
from bench.linkhealth import BEYOND

MS = 1_000_000


def fed(ppm: float, seed: int, seconds: int = 60, first_late_ms: float = 0.0, stall: bool = False) -> HostMap:
    """Batches of 20 ms whose latency is never negative; host time runs `ppm` faster than the sample clock."""
    random, host = np.random.default_rng(seed), HostMap()
    for k in range(seconds * 20):
        sample = k * 50 * MS
        latency = 0.3 + random.exponential(0.4) + (300 if stall and 400 <= k < 440 else 0)
        if k == 0:
            latency = 0.3 + first_late_ms
            origin = latency * MS
        came = round(sample * (1 + ppm * 1e-6) + latency * MS - origin)
        host.take(np.array([sample]), np.array([came]))
    return host


def test_drift_with_an_interval_that_holds() -> None:
    """95 % of the intervals hold the truth, whatever the drift, the latency and the first sample's lateness."""
    cases = [(ppm, late, seed) for ppm in (-80.0, 0.0, 35.0) for late in (0.0, 25.0) for seed in range(50)]
    found = [(ppm, fed(ppm, seed, 40, late).drift()) for ppm, late, seed in cases]
    inside = [abs(d.ppm - ppm) <= d.expanded_ppm for ppm, d in found if d is not None]
    assert len(inside) == len(cases)
    assert 0.92 <= np.mean(inside) <= 0.98


def test_a_late_first_sample_is_found_out() -> None:
    host = fed(0.0, 1, first_late_ms=25.0)
    assert host.lag_ns == pytest.approx(-25 * MS, abs=0.3 * MS)
    assert host.latest_ns < 30 * MS


def test_a_stall_is_lateness_and_no_drift() -> None:
    host = fed(20.0, 2, stall=True)
    found = host.drift()
    assert found is not None
    assert abs(found.ppm - 20.0) < 3 * found.expanded_ppm < 30
    assert 290 * MS < host.latest_ns < 330 * MS
    assert abs(host.lag_ns) < 3 * MS


def test_nothing_varies_in_simulation() -> None:
    host = HostMap()
    for k in range(100):
        host.take(np.array([k * 100 * MS]), np.array([k * 100 * MS]))
    assert host.drift() is None
    assert host.lag_ns == host.latest_ns == 0


@pytest.mark.parametrize(("ppm", "beyond"), [(150.0, False), (-20_000.0, False), (3000.0, True), (10_000.0, True)])
def test_windows_that_drift_cannot_explain_are_counted(ppm: float, beyond: bool) -> None:
    host = fed(ppm, 4, seconds=8)
    assert host.drift() is None
    assert (host.longest_beyond >= BEYOND) is beyond


def test_a_stall_is_beyond_drift_for_no_longer_than_it_lasts() -> None:
    assert 1 <= fed(0.0, 5, stall=True).longest_beyond <= 2
    host = HostMap()
    for k in range(400):  # one second in two is a stall
        host.take(np.array([k * 50 * MS]), np.array([k * 50 * MS + 300 * MS * (k // 20 % 2)]))
    assert host.longest_beyond == 1


def test_the_oldest_of_a_burst_tells_how_late_it_was() -> None:
    host = fed(0.0, 3)
    samples = np.arange(60_000, 60_300, 10) * MS
    host.take(samples, np.full(len(samples), samples[-1] + MS))
    assert 285 * MS < host.latest_ns < 300 * MS
