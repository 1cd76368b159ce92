"""The motor's law: torque at its limit (T 6.7.2), lift by the motor (T 6.7.3, Fig. 6.11), load balancing (T 6.7.3)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import centred, levitated

from sim_backend.core import LAND, LEVITATE, LIFT, READY
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, Plant

Array = npt.NDArray[np.float64]
COLUMN = {name: k for k, name in enumerate(CHANNELS)}
RPM = 30 / math.pi
M = 8


def run_up(current_A: float, viscous: float, allocation: float, compensated: float, seconds: float) -> float:
    """Speed in r/min that the torque limit reaches, the outboard AMB off; beyond the machine's own trip, so that is away."""
    runout = (0.0,) * 4 + (3e-6, 0.0, 0.0, 0.0)  # this, and the noise, cost torque by the currents that answer them
    blemishes = {"target": runout, "position_noise": 1.5e-7, "eccentricity": 2e-6}
    plant = levitated(centred(viscous=viscous, drag_share=0.0, trip_speed=1e4, **blemishes))
    settings = {"motor_share": 1.0, "segment_max": current_A, "allocation": allocation, "lag_compensation": compensated}
    for name, value in settings.items():
        plant.set(name, value)
    plant.run(20000)
    plant.set("torque_limit_run", 1.0)
    plant.set("speed_ref", 500.0)
    plant.run(round(seconds * 1e4))
    assert plant.trips == 0
    return plant.shaft_speed * RPM


@pytest.mark.parametrize(
    ("current_A", "viscous", "compensated", "half", "shared"),
    [(7.8, 0.257, 1.0, 402, 603), (10.0, 0.081, 0.0, 2014, 2231), (10.0, 0.081, 1.0, 1987, 2602)],
)
def test_the_torque_limit_reaches_the_speeds_of_another_simulation(
    current_A: float, viscous: float, compensated: float, half: float, shared: float
) -> None:
    """Speeds by a prototype of the same equations, written apart: r/min with lambda a half, and by T (6.24)."""
    seconds = 12 * 0.033 / viscous
    assert run_up(current_A, viscous, 2.0, compensated, seconds) == pytest.approx(half, rel=0.01)
    assert run_up(current_A, viscous, 1.0, compensated, seconds) == pytest.approx(shared, rel=0.01)


def test_the_speed_guards_a_run_at_the_torque_limit() -> None:
    """5 A s/rad: at 30 rad/s the demand is what the drag takes, 1 A; then an ordinary stop."""
    plant = levitated(centred(drag_share=0.0))
    plant.set("torque_limit_run", 1.0)
    plant.set("speed_ref", 30.0)
    plant.run(20000)
    needed = (0.081 * 30 + 0.05) / 2.87
    assert plant.shaft_speed == pytest.approx(30.0 - needed / 5, abs=0.1)
    plant.set("speed_ref", 0.0)
    plant.run(40000)
    assert abs(plant.shaft_speed) < 0.01


def lifting(p: PlantParams, **control: float) -> Plant:
    """A plant whose motor has been asked to lift."""
    settings: dict[str, Any] = {"lift_by": 1.0, "allocation": 1.0, "lift_time_s": 0.5} | control
    plant = Plant(p, control=ControlParams(**settings))
    plant.mode = READY
    plant.run(5000)
    plant.mode = LIFT
    plant.run(10000)
    plant.mode = LEVITATE
    return plant


def lift_angle(plant: Plant, way: float) -> float:
    """Degrees of gamma at which the outboard end leaves its ring, on a ramp of 0.8 deg/s; NaN if it was up before."""
    rest = plant.run(2000)[:, COLUMN["pos_yo"]].mean()
    plant.set("gamma_slew", math.radians(0.8))
    plant.set("gamma", way * math.radians(4.0))
    y = plant.run(50000)[:, COLUMN["pos_yo"]]
    return 0.8e-3 * int(np.argmax(y > rest / 2)) if rest < -1e-4 else math.nan


@pytest.mark.parametrize(("clearance", "degrees"), [(250e-6, 2.46), (230e-6, 1.76), (218e-6, 1.10)])
def test_the_motor_lifts_from_a_phase_angle_on(clearance: float, degrees: float) -> None:
    """By the prototype; by hand alpha_d I_s cos(M g) (1 + (alpha_c/alpha_d)^2 tan^2(M g)) > k c + 48.55 N, k 344.3 N/mm."""
    found = lift_angle(lifting(centred(clearance=clearance, lost_radius=0.92 * clearance)), 1.0)
    assert found == pytest.approx(degrees, abs=0.06)
    c, s = math.cos(M * math.radians(found)), math.sin(M * math.radians(found))
    needed = 344.3e3 * clearance + 48.55
    assert 121.0 * c + 10 * 14.3**2 / 12.1 * s * s / c == pytest.approx(needed, rel=0.02)


def test_an_end_that_the_motor_cannot_lift_is_not_lost_and_one_that_it_lifted_is_landed() -> None:
    plant = lifting(centred())
    rows = plant.run(20000)
    assert (rows[:, COLUMN["flags"]].astype(int) & 8).all()
    assert not rows[:, COLUMN["i_xo_p"] : COLUMN["i_yo_n"] + 1].max() > 0.01  # the outboard AMB is off
    assert plant.trips == 0
    assert (rows[-100:, COLUMN["i_m1"]] - rows[-100:, COLUMN["i_m3"]]).mean() / 2 == pytest.approx(10.0, abs=0.05)
    assert lift_angle(plant, -1.0) == pytest.approx(2.46, abs=0.06)
    plant.set("gamma", 0.0)
    up = plant.run(60000)[-1000:]
    assert np.abs(up[:, COLUMN["pos_yo"]]).max() < 1e-5
    plant.mode = LAND
    plant.run(8000)
    assert plant.trips == 0
    assert np.abs(plant.currents[10:]).max() < 1e-3


def currents(rows: Array) -> Array:
    """|i_x| and |i_y| in A, (n, 2), means over 10 ms."""
    i = rows[:, [COLUMN[f"i_m{k}"] for k in range(1, 5)]]
    both = np.abs(np.stack([i[:, 3] - i[:, 1], i[:, 0] - i[:, 2]], axis=1) / 2)
    return np.stack([np.convolve(x, np.full(10, 0.1), "valid") for x in both.T], axis=1)


def balanced(offset_x: float, hz: float = 0.25, **settings: float) -> tuple[Array, Array, Plant]:
    """Currents of three turns on a circle of 100 um without balancing, and of two with it, after one turn."""
    plant = levitated(centred(motor_x=offset_x))
    standing = {"motor_share": 1.0, "allocation": 1.0, "gamma_slew": math.radians(25)}
    for name, value in (standing | {"circle_radius": 1e-4, "circle_hz": hz} | settings).items():
        plant.set(name, value)
    plant.run(20000)
    turn = round(1e4 / abs(hz))
    before = plant.run(3 * turn)
    plant.set("balance", 1.0)
    plant.run(turn)
    after = plant.run(2 * turn)
    assert plant.trips == 0
    return currents(before), currents(after), plant


def unbalance(i: Array) -> float:
    """How different |i_x| and |i_y| are, a share of their sum."""
    return float(np.sqrt(((i[:, 0] - i[:, 1]) ** 2).mean() / ((i.sum(axis=1)) ** 2).mean()))


@pytest.mark.parametrize(
    ("offset_x", "hz", "saved"), [(91e-6, 0.25, -0.266), (0.0, 0.25, -0.335), (-91e-6, -0.25, -0.257)]
)
def test_balancing_takes_load_off_the_vertical_current(offset_x: float, hz: float, saved: float) -> None:
    """22 N of horizontal load is 91 um of motor_x. Figures of the prototype; without balancing the unbalance is 0.47."""
    before, after, _ = balanced(offset_x, hz)
    assert after[:, 1].max() / before[:, 1].max() - 1 == pytest.approx(saved, abs=0.02)
    assert unbalance(before) > 0.45
    assert unbalance(after) < (0.01 if offset_x else 0.12)  # without a load the cut at 8 degrees is reached


def test_balancing_begins_with_a_load_that_nobody_has_seen() -> None:
    """A shaft at rest without noise: the direction of no load at all was no number, and gamma with it for good."""
    plant = Plant(centred(position_noise=0.0), 1, control=ControlParams(lift_by=1.0, motor_share=1.0, balance=1.0))
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(1000)
    assert abs(plant._s.law.gamma) <= math.radians(8.001)


def test_the_observed_load_is_the_static_one() -> None:
    """Weight at the motor 48.55 N less nothing, and 22 N across, in the fixed frame; the circle adds 34.4 N."""
    _, _, plant = balanced(91e-6, circle_radius=0.0)
    law = plant._s.law
    assert list(law.load) == pytest.approx([22.07, -48.55], abs=0.4)
