"""The one-axis AMB: integrator, estimators and observers against the thesis' equations, and what they do on drawn stands."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from bench.rigfile import load_rig
from procedures.one_axis.bank import bank
from sim_backend.core import LEVITATE
from sim_backend.machines.amb1dof.params import ControlParams, PlantParams
from sim_backend.machines.amb1dof.plant import TRACE, Plant, ccs, gains
from sim_backend.truth import draw, nominal

Array = npt.NDArray[np.float64]
AT = {name: k for k, name in enumerate(TRACE)}
DIFFERENCE, SINGLE, OVERLAPPING, OBSERVER = 0.0, 1.0, 2.0, 3.0
PRINTED = PlantParams(amplifier_rate=0.0)  # the thesis' own: currents as they are told


def rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))


def levitated(params: PlantParams, seed: int = 0, **control: float) -> Plant:
    """Let go 0.1 mm from the middle, as in T 4.5."""
    plant = Plant(params, seed, control=replace(ControlParams(), **control))
    plant.put(1e-4)
    plant.mode = LEVITATE
    return plant


def mean_over_phases(estimator: float, count: int, **control: float) -> dict[str, float]:
    """B2: errors of velocity and disturbance before the compensation is engaged, and the position 50 to 100 ms after it."""
    rows = []
    for k in range(count):
        plant = levitated(PRINTED, k, estimator=estimator, **control)
        a = plant.run(5000 + 43 * k, 1)[1][3000:5000]
        plant.set("compensate", 1.0)
        b = plant.run(1000, 1)[1]
        v, told = a[:, AT["true_velocity"]], a[:, AT["load"]] + a[:, AT["harmonic"]]
        true = 2 + np.sin(80 * math.pi * np.arange(3000, 5000) * 1e-4)
        rows.append([rms(a[:, AT["velocity"]] - v) / rms(v), rms(told - true), rms(b[500:, AT["position"]])])
    return dict(zip(("velocity", "disturbance", "y"), np.mean(rows, axis=0).tolist(), strict=True))


def loaded(params: PlantParams, seed: int, estimator: float, **control: float) -> tuple[float, float]:
    """B3: peak m and integral of |y| m s after a load of 2 N."""
    plant = levitated(params, seed, estimator=estimator, compensate=1.0, **control)
    plant.run(30000)
    plant.load(2.0)
    y = plant.run(10000, 1)[1][:, AT["position"]]
    return float(y.max()), float(np.abs(y).mean())


def test_gains_follow_from_the_poles() -> None:
    """By numpy's polynomials: the error dynamics of (4.22) and of (4.21) have the poles that were asked for."""
    control, w, m = ControlParams(), 80 * math.pi, 0.4
    h, g = gains(control)
    assert np.sort(np.roots([1, h[0] + h[1], h[2] + w * w, h[0] * w * w]).real) == pytest.approx(
        [-400, -400, -5], rel=1e-4
    )
    made = [1, g[0], g[1] + w * w, g[0] * w * w + (g[2] + g[3]) / m, g[1] * w * w + g[4] / m, g[2] * w * w / m]
    assert made == pytest.approx(np.poly([-2500, -2500, -5, -400, -400]), rel=1e-9)
    ratio = m * h[0] * (g[1] + control.kv * g[0]) / g[2]
    assert ratio == pytest.approx(1.753, abs=1e-3)


@pytest.mark.parametrize(("force", "y"), [(3.0, 1e-4), (-7.0, -2e-4), (0.5, 0.0), (15.0, -3e-4)])
def test_the_current_gives_the_force(force: float, y: float) -> None:
    i = ccs(force, 5e-6, 8e-4, y, 1.0)
    assert 5e-6 * (((1 + i) / (8e-4 - y)) ** 2 - ((1 - i) / (8e-4 + y)) ** 2) == pytest.approx(force, rel=1e-9)


def test_one_step_of_a_sample_is_enough() -> None:
    """Against scipy's DOP853, tick by tick with the currents that the loop sent: less than 1e-7 of the motion."""
    plant = levitated(replace(PRINTED, position_noise=0.0, current_noise=0.0), estimator=DIFFERENCE)
    p, worst = plant.params, 0.0
    for k in range(300):
        before = plant.state
        plant.run(1)
        i = plant.currents

        def rate(t: float, s: Array, i: tuple[float, ...] = i, k: int = k) -> list[float]:
            pull = p.beta * ((i[0] / (p.gap - s[0])) ** 2 - (i[1] / (p.gap + s[0])) ** 2)
            return [s[1], (pull + p.load + p.harmonic * math.sin(p.harmonic_rate * (k * 1e-4 + t))) / p.mass]

        right = solve_ivp(rate, (0, 1e-4), before, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        worst = max(worst, abs(plant.state[0] - right[0]))
    assert worst < 1e-7 * 1e-4


@pytest.mark.parametrize("rule", ["euler", "first-off", "exact"])
@pytest.mark.parametrize(("degree", "window_s"), [(7, 0.012), (6, 0.009)])
def test_the_firmware_is_its_weights(rule: Any, degree: int, window_s: float) -> None:
    """The recursion (4.13)-(4.14) beside the weights in closed form, on noise."""
    code = float(["euler", "first-off", "exact"].index(rule))
    plant = Plant(control=ControlParams(degree=degree, window_s=window_s, rule=code))
    y = np.random.default_rng(1).normal(size=1200)
    weights = bank(degree, round(window_s / 1e-4), rule, 1e-4)
    at, length = (len(weights.rows[0]) - 1) % weights.spacing, 2 * weights.spacing
    expected = weights.applied(y, (at - weights.spacing) % weights.spacing)
    told = plant.watch(y)[length - 1 :]
    assert np.abs(told - expected)[weights.spacing :].max() < 1e-6 * rms(expected)


@pytest.mark.parametrize(
    ("defect", "least"),
    [("literal_sign", (79.02, 19.75, 10.05)), ("literal_weights", (13.17, 3.30, 1.50))],
)
def test_literal_equations_fail(defect: str, least: tuple[float, ...]) -> None:
    """(4.11) with + before the terms in y, (4.10) and (4.15) without their sign: errors at 10, 40 and 80 Hz of over 100 %."""
    plant = Plant(replace(PRINTED, **{defect: 1.0}))
    t = np.arange(24000) * 1e-4
    for hz, error in zip((10.0, 40.0, 80.0), least, strict=True):
        w = 2 * math.pi * hz
        off = plant.watch(np.sin(w * t)) / w - np.cos(w * t)
        assert math.sqrt(2) * rms(off[4000:]) == pytest.approx(error, rel=0.05)
        assert math.sqrt(2) * rms(off[4000:]) > 1


def test_a_constant_has_a_false_derivative() -> None:
    """Degree 7, 12 ms, Euler: 0.1 mm reads as 1.4 mm/s; with the first sample off, and with exact weights, as nothing."""
    told = [
        Plant(control=ControlParams(rule=rule)).watch(np.full(2400, 1e-4))[1200:].mean() for rule in (0.0, 1.0, 2.0)
    ]
    assert told[0] == pytest.approx(1.437e-3, rel=1e-3)
    assert np.abs(told[1:]).max() < 1e-9


def test_overlapping_estimates_are_better_than_one_alone() -> None:
    """B2 on the printed machine, over phases of engaging: 28.5 and 9.2 %, 0.69 and 0.20 N, 7.8 and 1.9 um."""
    single, two = mean_over_phases(SINGLE, 5), mean_over_phases(OVERLAPPING, 5)
    assert (single["velocity"], two["velocity"]) == pytest.approx((0.287, 0.097), abs=0.006)
    assert (single["disturbance"], two["disturbance"]) == pytest.approx((0.69, 0.20), abs=0.02)
    assert (single["y"], two["y"]) == pytest.approx((7.8e-6, 1.9e-6), abs=1.5e-6)


def test_a_load_moves_the_full_observers_loop_more() -> None:
    """B3 on the printed machine: 24 and 41 um, 4.2 and 7.5 um s; a filtered difference does as well as the algebraic one."""
    found = {
        way: np.mean([loaded(PRINTED, s, way) for s in range(2)], axis=0) for way in (DIFFERENCE, OVERLAPPING, OBSERVER)
    }
    assert found[OVERLAPPING] == pytest.approx((24.3e-6, 4.2e-6), rel=0.03)
    assert found[OBSERVER] == pytest.approx((41.3e-6, 7.47e-6), rel=0.03)
    assert found[DIFFERENCE] == pytest.approx((23.2e-6, 4.25e-6), rel=0.03)


def test_a_slow_pole_of_300_turns_the_finding_round() -> None:
    """Table 4.1 read in another way: 14 um with the full observer, 24 with the reduced one at -5."""
    full, two = loaded(PRINTED, 0, OBSERVER, pole_slow=-300.0), loaded(PRINTED, 0, OVERLAPPING)
    assert full[0] == pytest.approx(14.1e-6, rel=0.05)
    assert full[0] < 0.7 * two[0]


def test_the_algebraic_estimate_is_noisier_in_every_band() -> None:
    """Estimate less what the same loop estimates without noise, mm/s rms."""
    bands, found = ((100, 300), (300, 1000), (1000, 5000)), {}
    for way in (OVERLAPPING, OBSERVER):
        with_noise, without = (
            levitated(replace(PRINTED, position_noise=u), estimator=way, compensate=1.0)
            for u in (PRINTED.position_noise, 0.0)
        )
        off = np.subtract(*(p.run(60000, 1)[1][20000:, AT["velocity"]] for p in (with_noise, without)))
        power, hz = np.abs(np.fft.rfft(off)) ** 2, np.fft.rfftfreq(len(off), 1e-4)
        found[way] = [1e3 * math.sqrt(2 * power[(hz >= a) & (hz < b)].sum()) / len(off) for a, b in bands]
    assert found[OVERLAPPING] == pytest.approx([0.089, 0.170, 0.315], rel=0.06)
    assert found[OBSERVER] == pytest.approx([0.045, 0.115, 0.123], rel=0.06)


@pytest.mark.parametrize("seed", range(4))
def test_ratios_hold_on_drawn_stands(seed: int) -> None:
    plant = draw(load_rig("amb1dof"), seed).plant
    two, full = loaded(plant, seed, OVERLAPPING), loaded(plant, seed, OBSERVER)
    assert 1.5 < full[0] / two[0] < 2.0
    assert 1.65 < full[1] / two[1] < 1.85


def test_a_spacing_of_6_ms_alone_throws_the_body_against_its_ring() -> None:
    rows = levitated(PRINTED, estimator=SINGLE, single_window_s=0.006, compensate=1.0).run(12000)
    assert 4 in rows[:, -1]


def test_the_file_is_the_nominal_machine() -> None:
    rig = load_rig("amb1dof")
    made = draw(rig, 1, nominal(rig)).plant
    for name, value in vars(PlantParams()).items():
        assert getattr(made, name) == pytest.approx(value), name
    for name, value in vars(ControlParams()).items():
        assert rig.parameters[name].default == pytest.approx(value), name
