"""The C core against the Python reference, the reference against scipy, and the order of the integrator."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import quiet

from sim_backend.core import LEVITATE, DriveLaw
from sim_backend.machines.tsbs import reference
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import Plant, derivative
from sim_backend.machines.tsbs.reference_loop import (
    Driving,
    Hanging,
    Interval,
    Levering,
    Trace,
    dop853,
    runge_kutta,
    simulate,
)

Array = npt.NDArray[np.float64]
TICKS = 600
START = (3e-6, 0.0, 4e-6, 0.0, 1e-5, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 38.0, 0.0, 0.0)
LIGHT = (Hanging(100, 0.5, 4.9, 0.01), Hanging(250, 0.25, 2.4, 0.005))
HANGINGS = (Hanging(150, 3.25, 31.9, 0.015), Hanging(450, 1.25, 12.2, 0.005))
CONTROL = ControlParams(speed_ref=40.0, i_x=-0.2, i_y=0.3, gamma=0.02, ref_yi=5e-6, ref_z=-3e-6)
STANDING = (*START[:5], *(0.0,) * 9)
LEVERINGS = (
    Levering(50, 1.0, 9.8, 0.23, 0.01, 0.02),
    Levering(175, 0.5, 4.9, -0.229, 0.005),
    Levering(300, 0.0, 0.0, 0.23, 0.005),
)
"""On the left with a ring on the shaft, then on the right without, then nothing."""
CARRYING = ControlParams(motor_share=1.0, share_slew=10.0, ref_xm=2e-6, ref_ym=-3e-6, gamma=-0.03, i_x=0.1, i_ramp=5.0)
STEPPING = dataclasses.replace(
    CARRYING, angle_ref=0.1, angle_slew=1000.0, derivative_on_error=1.0, kd_theta=0.5, angle_hz=1000.0
)
SWINGING = ControlParams(angle_ref=0.05, sine_amplitude=0.05, sine_hz=20.0, allocation=1.0, segment_max=6.0)


def blemished() -> PlantParams:
    """A quiet machine with every error that the loop can have."""
    rng = np.random.default_rng(4)
    return quiet(
        current_gain=tuple(1 + 0.003 * rng.uniform(-1, 1, 10)),
        current_offset=tuple(0.004 * rng.uniform(-1, 1, 10)),
        current_drift=tuple(0.01 * rng.uniform(-1, 1, 10)),
        position_gain=tuple(1 + 0.01 * rng.uniform(-1, 1, 5)),
        position_offset=tuple(1e-5 * rng.uniform(-1, 1, 5)),
        segment_gain=(1.01, 0.99, 1.0, 1.02),
        segment_sense=tuple(1 + 0.003 * rng.uniform(-1, 1, 4)),
        segment_offset=tuple(0.004 * rng.uniform(-1, 1, 4)),
        segment_drift=tuple(0.01 * rng.uniform(-1, 1, 4)),
        segment_scale_drift=0.02,
        asymmetry=(0.03, -0.02),
        alpha_2=0.3,
        alpha_3=-0.2,
        beta_4=0.02,
        gamma_zero=0.005,
    )


def run_core(
    p: PlantParams,
    c: ControlParams,
    ticks: int,
    start: Sequence[float] = START,
    leverings: Sequence[Levering] = (),
    drivings: Sequence[Driving] = (),
    hangings: Sequence[Hanging] = HANGINGS,
) -> Trace:
    """What `simulate` does, by the core, tick by tick."""
    plant = Plant(p, control=c)
    plant.set_state(np.array(start))
    plant.mode = LEVITATE
    states, currents = [np.array(start)], [np.zeros(14, complex)]
    for tick in range(ticks):
        for h in (h for h in hangings if h.tick == tick):
            plant.load(h.mass_kg, h.weight_N, h.ramp_s)
        for x in (x for x in leverings if x.tick == tick):
            plant.lever(x.mass_kg, x.weight_N, x.arm_m, x.ramp_s)
            plant.mount(x.ring)
        for d in (d for d in drivings if d.tick == tick):
            plant.drive(DriveLaw(d.gain, d.limit, d.ramp) if d.gain else None, d.target)
        plant.run(1)
        now = plant.state()
        states.append(now["s"])
        currents.append(np.concatenate([now["coil"], now["segment"]]))
    assert plant.trips == 0
    return Trace(np.array(states), np.array(currents))


def error(a: Array, b: Array) -> float:
    """Largest over the columns of max |a - b| / max |b|."""
    return float((np.abs(a - b).max(axis=0) / np.abs(b).max(axis=0)).max())


@pytest.mark.parametrize("spread", [1.0, 12.0], ids=["free", "in contact"])
def test_right_hand_side_equals_the_core(spread: float) -> None:
    rng = np.random.default_rng(2)
    scale = np.array([3e-5, 3e-5, 3e-5, 2e-4, 2e-4, 3, 0.02, 0.02, 0.02, 0.3, 0.3, 30, 1e-4, 0.01])
    p, touched = blemished(), 0
    for _ in range(200):
        s = scale * rng.normal(size=14) * np.where(np.arange(14) < 5, spread, 1)
        coil, play = rng.uniform(0, 8, 10), rng.uniform(-1e-3, 1e-3, 4)
        segment = rng.uniform(-5, 5, 4) + 1j * rng.uniform(-5, 5, 4)
        hung = rng.uniform(0, 10), rng.uniform(-3, 3), rng.uniform(-1, 1), rng.uniform(0, 0.05)
        found = derivative(p, s, coil, segment, play=play, gamma=0.03, hung_mass=2.0, weight=19.0, lever=hung)
        there = reference.stator(p, segment, 0.03, s[5])
        loads = reference.Loads(coil, there, play, 2.0, 19.0, lever=reference.Lever(*hung))
        expected = reference.derivative(p, s, loads)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9)
        ends = [(s[0] + z * s[4], s[1] - z * s[3]) for z in p.z_sensor]
        touched += any(np.hypot(*end) > p.clearance for end in ends)
    assert touched > 150 if spread > 1 else touched < 20


def test_core_equals_the_reference_in_closed_loop() -> None:
    """0.06 s: start-up, rotation at 40 rad/s, motor currents, weights handed over and taken off."""
    p = blemished()
    core, python = run_core(p, CONTROL, TICKS), simulate(p, CONTROL, START, TICKS, hangings=HANGINGS)
    assert np.abs(core.s[:, 1]).max() > 1e-5  # something happened
    assert error(core.s, python.s) < 1e-6
    assert error(core.currents, python.currents) < 1e-6


@pytest.mark.parametrize(
    ("control", "start", "change"),
    [
        (CARRYING, STANDING, {"gravity": 1.0}),
        (STEPPING, STANDING, {"gravity": 1.0}),
        (dataclasses.replace(STEPPING, allocation=1.0, segment_max=8.0), STANDING, {"gravity": 1.0}),
        (SWINGING, STANDING, {}),
        (SWINGING, STANDING, {"lever_slip": 0.3, "exchange_segments": 1.0}),
        (CONTROL, START, {"encoder_sign": -1.0}),
        (dataclasses.replace(CONTROL, lag_compensation=1.0), START, {}),
    ],
    ids=[
        "motor carries",
        "step, T (6.9)",
        "step, T (6.24)",
        "sine, lever",
        "slip, exchanged",
        "encoder backwards",
        "lag compensated",
    ],
)
def test_what_the_chain_adds_equals_the_reference(
    control: ControlParams, start: Sequence[float], change: dict[str, float]
) -> None:
    """The lever and the ring act in all of them. The motor takes over from the first tick, so the rotor must be light."""
    p = dataclasses.replace(blemished(), **change)
    core = run_core(p, control, 350, start, LEVERINGS, hangings=LIGHT)
    python = simulate(p, control, start, 350, hangings=LIGHT, leverings=LEVERINGS)
    assert error(core.s, python.s) < 1e-6
    assert error(core.currents, python.currents) < 1e-6


def test_the_brake_works_while_no_drive_drives() -> None:
    p, released = (
        dataclasses.replace(blemished(), brake=0.3, drag_share=0.0),
        ControlParams(kp_theta=0.0, kd_theta=0.0, ki_theta=0.0),
    )
    drivings = (Driving(100, 30.0, 20.0, 8.0, 400.0), Driving(300, 0.0, 0.0, 0.0, 0.0))
    core = run_core(p, released, 500, START, (), drivings)
    python = simulate(p, released, START, 500, hangings=HANGINGS, drivings=drivings)
    assert error(core.s, python.s) < 1e-6
    decelerations = -np.diff(core.s[[0, 90, 310, 490], 11])[[0, 2]] / np.array([90, 180]) / 1e-4
    drag = p.viscous * core.s[[45, 400], 11]
    np.testing.assert_allclose(decelerations, (drag + p.coulomb + 0.3) / p.polar_inertia, rtol=0.02)


@pytest.mark.parametrize("change", [{"hysteresis": 0.0}, {"alpha_d": 12.2}, {"polar_inertia": 0.0331}])
def test_the_comparison_sees_a_small_difference(change: dict[str, float]) -> None:
    p = blemished()
    core = run_core(p, CONTROL, 250)
    other = simulate(dataclasses.replace(p, **change), CONTROL, START, 250, hangings=HANGINGS)
    assert error(core.s, other.s) > 1e-6


def solution(p: PlantParams, substeps: int, ticks: int) -> Array:
    """States of the reference with `substeps` Runge-Kutta steps per tick."""

    def advance(interval: Interval, s: Sequence[float]) -> list[float]:
        return runge_kutta(interval, s, substeps)

    return simulate(p, CONTROL, START, ticks, hangings=HANGINGS, advance=advance).s


def test_reference_against_dop853_and_order_of_convergence() -> None:
    """Four steps per tick are within 1e-6 of DOP853 in every signal, two in every position; halving gains 2^4.

    The fastest process is the 1 kHz amplifier: at one step per tick the error is 2e-5 in position.
    """
    p, ticks = blemished(), 320
    exact = simulate(p, CONTROL, START, ticks, hangings=HANGINGS, advance=dop853).s
    solutions = {n: solution(p, n, ticks) for n in (1, 2, 4)}
    assert error(solutions[4], exact) < 1e-6
    assert error(solutions[2][:, :6], exact[:, :6]) < 2e-6
    for n in (1, 2):
        ratio = error(solutions[n], exact) / error(solutions[2 * n], exact)
        assert np.log2(ratio) == pytest.approx(4, abs=0.25)


def test_core_converges_with_its_substeps_to_the_reference() -> None:
    """Eight steps per tick in the core against four in the reference: the steps taken are really smaller."""
    p = blemished()
    plant = Plant(p, control=CONTROL, substeps=8)
    plant.set_state(np.array(START))
    plant.mode = LEVITATE
    plant.run(80)
    coarse, fine = solution(p, 2, 80)[-1], solution(p, 8, 80)[-1]
    found = plant.state()["s"]
    np.testing.assert_allclose(found[:12], fine[:12], rtol=1e-9, atol=1e-15)
    assert np.abs(found - coarse)[:3].max() > 1e-13
