"""What the spindown's checks say of run-downs made on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.findings import Effect
from bench.rigfile import load_rig
from procedures.servomotor.conventions import conventions
from procedures.spindown import checks, estimates, fit
from procedures.spindown.plan import Plan
from procedures.spindown.requires import coils
from procedures.spindown.steps import ANGLE_LAGS, SPEED_LAGS, RunDown

MACHINE = conventions(load_rig("tsbs12"))
J, COUNT = 0.033, 2 * np.pi / 4096


def made(
    bias: float, direction: int, repeat: int, *, b: float = 0.0, extra: float = 0.0, speed_scale: float = 1.0
) -> RunDown:
    """A run-down as an encoder of 4096 counts and a filtered speed would show it."""
    rate, c = b or (0.081 if bias == 3.0 else 0.13) / J, 0.05 / J + extra
    t = np.arange(0, 1.0, 1e-3)
    rng = np.random.default_rng([int(10 * bias), direction + 2, repeat])
    start = 46.0 + rng.uniform(-0.5, 0.5)
    angle = np.floor((fit.angle(t, rate, c, start) + rng.uniform(0, COUNT)) / COUNT) * COUNT
    scale = 1 / (1 - rate / (2 * np.pi * 20))
    seen = speed_scale * ((fit.speed(t, rate, c, start) + c / rate) * scale - c / rate) + 0.01 * rng.normal(size=len(t))
    return RunDown(
        bias, direction, repeat, False, t, seen, angle - angle[0], fit.of_speed(t, seen, SPEED_LAGS),
        fit.of_angle(t, angle - angle[0], ANGLE_LAGS), dict.fromkeys(coils(MACHINE), bias), np.zeros(4), 0, 1000, 0,
    )  # fmt: skip


def sound() -> list[RunDown]:
    return [made(bias, d, k) for bias in (3.0, 4.0) for k in (0, 1) for d in (1, -1)]


def codes(runs: list[RunDown]) -> set[str]:
    rig, plan = load_rig("tsbs12"), Plan()
    angle, speed = (estimates.evaluate(runs, rig, m, Plan()) for m in ("angle", "speed"))
    found = [*checks.of_runs(runs, MACHINE, plan), *checks.of_result(runs, angle, speed, plan)]
    return {f.code for f in found if f.effect is not Effect.NOTE}


def test_sound_run_downs_are_sound() -> None:
    assert codes(sound()) == set()
    found = estimates.evaluate(sound(), load_rig("tsbs12"), "angle", Plan()).estimates
    assert found["B"].value == pytest.approx(0.081, rel=1e-3)
    assert found["B_high"].value == pytest.approx(0.13, rel=1e-3)
    assert found["T_c"].value == pytest.approx(0.05 - 0.005, rel=0.01)  # less the drag that the rig file states


def test_a_speed_of_another_scale_is_told() -> None:
    runs = [made(r.bias_A, r.direction, r.repeat, speed_scale=1.01) for r in sound()]
    assert "speed-and-angle-disagree" in codes(runs)


def test_a_constant_torque_drops_out_and_is_told() -> None:
    runs = [made(r.bias_A, r.direction, r.repeat, extra=-r.direction * 0.03 / J) for r in sound()]
    found = estimates.evaluate(runs, load_rig("tsbs12"), "angle", Plan())
    assert found.seen.value == pytest.approx(0.05, rel=0.02)
    assert found.torque.value == pytest.approx(0.03, rel=0.02)
    assert "constant-torque" in codes(runs)


def test_a_decay_that_depends_on_the_direction_is_told() -> None:
    runs = [r if r.direction > 0 else made(r.bias_A, -1, r.repeat, b=1.02 * r.of_angle.b) for r in sound()]
    assert "direction-dependent" in codes(runs)


def test_repeats_that_differ_are_told() -> None:
    runs = [r if r.repeat == 0 else made(r.bias_A, r.direction, 1, b=1.05 * r.of_angle.b) for r in sound()]
    assert "not-repeatable" in codes(runs)
    wide = estimates.evaluate(runs, load_rig("tsbs12"), "angle", Plan()).estimates["B"]
    assert wide.u > 1.3 * estimates.evaluate(sound(), load_rig("tsbs12"), "angle", Plan()).estimates["B"].u


def test_current_in_a_released_motor_is_told() -> None:
    runs = [replace(r, segments=np.array([0.0, 0.1, 0.0, 0.0])) for r in sound()]
    assert "not-released" in codes(runs)


def test_the_bias_is_what_the_currents_say() -> None:
    """Both sensors of an axis 1 % high: the true bias is lower, and B at exactly 3 A is higher than what coasted."""
    rig = load_rig("tsbs12")
    runs = [replace(r, coils={c: i * 1.01 for c, i in r.coils.items()}) for r in sound()]
    as_read = estimates.evaluate(runs, rig, "angle", Plan()).estimates["B"].value
    assert as_read < estimates.evaluate(sound(), rig, "angle", Plan()).estimates["B"].value


@pytest.mark.parametrize("motor", [0.0, 0.009, -0.02])
def test_what_drives_the_released_rotor_drops_out_of_the_drives_torque(motor: float) -> None:
    """A constant torque of the motor helps one way and brakes the other: the mean over both is free of it."""
    speeds = [way * share * 50 for way in (1, -1) for share in (0.1, 0.15, 0.2, 0.25, 0.3, 1)]
    held = [(w, np.array([round((0.081 * w + np.sign(w) * 0.034 - motor) / 0.01) * 0.01])) for w in speeds]
    found = checks.constant_torque(held)
    assert found is not None
    assert found[1] < 2e-3
    assert found[0] == pytest.approx(0.034, abs=3 * found[1])


@pytest.mark.parametrize("held", [[], [(50.0, 4.0), (5.0, 0.4)], [(50.0, 4.0), (-50.0, -4.0)]])
def test_one_way_or_one_speed_says_nothing_of_the_drives_constant_torque(held: list[tuple[float, float]]) -> None:
    assert checks.constant_torque([(w, np.array([torque])) for w, torque in held]) is None


def test_readings_that_scatter_leave_the_drives_constant_torque_open() -> None:
    """Four readings a speed that scatter by 11 mN m: 4.3 mN m too little was 3.5 of a u that knew their rounding alone."""
    rng, off = np.random.default_rng(1), []
    speeds = [way * share * 50 for way in (1, -1) for share in (0.1, 0.15, 0.2, 0.25, 0.3, 1)]
    for _ in range(300):
        held = [(w, 0.081 * w + np.sign(w) * 0.034 + rng.normal(0, 0.011, 4)) for w in speeds]
        found = checks.constant_torque(held)
        assert found is not None
        off.append((found[0] - 0.034) / found[1])
    assert float(np.std(off)) == pytest.approx(1.0, abs=0.15)
