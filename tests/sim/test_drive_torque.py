"""The external drive in the plant: the core against the reference, and what its speed control does to the shaft."""

from __future__ import annotations

import numpy as np
import pytest
from sim_plants import floating, levitated, quiet

from sim_backend.core import LEVITATE, DriveLaw
from sim_backend.machines.tsbs.params import ControlParams
from sim_backend.machines.tsbs.plant import Plant
from sim_backend.machines.tsbs.reference_loop import Driving, simulate

LAW = DriveLaw(gain=20.0, limit=8.0, ramp=20.0)
IDLE = ControlParams(torque_on=0.0)
START = (3e-6, 0.0, 4e-6, 0.0, 1e-5, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0)


def test_core_equals_the_reference_with_a_drive() -> None:
    """0.1 s: switched on while the shaft turns, ramp, limit, another target, off."""
    stiff = DriveLaw(gain=3.0, limit=0.7, ramp=40.0)
    drivings = (
        Driving(100, 30.0, 3.0, 0.7, 40.0),
        Driving(600, -5.0, 20.0, 8.0, 200.0),
        Driving(800, 0.0, 0.0, 0.0, 0.0),
    )
    p, ticks = quiet(), 1000
    plant = Plant(p, control=IDLE)
    plant.set_state(np.array(START))
    plant.mode = LEVITATE
    states = [np.array(START)]
    commands = {100: (stiff, 30.0), 600: (DriveLaw(20.0, 8.0, 200.0), -5.0), 800: (None, 0.0)}
    for tick in range(ticks):
        if tick in commands:
            plant.drive(*commands[tick])
        plant.run(1)
        states.append(plant.state()["s"])
    core, python = np.array(states), simulate(p, IDLE, START, ticks, drivings=drivings).s
    assert (np.abs(core - python).max(axis=0) < 1e-6 * np.abs(python).max(axis=0) + 1e-15).all()
    speed = core[:, 11]
    assert speed[600] > speed[100] > 4.5  # it did drive
    assert speed[800] < speed[600] - 2


def test_torque_is_held_at_its_limit() -> None:
    """A free shaft far below its speed is accelerated by the limit over the polar inertia."""
    plant = Plant(floating(), control=IDLE)
    plant.set_state(np.zeros(14))
    plant.drive(DriveLaw(gain=20.0, limit=0.5, ramp=1e6), 60.0)
    plant.run(1000)
    assert plant.drive_torque == 0.5
    assert plant.shaft_speed == pytest.approx(0.5 / plant.params.polar_inertia * 0.1, rel=1e-9)


def test_drive_reaches_and_holds_its_speed_then_coasts_and_brakes() -> None:
    plant = levitated(quiet(), control=IDLE)
    plant.drive(LAW, 40.0)
    plant.run(30000)
    friction = plant.params.viscous * plant.shaft_speed + plant.params.coulomb
    assert plant.shaft_speed == pytest.approx(40.0 - friction / LAW.gain, abs=0.01)
    assert plant.drive_torque == pytest.approx(friction, abs=0.02)
    plant.drive(None)
    plant.run(1000)
    coasted = plant.shaft_speed
    assert plant.drive_torque == 0
    assert coasted == pytest.approx(39.8 - friction / plant.params.polar_inertia * 0.1, abs=1.5)
    plant.drive(LAW, 0.0)  # takes over at the speed that the shaft has: no jolt
    assert abs(plant.drive_torque) < 1e-9
    plant.run(25000)
    assert abs(plant.shaft_speed) < 0.05
    assert plant.trips == 0


def test_ramp_bounds_the_acceleration() -> None:
    plant = levitated(quiet(), control=IDLE)
    plant.drive(LAW, 60.0)
    before = plant.shaft_speed
    plant.run(10000)
    assert plant.shaft_speed - before == pytest.approx(20.0, abs=0.3)


def test_a_drive_that_is_off_changes_nothing() -> None:
    """Bit for bit: torque is added only where there is a drive."""
    one, other = Plant(seed=3), Plant(seed=3)
    other.drive(LAW, 40.0)
    other.drive(None)
    assert one.run(3000).tobytes() == other.run(3000).tobytes()


def test_rotation_control_without_gains_lets_the_drive_turn_the_shaft_and_takes_over_where_it_is() -> None:
    plant = levitated(quiet())
    for gain in ("kp_theta", "ki_theta", "kd_theta"):
        plant.set(gain, 0.0)
    plant.drive(LAW, 40.0)
    plant.run(25000)
    assert plant.shaft_speed > 39
    plant.drive(None)
    fastest = 0.0
    for gain, value in (("kp_theta", 50.0), ("ki_theta", 100.0), ("kd_theta", 1.0)):
        plant.set(gain, value)
        plant.run(200)
        fastest = max(fastest, abs(plant.shaft_speed))
    plant.run(40000)
    assert fastest < 41  # it does not wind back the turns that the drive made
    assert abs(plant.shaft_speed) < 0.05
    assert plant.trips == 0


def test_rotation_control_without_gains_core_against_reference() -> None:
    control = ControlParams(kp_theta=0.0, ki_theta=0.0, kd_theta=0.0)
    p, ticks = quiet(), 600
    plant = Plant(p, control=control)
    plant.set_state(np.array(START))
    plant.mode = LEVITATE
    plant.drive(LAW, 30.0)
    plant.run(ticks)
    python = simulate(p, control, START, ticks, drivings=(Driving(0, 30.0, LAW.gain, LAW.limit, LAW.ramp),)).s[-1]
    assert np.abs(plant.state()["s"] - python).max() < 1e-8
    assert plant.shaft_speed > 5.5
