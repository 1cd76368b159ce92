"""The AMB stand's core against its Python reference, the reference against scipy, and the order of the integrator."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from amb_plants import RPM, quiet

from sim_backend.core import LEVITATE, LIFT, OFF, DriveLaw
from sim_backend.machines.amb5dof import reference
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams, runout
from sim_backend.machines.amb5dof.plant import AmbPlant, derivative
from sim_backend.machines.amb5dof.reference_loop import Advance, Trace, dop853, runge_kutta, simulate

Array = npt.NDArray[np.float64]
TICKS = 500
START = np.array([2e-6, 5e-6, -8e-6, 3e-5, -5e-5, 0.4, *(0.0,) * 5, 14000 * RPM, *(0.0,) * 8])
NEARER = np.array([2e-6, 1e-5, 2e-5, 3e-5, -2e-5, 0.4, *(0.0,) * 5, 9000 * RPM, *(0.0,) * 8])
RESTING = np.array([0.0, -7.1e-5, -7.1e-5, *(0.0,) * 17])
WEIGHT = 2e-6


def blemished(**changes: Any) -> AmbParams:
    """A quiet machine with every error that the loop can have."""
    rng = np.random.default_rng(3)
    errors: dict[str, Any] = {
        "beta": tuple(np.array(AmbParams().beta) * (1 + 0.03 * rng.uniform(-1, 1, 5))),
        "offset": tuple(1.15e-4 * (1 + 0.1 * rng.uniform(-1, 1, 4))),
        "current_gain": tuple(1 + 0.003 * rng.uniform(-1, 1, 10)),
        "current_offset": tuple(0.004 * rng.uniform(-1, 1, 10)),
        "position_gain": tuple(1 + 0.01 * rng.uniform(-1, 1, 5)),
        "position_offset": tuple(2e-6 * rng.uniform(-1, 1, 5)),
        "coupling_offset": (3e-5, -2e-5),
        "pulse_angle": 0.3,
        "u_max": 1e9,
        "trip_speed": 1e9,
        **runout((2e-6, 1e-6, 5e-7, 2e-7), (1e-6, 5e-7, 3e-7, 1e-7), (0.1, 0.2, 0.3, 0.4), (1.0, 2.0, 3.0, 4.0)),
    }
    return quiet(**errors | changes)


def run_core(
    p: AmbParams, c: AmbControl, start: Array, ticks: int, drive: float | None = None, mode: int = LEVITATE
) -> Trace:
    """What `simulate` does, by the core, tick by tick."""
    plant = AmbPlant(p, control=c)
    plant.set_state(start)
    plant.mode = mode
    if drive is not None:
        plant.drive(DriveLaw(0.02, 0.2, 500.0), drive)
    plant.weights(1, WEIGHT, 0.7)
    states, currents = [start], [np.zeros(10)]
    for _ in range(ticks):
        plant.run(1)
        now = plant.state()
        states.append(now["s"])
        currents.append(now["coil"])
    assert plant.trips == 0
    return Trace(np.array(states), np.array(currents))


def by_reference(
    p: AmbParams, c: AmbControl, start: Array, ticks: int, drive: float | None = None, advance: Advance = runge_kutta
) -> Trace:
    law = None if drive is None else (DriveLaw(0.02, 0.2, 500.0), drive)
    return simulate(p, c, list(start), ticks, drive=law, weights=(0j, WEIGHT * np.exp(0.7j)), advance=advance)


def error(a: Array, b: Array) -> float:
    """Largest over the columns of max |a - b| / max |b|."""
    return float((np.abs(a - b).max(axis=0) / np.maximum(np.abs(b).max(axis=0), 1e-12)).max())


@pytest.mark.parametrize("spread", [1.0, 6.0], ids=["free", "in contact"])
@pytest.mark.parametrize("modes", [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
def test_right_hand_side_equals_the_core(spread: float, modes: tuple[float, float]) -> None:
    rng = np.random.default_rng(2)
    scale = np.array([5e-5, 3e-5, 3e-5, 2e-4, 2e-4, 3, 0.02, 0.02, 0.02, 0.3, 0.3, 900, *[1e-6] * 4, *[1e-2] * 4])
    scale[12:] *= np.repeat([modes, modes], 2, axis=1).ravel()
    p, touched = blemished(mode_on=modes), 0
    for _ in range(100):
        s = scale * rng.normal(size=20) * np.where(np.arange(20) < 5, spread, 1)
        coil, torque = rng.uniform(0, 3, 10), rng.uniform(-0.01, 0.01)
        np.testing.assert_allclose(
            derivative(p, s, coil, torque), reference.derivative(p, s, coil, torque), rtol=1e-12, atol=1e-11
        )
        touched += any(np.hypot(s[1] + z * s[4], s[2] - z * s[3]) > p.clearance for z in (-p.l_is, p.l_os))
    assert touched > 80 if spread > 1 else touched < 30


ELLIPSE = {"ellipse_on": 1.0, "ellipse_y": 3e-5, "ellipse_z": 5e-5, "ellipse_hz": 20.0, "ellipse_ramp_s": 0.05}
NOTCHED = {"notch1_hz": 650.0, "notch1_q": 2.0, "notch2_hz": 1240.0, "notch2_q": 2.0}
OBSERVED = {"observer": 1.0, "compensate": 3.0, "integral": 0.0}


@pytest.mark.parametrize(
    ("law", "settings", "change", "drive"),
    [
        (0, {}, {}, None),
        (1, {}, {}, 15000 * RPM),
        (2, {}, {}, None),
        (1, {}, {"hum": (2e-6, 1e-6, 0.0, 3e-6, 0.0), "hum_hz": 170.0}, None),
        (1, OBSERVED, {}, None),
        (2, OBSERVED, {}, 9000 * RPM),
        (1, {"observer": 2.0, "compensate": 3.0}, {}, None),
        (2, NOTCHED | {"inject_axis": 2.0, "inject_amplitude": 0.01, "inject_lines": 5.0, "inject_step": 30.0},
         {"mode_on": (1.0, 1.0), "pulse_missing": 3.0}, None),
        (0, NOTCHED, {"mode_on": (1.0, 0.0), "pulse_doubled": 2.0, "pulse_last": 12.0}, None),
    ],
    ids=["PID", "CCS", "CAC", "hum", "CCS observer", "CAC observer", "literal observer", "CAC flexible", "PID flexible"],
)  # fmt: skip
def test_core_equals_the_reference_in_closed_loop(
    law: int, settings: dict[str, float], change: dict[str, Any], drive: float | None
) -> None:
    """0.05 s (0.04 s with settings) from a tilted start at 14 000 r/min (9 000 with bending)."""
    p, c = blemished(**change), AmbControl(law=law, **settings)
    start, n = (NEARER, 20) if any(p.mode_on) else (START, 12)  # the ring, and so smaller steps, is never near
    ticks = TICKS if not settings else 400
    core, python = run_core(p, c, start, ticks, drive), by_reference(p, c, start, ticks, drive)
    assert error(core.s[:, :n], python.s[:, :n]) < 1e-6
    assert np.abs(core.coil - python.coil).max() < 1e-6


@pytest.mark.parametrize(("law", "ratio"), [(0, 1.0), (1, 1.0), (2, 1.0), (1, 2.0)])
def test_references_equal_the_reference(law: int, ratio: float) -> None:
    """An ellipse, or another figure of Lissajous, that is ramped in at rest."""
    start = START.copy()
    start[11] = 0.0
    p, c = blemished(), AmbControl(law=law, ref_y=1e-5, ref_psi=2e-5, ellipse_ratio=ratio, **ELLIPSE)
    core, python = run_core(p, c, start, 600), by_reference(p, c, start, 600)
    assert np.abs(core.s[:, 2]).max() > 4.5e-5
    assert error(core.s[:, :5], python.s[:, :5]) < 1e-6


@pytest.mark.parametrize(
    "change",
    [
        {"beta": (6.96e-7,) * 4 + (5e-6,)},
        {"polar_inertia": 1.72e-4},
        {"coupling": 1210.0},
        {"coupling_offset": (2e-5, 0.0)},
    ],
)
def test_the_comparison_sees_a_small_difference(change: dict[str, Any]) -> None:
    p, c = quiet(), AmbControl(law=1.0)
    core = run_core(p, c, START, 300)
    other = by_reference(dataclasses.replace(p, **change), c, START, 300)
    assert error(core.s[:, :5], other.s[:, :5]) > 1e-5


def test_reference_against_dop853_and_order_of_convergence() -> None:
    p, c, ticks = blemished(), AmbControl(law=1.0), 150
    exact = by_reference(p, c, START, ticks, advance=dop853).s[:, :12]

    def off(steps: int) -> float:
        return error(by_reference(p, c, START, ticks, advance=lambda f, s: runge_kutta(f, s, steps)).s[:, :12], exact)

    errors = [off(n) for n in (1, 2, 4)]
    assert errors[1] < 1e-6
    np.testing.assert_allclose(np.log2(errors[:2]) - np.log2(errors[1:]), 4, atol=0.3)


def test_core_converges_with_its_substeps_to_the_reference() -> None:
    p, c = blemished(), AmbControl(law=1.0)
    plant = AmbPlant(p, control=c, substeps=8)
    plant.set_state(START)
    plant.mode = LEVITATE
    plant.weights(1, WEIGHT, 0.7)
    plant.run(80)
    fine = by_reference(p, c, START, 80, advance=lambda f, s: runge_kutta(f, s, 8)).s[-1]
    coarse = by_reference(p, c, START, 80).s[-1]
    found = plant.state()["s"]
    np.testing.assert_allclose(found[:12], fine[:12], rtol=1e-9, atol=1e-15)
    assert np.abs(found - coarse)[:3].max() > 1e-14


def test_the_start_from_the_rings_is_the_same_for_both() -> None:
    """Lifted from rest: the trajectories part at the rings, where times of contact matter, and meet again."""
    p, c = quiet(), AmbControl(law=1.0, lift_time_s=0.05)
    python = simulate(p, c, list(RESTING), 800, mode=LIFT, advance=lambda f, s: runge_kutta(f, s, 5)).s
    plant = AmbPlant(p, control=c)
    plant.set_state(RESTING)
    assert plant.mode == OFF
    plant.mode = LIFT
    plant.run(800)
    np.testing.assert_allclose(plant.state()["s"][:5], python[-1, :5], atol=2e-8)
