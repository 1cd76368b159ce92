"""The shaft's angle from its pulses, and what is wrong with them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from turning import Shaft

from bench.analysis.tachometer import Fresh, against, age, counted, edges, fresh, tachometer, wrapped
from bench.errors import AnalysisError


@given(st.floats(20, 1500), st.floats(-20, 60), st.floats(0, 6.2))
@settings(max_examples=25, deadline=None)
def test_the_angle_is_the_shafts(speed: float, rise: float, first: float) -> None:
    shaft = Shaft(speed, rise if speed > 100 else 0, first)
    tacho = shaft.tacho(2.0)
    t = np.linspace(tacho.times[0], tacho.times[-1], 500)
    away = tacho.angle(t) - shaft.angle(t)
    assert np.allclose(away, away[0], atol=2e-5)
    assert round(float(away[0] / (2 * np.pi)), 6) % 1 == 0
    assert np.allclose(tacho.speed(t), shaft.speed + shaft.rise * t, rtol=1e-3)
    assert tacho.sound
    assert np.isnan(tacho.angle([tacho.times[0] - 1e-6, tacho.times[-1] + 1e-6])).all()


@pytest.mark.parametrize("every", [3, 4, 7, 50])
def test_missing_pulses_are_named_and_mended(every: int) -> None:
    shaft = Shaft(700.0, 30.0)
    pulses = shaft.pulses(3.0)
    lost = np.arange(pulses.size) % every == every - 1
    lost[-1] = False
    found = tachometer(pulses[~lost])
    assert np.allclose(found.missing, pulses[lost], atol=1e-4)
    assert not found.doubled
    assert np.allclose(found.times, pulses[~lost])
    assert np.array_equal(found.turns, np.flatnonzero(~lost))


@pytest.mark.parametrize("after", [0.1, 0.6, 2.0])
def test_doubled_pulses_are_named_and_left_out(after: float) -> None:
    shaft = Shaft(700.0, 30.0)
    pulses, echoes = shaft.pulses(3.0), Shaft(700.0, 30.0, 0.3 - after).pulses(3.0)
    both = np.sort(np.concatenate([pulses, echoes]))
    found = tachometer(both)
    assert np.isin(found.times, pulses).all()
    assert found.times.size >= pulses.size - 2
    assert len(found.doubled) >= echoes.size - 2
    assert not found.missing


def test_one_echo_among_many_turns() -> None:
    pulses = Shaft(700.0).pulses(2.0)
    found = tachometer(np.sort(np.append(pulses, pulses[40] + 0.002)))
    assert found.doubled == (pytest.approx(pulses[40] + 0.002),)
    assert np.array_equal(found.times, pulses)


@pytest.mark.parametrize("way", [1, -1])
def test_the_first_turns_from_standstill_are_no_defects(way: int) -> None:
    times = np.sqrt(np.arange(1, 400))
    found = tachometer(times if way == 1 else 30 - times[::-1])
    assert found.sound
    assert found.times.size >= 396


def test_a_pickup_that_fires_at_random_is_refused() -> None:
    times = np.sort(np.random.default_rng(3).uniform(0, 2, 300))
    with pytest.raises(AnalysisError, match="neither missing nor doubled"):
        tachometer(times)


def test_every_second_pulse_missing_shows_only_against_the_drive() -> None:
    pulses = Shaft(700.0).pulses(2.0)
    assert tachometer(pulses[::2]).sound
    assert against(tachometer(pulses[::2]), 700.0) == "missing"
    assert against(tachometer(pulses), 350.0) == "doubled"
    assert against(tachometer(pulses), 702.0) == ""


def telemetry(pulses: np.ndarray, until: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """At 1 kHz: time of the last reading, counter, angle and speed as the amb5dof rig's telemetry rounds them."""
    t = np.arange(1, int(until * 1000)) * 1e-3 - 1e-4
    count = np.searchsorted(pulses, t, side="right")
    known = count >= 2
    t, count = t[known], count[known]
    last, before = pulses[count - 1], pulses[count - 2]
    old, period = t - last, last - before
    speed = np.rint(2 * np.pi / np.maximum(period, old) / 0.0625) * 0.0625
    angle = 2 * np.pi * np.minimum(old / period, 1)
    angle = np.rint(((angle + np.pi) % (2 * np.pi) - np.pi) / 9.587379924285257e-5) * 9.587379924285257e-5
    return t, (count + 65500) % 65536, angle, speed


def test_pulses_by_counter_and_rounded_angle_of_telemetry() -> None:
    shaft = Shaft(900.0, 40.0)
    pulses = shaft.pulses(3.0)
    t, count, angle, speed = telemetry(pulses, 3.0)
    times, numbers = counted(t, count, age(angle, speed))
    assert np.abs(times - pulses[np.searchsorted(pulses, times - 1e-5)]).max() < 2e-7  # 1e-4 of a turn
    keep = np.mod(np.arange(t.size), 97) > 12  # lost samples: pulses not recorded, none missing
    times, numbers = counted(t[keep], count[keep], age(angle, speed)[keep])
    assert (np.diff(numbers) > 1).any()
    tacho = tachometer(times, numbers)
    assert tacho.sound
    at = np.linspace(0.1, 2.9, 50)
    assert np.ptp(tacho.angle(at) - shaft.angle(at)) < 5e-4


def test_two_pulses_within_a_sample_are_doubled_and_not_a_fast_shaft() -> None:
    shaft = Shaft(900.0)
    pulses = np.sort(np.concatenate([shaft.pulses(2.0), Shaft(900.0, 0, 0.3 - 0.5).pulses(2.0)]))
    t, count, angle, speed = telemetry(pulses, 2.0)
    tacho = tachometer(*counted(t, count, age(angle, speed)))
    assert not tacho.sound
    assert len(tacho.doubled) > 250


def test_edges_of_a_noisy_pickup() -> None:
    shaft = Shaft(300.0)
    t = np.arange(20_000) * 1e-4
    turn = np.mod(shaft.angle(t) + np.pi, 2 * np.pi) - np.pi
    volts = np.clip(5 + 10 * turn, 0, 10) * (np.abs(turn) < 1) + np.random.default_rng(0).normal(0, 0.2, t.size)
    found = edges(t, volts, 5.0, 2.0)
    assert np.abs(found - shaft.pulses(2.0)).max() < 2e-4


def test_a_phase_channel_that_starts_anew() -> None:
    shaft = Shaft(400.0)
    t = np.arange(10_000) * 1e-4
    times, numbers = wrapped(t, np.mod(shaft.angle(t), 2 * np.pi), np.full(t.size, 400.0))
    assert np.allclose(times, shaft.pulses(t[-1]), atol=1e-9)
    assert np.array_equal(np.diff(numbers), np.ones(times.size - 1))


def test_refusals() -> None:
    with pytest.raises(AnalysisError, match="expected four or more"):
        tachometer([0.0, 1.0, 2.0])
    with pytest.raises(AnalysisError, match="do not increase"):
        tachometer([0.0, 2.0, 1.0, 3.0])
    with pytest.raises(AnalysisError, match="runs backwards"):
        counted(np.arange(5.0), [5, 6, 2, 3, 4], np.zeros(5))


def _coarse_ramp(step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Pulses of a shaft that speeds up from 800 rad/s at 25 rad/s^2, told in steps of `step_s`, and their numbers."""
    pulses = Shaft(800.0, 25.0).pulses(4.0)
    return np.round(pulses / step_s) * step_s, np.arange(pulses.size)


def test_coarse_times_do_not_show_as_another_acceleration() -> None:
    """10 us are 0.14 % of a turn of 7 ms: from pulses as they are told the speed changes by three times what it does."""
    times, numbers = _coarse_ramp(1e-5)
    t = np.arange(0.2, 3.8, 1e-3)

    def slopes(step_s: float) -> np.ndarray:
        return np.gradient(tachometer(times, numbers, step_s).speed(t), t)

    assert np.mean(np.abs(slopes(0.0))) > 50
    assert np.mean(np.abs(slopes(1e-5))) == pytest.approx(25.0, abs=5.0)
    found = tachometer(times, numbers, 1e-5)
    assert np.allclose(found.speed(t), 800 + 25 * t, atol=0.3)
    assert np.allclose(
        found.angle(t) - found.angle(t)[0], Shaft(800.0, 25.0).angle(t) - Shaft(800.0, 25.0).angle(t)[0], atol=6e-3
    )


def test_fine_times_and_long_turns_stay_as_they_are() -> None:
    times, numbers = _coarse_ramp(1e-6)
    assert np.array_equal(tachometer(times, numbers, 1e-6).times, times)
    slow = np.round(Shaft(25.0, 0.0).pulses(4.0) / 1e-5) * 1e-5
    assert np.array_equal(tachometer(slow, None, 1e-5).times, slow)
    gaps = np.delete(numbers, slice(40, 400))
    assert np.abs(tachometer(times[gaps], gaps, 1e-5).times - times[gaps]).max() < 1e-5


def test_ages_of_pulses_that_have_just_been_counted() -> None:
    """Where a sample was lost, or two came at once, nothing is said of how old the last one may be."""
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 7.0, 8.0])
    seen = fresh(t, [4, 5, 5, 6, 8, 9, 9], [9.0, 0.3, 1.3, 0.8, 0.1, 2.9, 3.9])
    assert seen == Fresh(0.3, 0.8, 1.0)
    assert fresh(t, np.full(7, 4), np.zeros(7)) is None
