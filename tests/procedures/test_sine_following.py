"""Sines that a positioned stage follows: bare numbers, what is told of bad data, the whole path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limited import limit_of
from bench.record.limits import Verdict, judge
from bench.record.specs import applied, load_spec
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import Estimate, Influence, interval
from procedures.sine_following import checks
from procedures.sine_following.estimates import Group, grouped, truly
from procedures.sine_following.fit import followed, fundamental, largest, left_of, off_sine
from procedures.sine_following.plan import Plan
from procedures.sine_following.procedure import check, procedure, waves
from procedures.sine_following.requires import requires
from procedures.sine_following.steps import Ride, modes_of
from procedures.stages.tracks import Mode, Track
from reports.figures import draw as draw_figure

RLSRM = load_rig("rlsrm")
SHORT: dict[str, Any] = {"periods": 2, "period_s": 5.0}
COUNT, DEG, PERIOD = 1e-6, math.pi / 180, 5.0
T = np.arange(5000) * 1e-3


def run(folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    folder.mkdir(exist_ok=True)
    return simulated_run("sine-following", "rlsrm", seed, {**SHORT, **plan}, folder / "recording.mcap", truth or {})


def test_ratio_and_lag_by_hand() -> None:
    """0.99 of the set point, 12 ms late: 0.99 and 12 ms; its rms is A |r - e^(i d)|/sqrt 2 with d = w 12 ms."""
    reference = 0.01 * np.sin(2 * np.pi * T / PERIOD)
    read = 0.0099 * np.sin(2 * np.pi * (T - 0.012) / PERIOD)
    found, d = followed(T, read, reference, PERIOD, 1e-12), 2 * np.pi * 0.012 / PERIOD
    assert found.ratio == pytest.approx(0.99, abs=1e-9)
    assert found.lag == pytest.approx(0.012, abs=1e-9)
    assert found.rms == pytest.approx(0.01 * math.hypot(0.99 - math.cos(d), math.sin(d)) / math.sqrt(2), rel=1e-6)
    assert found.ahead.value == pytest.approx(math.sqrt(2) * found.rms, rel=1e-4)
    assert abs(fundamental(T, reference, PERIOD)) == pytest.approx(0.01)


def rounded_ride(shift: float, size: float = 100.0, error: float = 5.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place, reading and set point in counts: the place lags by a sine of its own, and stands around its turns."""
    reference = size * np.sin(2 * np.pi * T / PERIOD)
    place = reference - error * np.cos(2 * np.pi * T / PERIOD) + shift
    turn = size - 0.5 * error + 0.7 * shift
    place = np.clip(place, -turn, turn)
    return place, np.round(place), reference


def test_rounding_is_taken_off_and_what_is_left_is_told() -> None:
    """Over where the edges lie: 95 % of each number are within 3 u."""
    off: dict[str, list[float]] = {}
    for shift in np.linspace(-0.5, 0.5, 40, endpoint=False):
        place, read, reference = rounded_ride(float(shift))
        a, b = followed(T, read, reference, PERIOD, 1.0), followed(T, place, reference, PERIOD, 1e-9)
        for name, x, y, u in (
            ("ahead", a.ahead.value, b.ahead.value, a.ahead.u), ("rms", a.rms, b.rms, a.u_rms),
            ("ratio", a.ratio, b.ratio, a.u_ratio), ("lag", a.lag, b.lag, a.u_lag),
        ):  # fmt: skip
            off.setdefault(name, []).append((x - y) / u)
    for name, each in off.items():
        assert np.quantile(np.abs(each), 0.95) < 2.9, name
        assert np.quantile(np.abs(each), 0.95) > 0.5, name


def test_rounding_alone_is_no_rms() -> None:
    """An axis that is where it is sent reads 0.29 counts off in the rms: that is rounding."""
    reference = 100 * np.sin(2 * np.pi * T / PERIOD)
    assert np.sqrt(((np.round(reference) - reference) ** 2).mean()) == pytest.approx(0.289, abs=0.01)
    found = followed(T, np.round(reference), reference, PERIOD, 1.0)
    assert found.rms < 0.1
    assert found.u_rms == pytest.approx(0.289, abs=0.001)


def test_one_reading_leaves_half_a_count_open() -> None:
    """u of a rectangle; of a place that goes through many counts hardly anything, and what it adds is taken off."""
    stuck = largest(np.sin(T), np.zeros(5000), 0.5)
    assert stuck.u == pytest.approx(0.5 / math.sqrt(3), rel=0.1)
    swept = largest(np.round(T * 1e3) - T * 1e3 + np.zeros(5000), np.round(T * 1e3), 0.5)
    assert swept.u < 0.05
    weights = np.full(5000, 1 / 5000)
    assert left_of(weights, np.zeros(5000), 0.5) == pytest.approx(0.5 / math.sqrt(3))
    assert left_of(weights, np.floor(np.arange(5000) / 10), 0.5) == pytest.approx(
        0.5 / math.sqrt(3) / math.sqrt(500) / math.sqrt(10), rel=0.03
    )


def test_the_larger_of_both_sides_grows_by_what_is_off() -> None:
    """Two sides alike, off by one constant against each other: E |c| of a rectangle is a/2, and nearly so of a normal one."""
    axis = replace(axes_of(RLSRM)["angle"], error=None)
    track = Track(axis, T, T, T, T, T, (), 0, 1)
    group = Group(Ride(Mode("angle", (axis,)), track), "angle", [])
    side = Estimate.of(1.0, Influence("none", "", 1e-9, "rad", "B", "normal"))
    found, half = truly(group, side, side, Plan()), axis.pitch.value / 2  # type: ignore[union-attr]
    assert found.value - 1 == pytest.approx(half / 2, rel=0.1)
    assert interval(found).high - 1 == pytest.approx(0.975 * half, rel=0.01)


def rides(
    amplitude: float = 10e-3, followed_by: float = 1.0, lost: int = 0, periods: int = 2
) -> tuple[list[Ride], Plan]:
    plan, axis = Plan(moved="stroke", periods=periods), axes_of(RLSRM)["x"]
    t = np.arange(10_050) * 1e-3
    reference = amplitude * np.sin(2 * np.pi * t / PERIOD)
    read = np.round(followed_by * reference / COUNT) * COUNT
    track = Track(axis, t, read, reference, np.zeros(10_050), np.zeros(10_050), ("MOVING",), lost, 10_050)
    return [Ride(Mode("x", (axis,)), track)], plan


def of_rides(found: tuple[list[Ride], Plan]) -> set[str]:
    return {f.code for f in checks.of_rides(found[0], RLSRM, found[1])}


def test_what_is_told_of_bad_data() -> None:
    assert of_rides(rides()) == set()
    assert of_rides(rides(amplitude=9.8e-3)) == {"set-point-elsewhere"}
    assert of_rides(rides(followed_by=0.0)) == {"never-moved"}
    assert of_rides(rides(lost=100)) == {"missing-samples"}
    assert of_rides(rides(periods=3)) == {"periods-missing"}
    some, plan = rides(followed_by=0.3)
    told = {f.code: f.effect for f in checks.of_groups(grouped(some, plan), RLSRM, plan)}
    assert told == {"axis-lags-its-sine": Effect.NOTE, "reading-quantised": Effect.NOTE}
    ramp = np.abs((T * 0.4) % 2 - 1)
    assert off_sine(T, ramp, PERIOD, 1.0) > 0.05


def test_what_is_written_before_a_mode() -> None:
    axes, plan = list(axes_of(RLSRM).values()), Plan()
    alone, _, together = (waves(axes, mode, plan) for mode in modes_of(RLSRM, plan))
    assert (alone["x_wave"], alone["x_amplitude"], alone["angle_wave"], alone["angle_amplitude"]) == (1, 10e-3, 0, 0)
    assert (together["x_phase"], together["angle_phase"]) == (0.25, 0)
    assert not list(check(RLSRM, plan))
    assert not requires(RLSRM).lacking(RLSRM)
    assert [p[:11] for p in check(RLSRM, Plan(amplitude_m=0.02))] == ["amplitude_m"]
    assert [p[:8] for p in check(RLSRM, Plan(shaped_s=6.0))] == ["shaped_s"]


def test_a_drawn_machine_follows_and_passes(tmp_path: Path) -> None:
    done = run(tmp_path)
    truth = truth_of_motion(done)
    measured = [r for r in done.results if isinstance(r, Measured)]
    assert len(measured) == 5 * 4
    outside = []
    for r in measured:
        found = interval(r.estimate)
        if not found.low <= truth[f"{r.quantity.name}@{r.where}"] <= found.high:
            outside.append((r.quantity.name, r.where))
    assert len(outside) <= 2
    limits, _ = applied(load_spec("rlsrm", "sine-following", procedure, rig=RLSRM), done.recording.plan)
    judged = {judge(interval(r.estimate), limit_of(limits, r.quantity.name, r.where)) for r in measured}
    assert judged == {Verdict.PASS, Verdict.NONE}
    assert {r.code for r in done.results if isinstance(r, Finding)} == {"reading-quantised"}
    figures = list(procedure.figures(procedure.evaluated(done.recording).result, done.recording))
    assert len(figures) == 4
    assert draw_figure(figures[0])


def test_a_brake_makes_it_fail(tmp_path: Path) -> None:
    done = run(tmp_path, truth={"brake_angle": 0.05}, moved="angle")
    limits, _ = applied(load_spec("rlsrm", "sine-following", procedure, rig=RLSRM), done.recording.plan)
    judged = {judge(interval(r.estimate), limit_of(limits, r.quantity.name, r.where))
              for r in done.results if isinstance(r, Measured)}  # fmt: skip
    assert Verdict.FAIL in judged
