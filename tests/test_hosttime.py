"""Device ticks against host time: drift with an interval that holds, a first sample that was late, a link that stalls."""

from __future__ import annotations

import numpy as np
import pytest

from bench.link.health import BEYOND, DRIFT_PPM
from bench.link.hosttime import HostMap

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


@pytest.mark.long
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


def behind(seed: int) -> HostMap:
    """40 s on a computer that stands still every few seconds; the telemetry catches up at three halves of its pace."""
    random, host = np.random.default_rng(seed), HostMap()
    now = device = debt = 0.0
    due = random.uniform(2, 8)
    while now < 40:
        now += 0.02
        if now > due:
            pause = random.uniform(0.5, 4.0)
            now, debt, due = now + pause, debt + pause, now + pause + random.uniform(2, 8)
        more = min(0.01, debt)
        device, debt = device + 0.02 + more, debt - more
        host.take(np.array([round(device * 1e9)]), np.array([round(now * 1e9 + random.exponential(0.4) * MS)]))
    return host


def test_a_computer_that_stands_still_time_and_again_is_no_drift() -> None:
    """Half of these are called a drift of thousands of ppm where windows that a later one proves late are not left out."""
    found = [behind(seed).drift() for seed in range(20)]
    assert sum(d is not None and abs(d.ppm) - d.expanded_ppm > DRIFT_PPM for d in found) <= 1


def test_a_long_stall_after_a_late_first_sample_moves_no_step() -> None:
    """The clock that steps are timed by would stand until the host's had made up what it once gained."""
    host, lags = HostMap(), []
    for k in range(400):
        late = 0 if k == 0 else -200 + (3000 if 200 <= k < 300 else 0)
        host.take(np.array([k * 50 * MS]), np.array([(k * 50 + late) * MS]))
        lags.append(host.lag_ns)
    assert max(lags[1:]) < -190 * MS


def test_nothing_varies_in_simulation() -> None:
    host = HostMap()
    for k in range(100):
        host.take(np.array([k * 100 * MS]), np.array([k * 100 * MS]))
    assert host.drift() is None
    assert host.lag_ns == host.latest_ns == 0


@pytest.mark.parametrize(("ppm", "beyond"), [(150.0, False), (-4000.0, False), (3000.0, True), (4000.0, True)])
def test_windows_that_drift_cannot_explain_are_counted(ppm: float, beyond: bool) -> None:
    host = fed(ppm, 4, seconds=8)
    assert host.drift() is None
    assert (host.beyond >= BEYOND) is beyond


def test_a_stall_is_beyond_drift_for_no_longer_than_it_lasts() -> None:
    assert fed(0.0, 5, seconds=22, stall=True).beyond == 1
    assert fed(0.0, 5, stall=True).beyond == 0
    host = HostMap()
    for k in range(400):  # one second in two is a stall
        host.take(np.array([k * 50 * MS]), np.array([k * 50 * MS + 300 * MS * (k // 20 % 2)]))
    assert host.beyond <= 1


def test_the_oldest_of_a_burst_tells_how_late_it_was() -> None:
    host = fed(0.0, 3)
    samples = np.arange(60_000, 60_300, 10) * MS
    host.take(samples, np.full(len(samples), samples[-1] + MS))
    assert 285 * MS < host.latest_ns < 300 * MS
