"""The core's generator: known answers by an independent implementation, moments, independence of streams."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from scipy import stats

from sim_backend.machines.tsbs.plant import normals

MASK = 2**64 - 1
GOLDEN = 0x9E3779B97F4A7C15
R, V, LAYERS = 3.442619855899, 9.91256303526217e-3, 128
COUNT = 1_000_000


def mix(z: int) -> int:
    """Finaliser of SplitMix64 (Steele, Lea, Flood 2014)."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return z ^ (z >> 31)


def bits(seed: int, stream: int) -> Iterator[int]:
    """The counter-based stream."""
    key = mix((seed + GOLDEN) & MASK) ^ mix((stream * 0xD1B54A32D192ED03 + 1) & MASK)
    key = mix(key)
    return (mix((key + n * GOLDEN) & MASK) for n in itertools.count(1))


def ziggurat(source: Iterator[int]) -> Iterator[float]:
    """Normals from 64-bit words, ziggurat of Marsaglia and Tsang in the form of Doornik (2005)."""
    f = math.exp(-R * R / 2)
    edge = [V / f, R]
    while len(edge) < LAYERS:
        edge.append(math.sqrt(-2 * math.log(V / edge[-1] + f)))
        f = math.exp(-(edge[-1] ** 2) / 2)
    edge.append(0.0)

    def uniform() -> float:
        return ((next(source) >> 11) + 0.5) / 2**53

    while True:
        word = next(source)
        i, u = word % LAYERS, 2 * ((word >> 11) + 0.5) / 2**53 - 1
        x = u * edge[i]
        if abs(x) < edge[i + 1]:
            yield x
        elif i == 0:
            a, b = math.log(uniform()) / R, math.log(uniform())
            while -2 * b < a * a:
                a, b = math.log(uniform()) / R, math.log(uniform())
            yield math.copysign(R - a, u)
        else:
            f0, f1 = (math.exp(-(edge[k] ** 2 - x * x) / 2) for k in (i, i + 1))
            if f1 + uniform() * (f0 - f1) < 1:
                yield x


def test_mix_has_the_published_answers() -> None:
    """SplitMix64 from state 1234567, as printed on Rosetta Code."""
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]
    assert [mix((1234567 + n * GOLDEN) & MASK) for n in range(1, 5)] == published


@pytest.mark.parametrize(("seed", "stream"), [(0, 0), (7, 3), (MASK, 0)])
def test_normals_equal_an_independent_implementation(seed: int, stream: int) -> None:
    expected = list(itertools.islice(ziggurat(bits(seed, stream)), 20_000))
    assert max(abs(x) for x in expected) > R  # the tail was visited
    np.testing.assert_allclose(normals(seed, stream, 20_000), expected, rtol=1e-12, atol=1e-15)


def test_moments_and_distribution() -> None:
    x = normals(1, 0, COUNT)
    root = math.sqrt(COUNT)
    assert abs(x.mean()) < 4 / root
    assert abs(x.var() - 1) < 4 * math.sqrt(2) / root
    assert abs(stats.skew(x)) < 4 * math.sqrt(6) / root
    assert abs(stats.kurtosis(x)) < 4 * math.sqrt(24) / root
    assert stats.kstest(x, "norm").pvalue > 1e-3
    beyond = COUNT * 2 * stats.norm.sf(R)
    assert abs((np.abs(x) > R).sum() - beyond) < 4 * math.sqrt(beyond)


def test_draws_streams_and_seeds_are_independent() -> None:
    x = normals(1, 0, COUNT)
    bound = 4 / math.sqrt(COUNT)
    assert abs(float(np.corrcoef(x[:-1], x[1:])[0, 1])) < bound
    assert abs(float(np.corrcoef(x**2 - 1, np.roll(x, 1) ** 2 - 1)[0, 1])) < bound
    for other in (normals(1, 1, COUNT), normals(2, 0, COUNT)):
        assert abs(float(np.corrcoef(x, other)[0, 1])) < bound


def test_a_stream_is_repeatable_and_its_start_does_not_depend_on_its_length() -> None:
    np.testing.assert_array_equal(normals(5, 2, 100), normals(5, 2, 1000)[:100])
