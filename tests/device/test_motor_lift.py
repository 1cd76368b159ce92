"""The motor lifts its own end through the controller's states; what of its law may be set, and when."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest
from test_controller import RIG, Host

from sim_backend.machines.tsbs.params import PlantParams

CONTACT_O = 8


def lifted(settings: Mapping[str, float]) -> Host:
    """A host whose controller has been told that at rest, and holds the rotor."""
    host = Host()
    assert host.command("ENABLE") == "OK"
    for name, value in settings.items():
        assert host.set(name, value)[0] == "OK"
    assert host.command("LEVITATE") == "OK"
    host.run(2.0)
    assert host.device.state == "LEVITATED"
    return host


def test_the_inboard_end_alone_decides_when_the_motor_lifts() -> None:
    """At gamma 0 the outboard end stays on its ring; 3.5 degrees lift it, 0 keeps it up, and a landing puts it down."""
    host = lifted({"lift_by": 1.0, "allocation": 1.0})
    assert (host.telemetry(0.5)["flags"].astype(int) & CONTACT_O).all()
    assert host.set("gamma_slew", math.radians(2.0))[0] == "OK"
    host.set("gamma", math.radians(3.5))
    host.run(3.0)
    host.set("gamma", 0.0)
    host.run(3.0)
    held = host.telemetry(0.1)
    assert not (held["flags"].astype(int) & CONTACT_O).any()
    assert abs(held["pos_yo"].mean()) < 5e-6
    assert host.command("LAND") == "OK"
    host.run(2.0)
    assert (host.device.state, host.device.fault) == ("READY", "NONE")


@pytest.mark.parametrize("name", ["lift_by", "model_mass"])
def test_some_of_it_only_while_the_rotor_rests(name: str) -> None:
    host = lifted({name: RIG.parameters[name].default})
    assert host.set(name, 1.0)[0] == "WRONG_STATE"


def test_a_run_at_the_torque_limit_is_guarded_below_the_trip() -> None:
    """The speed that ends it cannot be set above 0.9 of the trip, 72 rad/s."""
    host = lifted({})
    assert RIG.parameters["speed_ref"].high <= 0.9 * PlantParams().trip_speed
    assert host.set("speed_ref", 0.91 * PlantParams().trip_speed)[0] == "OUT_OF_RANGE"
