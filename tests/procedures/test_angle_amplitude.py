"""The greatest current of a segment in a step of the angle: by true currents, of whichever segment."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence, interval
from procedures.angle_step import amplitude, captured
from procedures.angle_step.bounds import Swing
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_sensors
from procedures.shared.greater import greater

RIG = load_rig("tsbs6")
Array = npt.NDArray[np.float64]
TICK, NOISE = 1e-4, 1.5e-3 * 10**0.5  # s; A of a reading, a sample of telemetry is a mean of ten
MACHINE = conventions(RIG)
SENSORS = certified_sensors(RIG, {name: name for name in MACHINE.segments})


def swing(vectors: Array) -> Swing:
    """Of what the sensors read, (2, 2, n) A."""
    still = np.zeros((2, vectors.shape[-1]))
    return Swing(np.arange(vectors.shape[-1]) * TICK, {}, vectors, 10.0, still[0], still, still, 1.0)


def at_limit(first: float, second: float, random: np.random.Generator | None = None) -> Swing:
    """80 ticks of q at these, of 200, as they are read."""
    q = np.where(np.arange(200) < 80, 1.0, 0.3) * np.array([[first], [second]])
    vectors = np.stack([q, np.zeros_like(q)], axis=1)
    return swing(vectors if random is None else vectors + random.normal(0.0, NOISE, vectors.shape))


def told(swings: list[Swing]) -> Estimate:
    return amplitude.estimates("here", swings, RIG)["amplitude"]


def test_sensors_are_taken_off_by_hand() -> None:
    """q = 8, d = -6: 10 A, of the first segment."""
    vectors = np.array([[[8.0, 1.0], [-6.0, 0.0]], [[2.0, 0.0], [-6.0, 0.0]]])
    sensors = SENSORS | {
        f"{key}_{c}": Estimate.exact(v, SENSORS[f"{key}_{c}"].unit)
        for key, v in (("gain", 1.01), ("offset", 0.05)) for c in MACHINE.segments
    }  # fmt: skip
    found = amplitude.largest(swing(vectors * 1.01 + 0.05), MACHINE, sensors, 0.0)
    assert [f.amplitude for f in found] == pytest.approx([10.0, 40**0.5])
    assert found[0].vector == pytest.approx([8.0, -6.0])


def test_of_two_segments_that_read_the_same_the_greater_is_told() -> None:
    """Both read 10 A, their gains are known to 0.3 % and zeros to 4 mA: the greater one of such rigs is at 10.01 A in the mean,
    and within the interval on 95 % of them. By the segment that happens to read more it was 10 A, and held it on 81 %."""
    steps = [at_limit(10.0, 10.0, np.random.default_rng(k)) for k in range(10)]
    found = told(steps)
    random = np.random.default_rng(0)
    gains, offsets = random.uniform(0.997, 1.003, (20_000, 2)), random.uniform(-4e-3, 4e-3, (20_000, 2))
    true, at = ((10.0 - offsets) / gains).max(axis=1), interval(found)
    assert found.value == pytest.approx(true.mean(), abs=2e-3)
    assert np.mean((at.low <= true) & (true <= at.high)) == pytest.approx(0.95, abs=0.015)


def test_a_segment_that_is_far_below_has_no_part_in_it() -> None:
    found = told([at_limit(10.0, 6.0, np.random.default_rng(k)) for k in range(10)])
    assert found.value == pytest.approx(10.0, abs=2e-3)
    assert not found.nonlinear
    assert {i.name for i in found.sensitivities if i.u > 0} >= {"gain of i_q1"}
    assert "gain of i_q2" not in {i.name for i in found.sensitivities}


@pytest.mark.parametrize(
    "approach", [np.zeros(80), -4.0 * np.exp(-1.26 * np.arange(4)), -4.0 * np.exp(-0.02 * np.arange(300))]
)
def test_what_noise_raises_the_largest_of_readings_by_is_taken_off(approach: Array) -> None:
    """80 readings at the limit, four on their way to it, and 300 that approach it: within 2.5 mA in the mean (half of
    s sqrt(2 ln n), which was taken off, left 4 mA of 80)."""
    random, off = np.random.default_rng(2), []
    for _ in range(400):
        read = 10.0 + approach + random.normal(0.0, NOISE, len(approach))
        by, alike = amplitude.raised(read[read >= read.max() - amplitude.NEAR * NOISE], NOISE)
        off.append(read.max() - by - (10.0 + approach.max()))
        assert 0 <= by <= alike + 1e-12
    assert abs(np.mean(off)) < 2.5e-3


def test_the_greater_of_two_that_are_known_as_well_as_they_differ() -> None:
    """Clark: of two standard normal numbers it is 1/sqrt(pi) = 0.564 in the mean, with a standard deviation of 0.826."""
    x, y = (Estimate.of(0.0, Influence(k, k, 1.0, "A", "B", "normal")) for k in "xy")
    both, at = greater(x, y), interval(greater(x, y))
    assert both.value == pytest.approx(0.5642, abs=1e-4)
    assert at.u == pytest.approx(0.8256, rel=0.01)
    assert greater(x + 9.0, y) == x + 9.0
    assert greater(x, x + 1e-9).value == pytest.approx(1e-9)


def test_ticks_of_a_cut_count_once() -> None:
    """Ten steps all alike: one in some may be a tick off, u = tick/10. One of them a tick off: u by their scatter, which has
    eight degrees of freedom and is as much, and nothing beside it."""
    alike = captured._cut("here", [[9e-4] * 5, [8e-4] * 5], TICK)
    assert [alike.value, alike.u] == pytest.approx([8.5e-4, TICK / 10])
    one = captured._cut("here", [[9e-4] * 4 + [10e-4], [8e-4] * 5], TICK)
    assert [one.value, one.u] == pytest.approx([8.6e-4, TICK / 10])
    assert [i.dof for i in one.sensitivities] == [8.0]
