"""Whatever a host does and in whatever order: a shaft that turns faster than the landing speed is not let down.

Random sequences of commands, parameters, silences, trips and speeds against the controller's model of both machines.
"""

from __future__ import annotations

from random import Random

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
from sim_backend.controller.setdown import TOO_FAST
from sim_backend.core import LAND, LEVITATE, LIFT
from sim_backend.devices.drive import SimulatedDrive

RIGS = {name: load_rig(name) for name in ("tsbs12", "amb5dof")}
FLOATING = (LIFT, LEVITATE)
ENDS = ("LAND", "MAKE_SAFE", "dead", "dead while it starts slowly")
SLOWLY = 0.12  # of the drive's ramp: the first turn takes longer than one at the landing speed
SLICE_S = 0.02
ROOM = 1.02 * TOO_FAST  # a landing is broken off at that
SEEN_S = 0.03  # until a speed that is measured all the time is seen to be more
COASTED = {"deadline": None, "derandomize": True, "suppress_health_check": list(HealthCheck)}


class Watched(Host):
    """A host that looks every 20 ms whether the shaft has been let go, and how fast it turned then."""

    def __init__(self, name: str, **defects: float) -> None:
        super().__init__(RIGS[name], **defects)
        spec = next(d for d in self.rig.devices.values() if "drive" in d.roles)
        most = self.rig.envelope.max_speed_rad_s
        self.drive = SimulatedDrive(self.device.plant, spec, self.device.truth, most)
        self.wrong: list[str] = []

    def passed(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / SLICE_S))):
            self.looked(lambda: Host.run(self, SLICE_S))
            self.drive.asked() if self.beating else self.drive.follow()
            self.seen.clear()

    def looked(self, do: object) -> object:
        """What it does, with a look before and after."""
        before = self.device.plant.mode
        done = do()  # type: ignore[operator]
        plant, lost = self.device.plant, self.device.fault in ("LEVITATION_LOST", "LIFT_TIMEOUT")
        let_go = before in FLOATING and plant.mode not in FLOATING
        if (let_go or plant.mode == LAND) and abs(plant.shaft_speed) > self.allowed and not lost:
            now = f"{self.device.state}, fault {self.device.fault}: mode {before} to {plant.mode}"
            self.wrong.append(f"{now} at {plant.shaft_speed:.1f} rad/s")
        return done

    @property
    def allowed(self) -> float:
        """At most so fast while it is let down, rad/s."""
        plant, limit = self.device.plant, ROOM * float(self.device.parameters.values["landing_speed"])
        driven = plant.pulse_age_s is None and self.drive.state != "off"
        return limit + (self.device.truth.values["drive_ramp"] * SEEN_S if driven else 0.0)


class Landing(RuleBasedStateMachine):
    name = "tsbs12"

    @initialize()
    def levitated(self) -> None:
        self.host = Watched(self.name)
        self.host.levitate()

    @rule(name=st.sampled_from(COMMANDS))
    def command(self, name: str) -> None:
        """Any command in any state; before it asks for a landing, a host lets the drive go, which no controller can see."""
        if name == "LAND":
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
    @rule(speed=st.sampled_from((-60.0, 30.0, 65.0)), seconds=st.sampled_from((0.02, 0.1, 0.4, 1.2)), own=st.booleans())
    def spin(self, speed: float, seconds: float, own: bool) -> None:
        """By the controller's own motor, where it has one, or by a drive; also for less than the first turn."""
        if own and "speed_ref" in self.host.rig.parameters:
            self.host.drive.obey("coast")
            self.host.set("speed_ref", speed)
            self.host.command("SPIN")
        elif self.host.beating:
            self.host.drive.asked()
            self.host.drive.aim(3 * abs(speed))
            self.host.drive.obey("run")
        self.host.passed(seconds)

    @rule(alive=st.booleans())
    def silence(self, alive: bool) -> None:
        self.host.beating = alive

    @precondition(lambda self: self.host.device.state in ("LEVITATED", "SPINNING", "COASTING"))
    @rule(fault=st.sampled_from(("OVERCURRENT", "OVERSPEED", "SENSOR")))
    def trip(self, fault: str) -> None:
        self.host.looked(lambda: self.host.device.states.fail(fault))

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
    run_state_machine_as_test(machine, settings=settings(max_examples=20, stateful_step_count=25, **COASTED))  # type: ignore[arg-type]


def test_a_shaft_that_is_spun_up_and_landed_at_once_does_not_turn_while_it_lands() -> None:
    host = Watched("tsbs12")
    host.levitate()
    host.set("speed_ref", 65.0)
    assert host.command("SPIN") == "OK"
    assert host.command("LAND") == "OK"
    host.passed(1.5)
    assert host.device.state == "READY"
    assert host.wrong == []


@pytest.mark.parametrize("name", RIGS)
def test_a_shaft_whose_drive_has_just_started_is_held(name: str) -> None:
    """In its first turn no pulse has told the speed yet. The drive of a dead host goes on for a second."""
    for end in ("LAND", "dead while it starts slowly"):
        assert let_down(name, end, 0.08) == [], end


def test_a_trip_that_stays_does_not_put_the_landing_off() -> None:
    host = Watched("amb5dof")
    host.levitate()
    for _ in range(80):
        if host.device.state in ("LEVITATED", "COASTING"):
            host.device.states.fail("OVERCURRENT")
            host.passed(SLICE_S)
    assert host.device.state == "LANDING"


@pytest.mark.parametrize("end", ["LAND", "MAKE_SAFE", "dead"])
def test_a_shaft_whose_pulses_have_ended_at_speed_stays_up(end: str) -> None:
    """The probe of the mark dies at some 1400 r/min; the host notices nothing, and asks for a landing later, or dies too."""
    host = Watched("amb5dof", pulse_last=60.0)
    host.levitate()
    host.drive.asked()
    host.drive.aim(150.0)
    host.drive.obey("run")
    host.passed(1.0)
    for _ in range(100):
        if host.device.fault == "SENSOR":
            break
        host.passed(0.05)
    assert (host.device.fault, host.device.state) == ("SENSOR", "COASTING")
    assert host.device.plant.shaft_speed > 120
    host.beating = end != "dead"
    if host.beating:
        host.looked(lambda: host.command(end))
    host.passed(4.0)
    assert host.device.state == "COASTING"
    assert host.wrong == []


@pytest.mark.parametrize("defect", [{"pulse_missing": 3.0}, {"pulse_missing": 7.0}, {"pulse_doubled": 2.0}])
def test_a_missed_pulse_and_the_hardest_braking_are_no_dead_probe(defect: dict[str, float]) -> None:
    host = Watched("amb5dof", **defect)
    host.levitate()
    host.drive.asked()
    host.drive.accelerate(250.0)
    host.drive.aim(300.0)
    host.drive.obey("run")
    host.passed(2.0)
    host.drive.aim(0.0)
    host.passed(3.0)
    assert (host.device.fault, host.device.state) == ("NONE", "LEVITATED")
    assert host.command("LAND") == "OK"
    host.passed(2.0)
    assert host.device.state == "READY"
    assert host.wrong == []


@pytest.mark.long
@pytest.mark.parametrize("name", RIGS)
def test_a_shaft_is_held_whenever_its_drive_has_started(name: str) -> None:
    for seed in range(4):
        for end in ENDS:
            turned_s = Random(f"{seed} {end}").uniform(0.0, 0.5)
            assert let_down(name, end, turned_s) == [], (end, turned_s)


def let_down(name: str, end: str, turned_s: float) -> list[str]:
    """What goes wrong when a host asks for a landing, or dies, so long after its drive has started; the drive goes on."""
    host = Watched(name)
    host.levitate()
    host.drive.asked()
    host.drive.accelerate(SLOWLY * host.device.truth.values["drive_ramp"] if "slowly" in end else 0.0)
    host.drive.aim(200.0)
    host.drive.obey("run")
    host.passed(turned_s)
    host.beating = not end.startswith("dead")
    if host.beating and host.device.state == "LEVITATED":
        assert host.looked(lambda: host.command(end)) == "OK"
    host.passed(1.6)
    return host.wrong
