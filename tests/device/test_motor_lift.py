"""The motor lifts its own end through the controller's states; what of its law may be set, and when."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest
from test_controller import RIG, Host

from sim_backend.machines.tsbs.params import PlantParams

CONTACT_O = 8


BY_MOTOR = {"lift_by": 1.0, "allocation": 1.0, "lift_time_s": 0.5}


def lifted(settings: Mapping[str, float], state: str = "LEVITATED") -> Host:
    """A host whose controller has been told that at rest, and has been asked to lift 2 s ago."""
    host = Host()
    assert host.command("ENABLE") == "OK"
    for name, value in settings.items():
        assert host.set(name, value)[0] == "OK"
    assert host.command("LEVITATE") == "OK"
    host.run(2.0)
    assert host.device.state == state
    return host


def on_its_ring(host: Host) -> bool:
    flags = host.telemetry(0.5)["flags"].astype(int)
    return bool((flags & CONTACT_O).all())


def test_an_end_on_its_ring_is_not_levitated() -> None:
    """At gamma 0 the outboard end stays on its ring; 3.5 degrees lift it, 0 keeps it up, and a landing puts it down."""
    host = lifted(BY_MOTOR, "LIFTING")
    assert on_its_ring(host)
    assert host.command("LAND") == "WRONG_STATE"
    assert host.set("gamma_slew", math.radians(2.0))[0] == "OK"
    host.set("gamma", math.radians(3.5))
    host.run(3.0)
    assert host.device.state == "LEVITATED"
    host.set("gamma", 0.0)
    host.run(3.0)
    held = host.telemetry(0.1)
    assert not (held["flags"].astype(int) & CONTACT_O).any()
    assert abs(held["pos_yo"].mean()) < 5e-6
    assert host.command("LAND") == "OK"
    host.run(2.0)
    assert (host.device.state, host.device.fault) == ("READY", "NONE")


def test_a_lift_that_does_not_come_about_is_set_down_when_it_is_asked_for() -> None:
    host = lifted(BY_MOTOR, "LIFTING")
    assert host.command("MAKE_SAFE") == "OK"
    assert host.device.state == "LANDING"
    host.run(1.0)
    assert (host.device.state, host.device.fault) == ("OFF", "NONE")
    assert max(host.device.plant.currents) < 1e-3  # type: ignore[attr-defined]


def test_a_lift_whose_host_dies_is_set_down() -> None:
    host = lifted(BY_MOTOR, "LIFTING")
    host.beating = False
    host.run(0.2)
    assert (host.device.state, host.device.fault) == ("LANDING", "HEARTBEAT_LOST")
    host.run(1.0)
    assert host.device.state == "FAULT"
    assert max(host.device.plant.currents) < 1e-3  # type: ignore[attr-defined]


def test_a_lift_by_the_motor_may_take_a_minute_and_one_by_the_bearings_five_seconds() -> None:
    host = lifted(BY_MOTOR, "LIFTING")
    host.run(57.0)
    assert (host.device.state, host.device.fault) == ("LIFTING", "NONE")
    host.run(2.0)
    assert (host.device.state, host.device.fault) == ("FAULT", "LIFT_TIMEOUT")
    weak = lifted({"kp_o": 0.0, "kd_o": 0.0, "ki_o": 0.0}, "LIFTING")
    weak.run(4.5)
    assert weak.device.fault == "LIFT_TIMEOUT"


@pytest.mark.parametrize("name", ["lift_by", "model_mass"])
def test_some_of_it_only_while_the_rotor_rests(name: str) -> None:
    host = lifted({name: RIG.parameters[name].default})
    assert host.set(name, 1.0)[0] == "WRONG_STATE"


def test_a_run_at_the_torque_limit_is_guarded_below_the_trip() -> None:
    """The speed that ends it cannot be set above 0.9 of the trip, 72 rad/s."""
    host = lifted({})
    assert RIG.parameters["speed_ref"].high <= 0.9 * PlantParams().trip_speed
    assert host.set("speed_ref", 0.91 * PlantParams().trip_speed)[0] == "OUT_OF_RANGE"
