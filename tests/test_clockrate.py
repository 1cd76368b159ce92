"""A clock of any factor is seen through any pattern of latency; one that is right is never called wrong."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from test_hosttime import MS, behind

from bench.link.clockrate import described
from bench.link.hosttime import HostMap

Floats = npt.NDArray[np.float64]
EPOCH_NS = 1_800_000_000_000_000_000


def clean(at: Floats, _: np.random.Generator) -> Floats:
    return np.zeros_like(at)


def stalls(at: Floats, random: np.random.Generator) -> Floats:
    """The bench stands still every few seconds; what waits is read at once."""
    late, begin = np.zeros_like(at), random.uniform(2, 5)
    while begin < at[-1]:
        end = begin + random.uniform(0.5, 4.0)
        late[(at >= begin) & (at < end)] = (end - at)[(at >= begin) & (at < end)]
        begin = end + random.uniform(2, 8)
    return late


def bursts(at: Floats, random: np.random.Generator) -> Floats:
    """Every seven seconds two of a third of a second more."""
    return np.where((at - random.uniform(0, 5)) % 7 < 2, 0.3, 0.0)


def noisy(at: Floats, random: np.random.Generator) -> Floats:
    return random.exponential(0.02, len(at))


def first(at: Floats, _: np.random.Generator) -> Floats:
    return np.where(at < 0.01, 0.2, 0.0)


def backlog(at: Floats, _: np.random.Generator) -> Floats:
    """Two seconds of telemetry wait at the start and are caught up with at three halves of the pace."""
    return np.maximum(0.0, 2.0 - 0.5 * at)


PATTERNS = (clean, stalls, bursts, noisy, first, backlog)
FACTORS = (0.1, 0.5, 0.8, 0.98, 0.99, 0.995, 1.005, 1.01, 1.011, 1.02, 1.1, 2.0, 10.0)


def fed(
    factor: float, pattern: Callable[..., Floats], seed: int, seconds: float = 30.0
) -> tuple[HostMap, float | None]:
    """A device whose clock runs `factor` times as fast, read every 20 ms; and when the clock was certainly wrong, s."""
    random, host, certain = np.random.default_rng(seed), HostMap(), None
    sent = np.arange(0, seconds, 0.02) + random.uniform(0, 0.004, round(seconds / 0.02))
    came = np.maximum.accumulate(sent + 0.0003 + random.exponential(0.0004, len(sent)) + pattern(sent, random))
    samples, hosts = (np.round(x * 1e9).astype(np.int64) + EPOCH_NS for x in (sent * factor, came))
    for arrival in np.split(np.arange(len(sent)), np.flatnonzero(np.diff(came // 0.02)) + 1):
        host.take(samples[arrival], hosts[arrival])
        if certain is None and host.rate.certain_ppm is not None:
            certain = float(came[arrival[-1]])
    return host, certain


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("factor", FACTORS)
def test_any_factor_is_seen_through_any_latency(factor: float, pattern: Callable[..., Floats]) -> None:
    ppm = (1 / factor - 1) * 1e6
    for seed in range(3):
        host, _ = fed(factor, pattern, seed)
        found = host.drift()
        assert found is not None
        assert abs(found.ppm - ppm) <= 3 * found.expanded_ppm
        assert found.expanded_ppm < max(100.0, 0.02 * abs(ppm))
        assert host.unknown_s == 0.0


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("ppm", [-150.0, 0.0, 150.0])
def test_a_clock_that_is_right_is_not_wrong_through_any_latency(ppm: float, pattern: Callable[..., Floats]) -> None:
    for seed in range(3):
        host, certain = fed(1 - ppm * 1e-6, pattern, seed)
        found = host.drift()
        assert certain is None
        assert found is not None
        assert abs(found.ppm - ppm) <= max(3 * found.expanded_ppm, 1.0)
        assert found.expanded_ppm < 60


@pytest.mark.parametrize(("pattern", "more_s"), [(clean, 0.0), (first, 0.5), (stalls, 6.0)])
@pytest.mark.parametrize(("factor", "seconds"), [(0.1, 6), (0.5, 6), (0.98, 6), (1.02, 11), (2.0, 11), (10.0, 11)])
def test_a_gross_one_is_certain_within_seconds(
    factor: float, seconds: float, pattern: Callable[..., Floats], more_s: float
) -> None:
    _, certain = fed(factor, pattern, 2)
    assert certain is not None
    assert certain < seconds + more_s


@pytest.mark.parametrize("factor", [0.995, 1.005])
def test_half_a_per_cent_ends_no_run_by_itself(factor: float) -> None:
    assert fed(factor, clean, 1)[1] is None


def test_a_computer_that_stands_still_time_and_again_is_never_a_wrong_clock() -> None:
    """It catches up at three halves of its pace for seconds, and so looks like a clock that is fast."""
    for seed in range(20):
        host = behind(seed)
        assert host.rate.certain_ppm is None
        assert host.rate.gained_ns < 20 * MS
        line = host.rate.line()
        assert line is None or abs(line.slope) < 1e-3


def test_a_computer_that_is_too_slow_keeps_to_no_line() -> None:
    """Nine tenths of the time, by shares that change as those of a busy computer do: no end within seconds."""
    for seed in range(10):
        random, host, device, share = np.random.default_rng(seed), HostMap(), 0.0, 0.0
        for k in range(1500):
            share += -share / 15 + 0.1 * np.sqrt(2 / 15) * random.standard_normal()
            device = min(0.02 * k, device + 0.02 * max(0.0, 0.9 + share))
            host.take(np.array([round(device * 1e9)]), np.array([20 * MS * k]))
            assert host.rate.certain_ppm is None


def test_what_keeps_no_line_and_gets_ever_earlier_is_told() -> None:
    """Two per cent fast, and more than half of the time late by anything."""

    def wild(at: Floats, random: np.random.Generator) -> Floats:
        return np.where(random.uniform(size=len(at) // 50 + 1)[np.arange(len(at)) // 50] < 0.7,
                        random.uniform(0.05, 1.0, len(at) // 50 + 1)[np.arange(len(at)) // 50], 0.0)  # fmt: skip

    host, certain = fed(1.02, wild, 1)
    assert (host.drift(), certain) == (None, None)
    assert host.unknown_s == pytest.approx(29.0, abs=1.1)
    assert host.rate.gained_ns > 60 * MS


@pytest.mark.parametrize(
    ("ppm", "text"),
    [(1e6, "at 0.500 of the rate"), (-5e5, "at 2.000 of the rate"), (-19_608.0, "at 1.020 of the rate"),
     (5000.0, "5000 ppm slow"), (-400.0, "400 ppm fast")],
)  # fmt: skip
def test_a_gross_error_is_told_as_a_factor(ppm: float, text: str) -> None:
    assert text in described(ppm)
