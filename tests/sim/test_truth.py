"""Draws and true quantities: the nominal machine is the thesis', and each quantity is what the core itself does."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from bench.errors import ConfigError
from bench.rigfile import RigFile, load_rig
from sim_backend.machines.tsbs.machine import DEFECTS
from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import derivative
from sim_backend.truth import draw, nominal

X, Y, THETA = 6, 7, 11


@cache
def rig() -> RigFile:
    return load_rig("tsbs12")


def force(p: PlantParams, segment: tuple[float, ...], theta: float = 0.0, gamma: float = 0.0) -> np.ndarray:
    """What the segment currents add to (F_x, F_y, torque) of a shaft at rest at the motor's magnetic centre."""
    s = np.zeros(14)
    s[0], s[1], s[5] = -p.motor_x, -p.motor_y, theta
    with_current, without = (derivative(p, s, np.zeros(10), np.array(i), gamma=gamma) for i in (segment, (0.0,) * 4))
    return (with_current - without)[[X, Y, THETA]] * np.array([p.mass, p.mass, p.polar_inertia])


def test_the_nominal_machine_is_that_of_the_thesis() -> None:
    """T Table 6.2 and (6.12)."""
    q = draw(rig(), 0, nominal(rig())).quantities
    printed = {
        "K_i": 73.2,
        "K_o": 74.4,
        "alpha_d": 12.1,
        "alpha_c": 14.3,
        "alpha_x_prime": 322.3e3,
        "alpha_tau": 2.87,
        "B": 0.081,
    }
    for name, value in printed.items():
        assert q[name] == pytest.approx(value, rel=0.012 if name.startswith("K") else 2e-4), name
    assert q["alpha_ratio"] == pytest.approx(12.1 / 14.3, rel=1e-12)
    assert q["gamma_0"] == 0


@pytest.mark.parametrize("seed", range(5))
def test_motor_quantities_are_what_the_core_does(seed: int) -> None:
    """By their definitions: a small current of each sign at the home angle, or over a turn."""
    truth = draw(rig(), seed)
    p, q = truth.plant, truth.quantities
    turn = 2 * math.pi * np.arange(9) / 9
    lift = np.mean([force(p, (1e-3, 0, -1e-3, 0), theta=t) for t in turn], axis=0) / 1e-3
    push = np.mean([force(p, (0, -1e-3, 0, 1e-3), theta=t) for t in turn], axis=0) / 1e-3
    assert lift[1] == pytest.approx(q["alpha_d"], rel=1e-4)
    assert push[0] == pytest.approx(q["alpha_dx"], rel=1e-4)
    home = q["gamma_0"]
    direct = force(p, (1e-3, 0, -1e-3, 0), gamma=home)[1] / 1e-3
    quarter = home + math.pi / 2 / p.pole_pairs
    assert -force(p, (1e-3, 0, -1e-3, 0), gamma=quarter)[0] / 1e-3 == pytest.approx(q["alpha_c"], rel=1e-4)
    mean = (p.segment_gain[0] + p.segment_gain[2]) / 2
    assert direct / q["alpha_c"] == pytest.approx(q["alpha_ratio"], rel=1e-4)
    assert direct == pytest.approx((p.alpha_d - p.alpha_2) * mean, rel=1e-4)
    assert force(p, (1e-3,) * 4, gamma=home)[2] / 1e-3 == pytest.approx(q["alpha_tau"], rel=1e-9)


def test_stiffness_is_referred_to_the_outboard_sensors() -> None:
    """T below (6.8): the shaft turns about the inboard sensors, so the motor moves (l_is + l_m)/(l_is + l_os) as far."""
    truth = draw(rig(), 3)
    p = truth.plant
    y, phi = 1e-6 * -p.z_sensor[0] / (p.z_sensor[1] - p.z_sensor[0]), -1e-6 / (p.z_sensor[1] - p.z_sensor[0])
    here, there = np.zeros(14), np.zeros(14)
    there[1], there[3] = y, phi
    assert y - p.z_sensor[1] * phi == pytest.approx(1e-6)
    assert y - p.z_sensor[0] * phi == pytest.approx(0, abs=1e-18)
    a, b = (derivative(p, s, np.zeros(10), np.zeros(4)) for s in (here, there))
    assert (b - a)[Y] * p.mass / 1e-6 == pytest.approx(truth.quantities["alpha_x_prime"], rel=1e-9)


@pytest.mark.parametrize(("bias", "name"), [(3.0, "B"), (4.0, "B_high")])
def test_drag_is_for_the_bias(bias: float, name: str) -> None:
    truth = draw(rig(), 4)
    p, s = truth.plant, np.zeros(14)
    s[11] = 1.0
    coil = np.array([*(bias,) * 8, 0.0, 0.0])
    slow = 1.0 / p.coulomb_speed
    dry = (p.coulomb + p.brake) * slow / math.sqrt(1 + slow**2) + p.detent * math.sin(p.detent_phase)
    found = -derivative(p, s, coil, np.zeros(4))[THETA] * p.polar_inertia - dry
    assert found == pytest.approx(truth.quantities[name], rel=1e-9)
    assert draw(rig(), 4, settings={"bias_i": 4.0, "bias_o": 4.0}).quantities["B"] == truth.quantities["B_high"]


def test_draws_come_from_the_tables_that_the_bench_reads() -> None:
    """Position and segment sensors, spans and the machine's table: within their half-widths, and not all alike."""
    values = [draw(rig(), seed).values for seed in range(20)]
    for name, middle, half in (
        ("position_gain_yo", 1.0, 0.01), ("position_offset_xi", 0.0, 1e-5), ("i_m1.gain", 1.0, 0.003),
        ("i_m4.offset", 0.0, 0.004), ("geometry.motor_to_outboard_amb", 0.112, 3e-4), ("asymmetry_o", 0.0, 0.03),
        ("polar_inertia", 0.033, 5e-4), ("alpha_2", 0.0, 0.3), ("drag_share", 0.6, 0.1),
    ):  # fmt: skip
        found = np.array([v[name] for v in values])
        assert np.abs(found - middle).max() <= half, name
        assert np.abs(found - middle).max() > 0.7 * half, name
    p = draw(rig(), 1).plant
    assert p.z_motor - p.z_amb[1] == pytest.approx(draw(rig(), 1).values["geometry.motor_to_outboard_amb"], rel=1e-12)
    assert p.z_lever == p.z_hook


def test_old_names_keep_their_numbers() -> None:
    """A stream is a hash of seed and name: what was drawn before the chain was added is drawn still. Written down once."""
    v = draw(rig(), 7).values
    written = {"i_yi_p.gain": 1.0000550022, "position_gain_yo": 0.9943250718, "segment_gain_3": 1.0064704970}
    written |= {"alpha_d": 11.9023413373, "i_xo_n.offset": 1.7581962110e-3}
    assert {name: v[name] for name in written} == pytest.approx(written, rel=1e-9)


def test_weights_on_the_lever() -> None:
    truth = draw(rig(), 5, {"mass_error_M2": 0.01})
    kg, newtons, arm = truth.on_lever("left", "M2")
    assert kg == pytest.approx(truth.values["masses.M2"] * 1.01, rel=1e-12)
    assert newtons / kg == pytest.approx(9.81175 * (1 - 1.11 / 7950), rel=1e-3)
    assert arm == truth.values["geometry.lever_left"]
    assert truth.on_lever("right", "") == (0.0, 0.0, -truth.values["geometry.lever_right"])


@pytest.mark.parametrize(
    ("name", "value", "field", "expected"),
    [
        ("exchange_segments", 1, "exchange_segments", 1.0),
        ("encoder_sign", -1, "encoder_sign", -1.0),
        ("lever_slip", 0.05, "lever_slip", 0.05),
        ("drive_brakes", 0.2, "brake", 0.2),
        ("segment_drift_2", 1e-3, "segment_drift", (..., ..., 1e-3, ...)),
        ("segment_scale_drift", 1e-5, "segment_scale_drift", 1e-5),
    ],
)
def test_defects_reach_the_plant(name: str, value: float, field: str, expected: object) -> None:
    found = getattr(
        draw(rig(), 6, {"drive_drag": 0.0, name: value}).plant, field
    )  # the brake is beside the drive's drag
    if isinstance(expected, tuple):
        assert all(a is ... or a == b for a, b in zip(expected, found, strict=True))
    else:
        assert found == expected
    harmless = draw(rig(), 6)
    assert all(harmless.defects[n] == v for n, v in DEFECTS.items())


def test_an_unknown_truth_is_refused() -> None:
    with pytest.raises(ConfigError, match="did you mean exchange_segments"):
        draw(rig(), 0, {"exchange_segment": 1})
