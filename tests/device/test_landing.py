"""Whatever a host does and in whatever order: a shaft that turns faster than the landing speed is not let down.

Random sequences of commands, parameters, silences, trips and speeds against the controller's model of both machines.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from test_controller import COMMANDS, Host

from bench.rigfile import load_rig
from sim_backend.core import LAND, LEVITATE, LIFT
from sim_backend.drive import SimulatedDrive

RIGS = {name: load_rig(name) for name in ("tsbs12", "amb5dof")}
FLOATING = (LIFT, LEVITATE)
SLICE_S = 0.02
ROOM = 1.05  # for what the speed's measurement is behind
COASTED = {"deadline": None, "derandomize": True, "suppress_health_check": list(HealthCheck)}


class Watched(Host):
    """A host that looks every 20 ms whether the shaft has been let go, and how fast it turned then."""

    def __init__(self, name: str) -> None:
        super().__init__(RIGS[name])
        spec = next((d for d in self.rig.devices.values() if "drive" in d.roles), None)
        self.drive = None if spec is None else SimulatedDrive(
            self.device.plant, spec, self.device.truth, self.rig.envelope.max_speed_rad_s
        )  # fmt: skip
        self.wrong: list[str] = []

    def passed(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / SLICE_S))):
            self.looked(lambda: Host.run(self, SLICE_S))
            if self.drive is not None:
                self.drive.asked() if self.beating else self.drive.follow()
            self.seen.clear()

    def looked(self, do: object) -> object:
        """What it does, with a look before and after."""
        before = self.device.plant.mode
        done = do()  # type: ignore[operator]
        plant, lost = self.device.plant, self.device.fault in ("LEVITATION_LOST", "LIFT_TIMEOUT")
        allowed = ROOM * float(self.device._own["landing_speed"])
        let_go = before in FLOATING and plant.mode not in FLOATING
        if (let_go or plant.mode == LAND) and abs(plant.shaft_speed) > allowed and not lost:
            now = f"{self.device.state}, fault {self.device.fault}: mode {before} to {plant.mode}"
            self.wrong.append(f"{now} at {plant.shaft_speed:.1f} rad/s")
        return done


class Landing(RuleBasedStateMachine):
    name = "tsbs12"

    @initialize()
    def levitated(self) -> None:
        self.host = Watched(self.name)
        self.host.levitate()

    @rule(name=st.sampled_from(COMMANDS))
    def command(self, name: str) -> None:
        """Any command in any state; a drive that a host has is let go before it lands, which no controller can see."""
        if name in ("LAND", "MAKE_SAFE") and self.host.drive is not None:
            self.host.drive.obey("coast")
        self.host.looked(lambda: self.host.command(name))

    @rule(seconds=st.sampled_from((0.1, 0.5, 1.5)))
    def wait(self, seconds: float) -> None:
        self.host.passed(seconds)

    @rule(share=st.sampled_from((0.0, 0.5, 1.0)))
    def landing_speed(self, share: float) -> None:
        p = self.host.rig.parameters["landing_speed"]
        if self.host.device.state != "LANDING":  # another limit is not another speed
            self.host.set("landing_speed", p.low + share * (p.high - p.low))

    @precondition(lambda self: self.host.device.state in ("LEVITATED", "SPINNING"))
    @rule(speed=st.sampled_from((-60.0, 30.0, 65.0)), seconds=st.sampled_from((0.02, 0.4, 1.2)))
    def spin(self, speed: float, seconds: float) -> None:
        """By the controller's own motor, or by a drive until its speed is known."""
        if self.host.drive is None:
            self.host.set("speed_ref", speed)
            self.host.command("SPIN")
            self.host.passed(seconds)
        else:
            self.host.drive.aim(3 * abs(speed))
            self.host.drive.obey("run")
            self.host.passed(max(seconds, 1.0))

    @rule(alive=st.booleans())
    def silence(self, alive: bool) -> None:
        self.host.beating = alive

    @precondition(lambda self: self.host.device.state in ("LEVITATED", "SPINNING", "COASTING"))
    @rule(fault=st.sampled_from(("OVERCURRENT", "OVERSPEED", "SENSOR")))
    def trip(self, fault: str) -> None:
        self.host.looked(lambda: self.host.device._fail(fault))

    @invariant()
    def never_let_down_while_it_turns_fast(self) -> None:
        host = getattr(self, "host", None)
        assert host is None or not host.wrong, host.wrong


class AmbLanding(Landing):
    name = "amb5dof"


@pytest.mark.parametrize("machine", [Landing, AmbLanding], ids=["tsbs12", "amb5dof"])
def test_no_sequence_of_commands_lets_a_turning_shaft_down(machine: type[Landing]) -> None:
    run_state_machine_as_test(machine, settings=settings(max_examples=3, stateful_step_count=12, **COASTED))  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("machine", [Landing, AmbLanding], ids=["tsbs12", "amb5dof"])
def test_no_long_sequence_either(machine: type[Landing]) -> None:
    run_state_machine_as_test(machine, settings=settings(max_examples=25, stateful_step_count=25, **COASTED))  # type: ignore[arg-type]


def test_a_shaft_that_is_spun_up_and_landed_at_once_does_not_turn_while_it_lands() -> None:
    host = Watched("tsbs12")
    host.levitate()
    host.set("speed_ref", 65.0)
    assert host.command("SPIN") == "OK"
    assert host.command("LAND") == "OK"
    host.passed(1.5)
    assert host.device.state == "READY"
    assert host.wrong == []
