"""Nobody is asked to touch a machine whose DC link is charged; what hangs on its mover pulls by statics and moves as a mass."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lira_bench import Bench, opened

from bench.cli.touching import APART_NS, approach, standing
from bench.errors import InterlockError, NotDischarged, OperatorRefused
from bench.procedure.roles import Load, RigState
from bench.procedure.states import transition, within_reach
from bench.rigfile import load_rig
from bench.rigfile.check import problems_of
from drivers.operator import LineOperator
from drivers.person import ConsoleOperator
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import TRACE, Plant, ideal

ON_FAR = Load("M2", "far")


def plant_of(bench: Bench) -> Plant:
    line = bench.rig.operator
    assert isinstance(line, LineOperator)
    found: Plant = line._request.__self__.device.plant  # type: ignore[attr-defined]
    return found


@pytest.mark.parametrize("reduced", [False, True])
def test_the_link_discharges_once_nothing_feeds_it(reduced: bool) -> None:
    plant = Plant(replace(PlantParams(), discharge_s=0.5), reduced=reduced)
    plant.command("idle")
    plant.command("on")
    plant.run(0.01)
    assert plant.link_V == 400
    plant.command("stop")
    plant.run(0.2)
    assert plant.link_V == pytest.approx(400 * math.exp(-0.2 / 0.5), rel=1e-9)
    plant.command("on")
    plant.run(1 / 35000)
    assert plant.link_V == 400


def test_nobody_is_asked_before_the_link_reads_less_than_the_bound() -> None:
    with opened(seed=3, discharge=2.0) as bench:
        plant, line = plant_of(bench), bench.rig.operator
        transition(bench.rig, RigState.LEVITATED)
        for state, said in ((RigState.LEVITATED, "land it first"), (RigState.READY, "READY: its DC link is fed")):
            transition(bench.rig, state)
            with pytest.raises(InterlockError, match=said):
                line.hang(ON_FAR)
        begun = bench.rig.clock.now_ns()
        with within_reach(bench.rig):
            assert plant.link_V > 390
            line.hang(ON_FAR)
            assert plant.link_V < 60
        took = (bench.rig.clock.now_ns() - begun) * 1e-9
        assert bench.rig.levitation.state is RigState.READY
        assert plant._p.hung == pytest.approx(0.4, rel=1e-3)
        assert took > 2.0 * math.log(400 / 60) + 5.0


def test_an_open_bleeder_leaves_everybody_away() -> None:
    with opened(seed=3, discharge_factor=1e6) as bench:
        transition(bench.rig, RigState.READY)
        transition(bench.rig, RigState.OFF)
        with pytest.raises(NotDischarged, match=r"found 399 V 15 s after.*Nobody was asked"):
            bench.rig.operator.hang(ON_FAR)
        assert plant_of(bench)._p.hung == 0


def test_the_simulated_person_touches_nothing_live() -> None:
    with opened(seed=3) as bench:
        line = bench.rig.operator
        assert isinstance(line, LineOperator)
        line.approach = lambda: ""
        with pytest.raises(OperatorRefused, match=r"the machine is live: OFF, 3.. V"):
            line.hang(ON_FAR)


class Told:
    """A controller that is off, and whose telemetry tells `volts` of the time; `stale`: from then on nothing comes."""

    def __init__(self, volts: Any, stale: float = math.inf) -> None:
        self.rig, self.mode, self.now = load_rig("lira"), "OFF", 0.0
        self.volts, self.stale = volts, stale
        self.clock = SimpleNamespace(now_ns=lambda: round(self.now * 1e9), sleep=self.sleep)
        self.telemetry = self

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def require_landed(self) -> None: ...

    @property
    def newest_ns(self) -> int:
        return round(min(self.now, self.stale) * 1e9)

    def reading(self, channel: str) -> float:
        assert channel == "u_dc"
        return float(self.volts(min(self.now, self.stale)))


def test_one_low_reading_is_none() -> None:
    slow = Told(lambda t: 400 * math.exp(-t / 2))
    assert approach(slow)() == "The machine is off and its shaft lies; the DC link reads 54 V, below 60 V."  # type: ignore[arg-type]
    assert slow.now >= 2 * math.log(400 / 60) + APART_NS * 1e-9
    low = Told(lambda t: 5.0)
    approach(low)()  # type: ignore[arg-type]
    assert low.now > APART_NS * 1e-9 + 0.01  # a reading of before it was asked is none
    for volts, stale in ((lambda t: 5.0, 0.0), (lambda t: 5.0, 0.1), (lambda t: math.nan, math.inf), (lambda t: -400, math.inf),
                         (lambda t: 5.0 if round(t * 20) % 3 else 400.0, math.inf)):  # fmt: skip
        with pytest.raises(NotDischarged):
            approach(Told(volts, stale))()  # type: ignore[arg-type]


def test_a_machine_that_comes_on_meanwhile_is_not_touched() -> None:
    told = Told(lambda t: 400)

    def on(seconds: float) -> None:
        told.now += seconds
        told.mode = "READY" if told.now > 1 else "OFF"

    told.clock.sleep = on
    with pytest.raises(InterlockError, match="went into state READY"):
        approach(told)()  # type: ignore[arg-type]


def test_a_rig_without_a_link_is_touched_as_before() -> None:
    told = Told(lambda t: 400)
    told.rig, told.mode = load_rig("tsbs12"), "LEVITATED"
    assert approach(told)() == ""  # type: ignore[arg-type]
    assert "levitates" in standing(told)()  # type: ignore[arg-type]
    for mode, said in (("OFF", ""), ("READY", "The amplifiers are on."), ("LANDING", "The shaft may move")):
        told.mode = mode
        assert standing(told)().startswith(said)  # type: ignore[arg-type]
        assert bool(standing(told)()) == bool(said)  # type: ignore[arg-type]


def test_a_person_is_told_what_the_link_reads_and_what_is_live() -> None:
    asked: list[str] = []

    def prompt(question: str) -> str:
        asked.append(question)
        return "yes" if "yes or no" in question else ""

    with opened(seed=3, discharge=0.5) as bench:
        person = ConsoleOperator(prompt, bench.rig.clock, bench.controller.envelope, None)
        person.approach, person.standing = approach(bench.controller), standing(bench.controller)
        transition(bench.rig, RigState.LEVITATED)
        assert person.ask("Does it hum?")
        with pytest.raises(InterlockError, match="nobody may touch"):
            person.hang(ON_FAR)
        with within_reach(bench.rig):
            person.hang(ON_FAR)
    assert asked[0].startswith(
        "The shaft levitates and the amplifiers are on: touch nothing but what you are asked to.\nDoes it hum?"
    )
    assert len(asked) == 2
    assert asked[1].startswith("The machine is off and its shaft lies; the DC link reads ")
    assert " V, below 60 V.\nPut the hanger on the hook far. Hang M2 on the hanger." in asked[1]


def test_a_link_is_read_by_a_channel_in_volts() -> None:
    rig = load_rig("lira")
    for channel in ("x1", "u_cd"):
        dc = rig.capabilities.dc_link
        assert dc is not None
        other = rig.capabilities.model_copy(update={"dc_link": dc.model_copy(update={"channel": channel})})
        found = list(problems_of(rig.model_copy(update={"capabilities": other})))
        assert [p.key for p in found] == ["capabilities.dc_link.channel"]


def test_what_hangs_moves_as_a_mass_of_its_own() -> None:
    """Accelerations of a mover at rest, currents off, against the definitions: one body and a point on its axis."""
    p = ideal(PlantParams(cogging_force=0.0, centre=(20e-6, -10e-6, 5e-6, 30e-6)))
    bare, plant = Plant(p), Plant(p)
    mass, at = 0.4, 0.06
    plant.hang(mass, mass * p.gravity, at)
    for one in (bare, plant):
        one.put(z=p.middle)
        one.run(1 / 280_000)
    m, turn = p.mass, p.transverse_inertia
    rates = bare.place[6:] * 280_000
    for first, other, sign, pulls in ((0, 3, 1, 0.0), (1, 2, -1, -mass * p.gravity)):
        square = np.array([[m + mass, sign * mass * at], [sign * mass * at, turn + mass * at**2]])
        acts = np.array([m * rates[first] + pulls, turn * rates[other] + sign * at * pulls])
        found = plant.place[[6 + first, 6 + other]] * 280_000
        assert found == pytest.approx(np.linalg.solve(square, acts), rel=1e-3)


def test_currents_carry_what_hangs_by_statics() -> None:
    """K_B1 i_1 = W (1/2 + h/2l) and K_B2 i_2 = W (1/2 - h/2l), with the mover in the middle between both."""
    p = ideal(PlantParams(bearing_constant=(3.81, 3.59), mass=1.34))
    means = []
    for newtons in (0.0, 3.924):
        plant = Plant(p, reduced=True)
        plant.set("observer", 2.0)
        plant.hang(newtons / p.gravity, newtons, 0.06)
        plant.command("idle")
        plant.command("on")
        plant.command("lift")
        plant.beat()
        for k in range(40):
            plant.beat()
            plant.run(0.05)
            if k == 20:
                plant.go("z", p.middle)
        assert plant.state == "LEVITATED"
        plant.beat()
        rows = plant.run(0.05)
        means.append(rows[:, [TRACE.index("i_q_B1"), TRACE.index("i_q_B2")]].mean(axis=0))
    expected = 3.924 * np.array([0.5 + 60 / 90, 0.5 - 60 / 90]) / np.array([3.81, 3.59])
    assert means[1] - means[0] == pytest.approx(expected, rel=1e-3)


def test_currents_come_on_again_without_a_kick() -> None:
    """While PWM is off no integrator adds up what the current sensors are off: seconds of 20 mA would trip at 12 A."""
    plant = Plant(replace(PlantParams(), coil_offset=(0.02, -0.02, 0.01) * 5), 1)
    plant.command("idle")
    plant.command("on")
    plant.run(0.05)
    plant.command("stop")
    plant.run(2.0)
    plant.command("on")
    most = 0.0
    for _ in range(40):
        plant.run(0.25e-3)
        most = max(most, float(np.abs(plant.electric[3]).max()))
    assert plant.fault == "NONE"
    assert most < 1.5
