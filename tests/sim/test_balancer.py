"""Weights in the balancing planes: from the role through the line to the simulated shaft, and through a person."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.cli.safety import may_touch
from bench.errors import BenchError, InterlockError, OperatorAbort
from bench.link.session import Session
from bench.rigfile import load_rig
from bench.rigfile.check import problems_of
from bench.rigfile.envelope import Envelope
from drivers.controller import Controller
from drivers.operator import LineOperator
from drivers.person import ConsoleOperator
from sim_backend.endpoint import SimulatedRig
from sim_backend.machines.amb5dof.plant import AmbPlant
from sim_backend.truth import draw

RIG = load_rig("amb5dof")


class Bench:
    """A simulated stand, its controller's driver and who works on it."""

    def __init__(self, **truth: float) -> None:
        self.machine = SimulatedRig(RIG, draw(RIG, 4, truth), 1)
        self.controller = Controller(RIG, self.machine.link, self.machine, Session(1, 1_767_225_600, "test"))
        self.controller.connect()
        self.hands = LineOperator(self.machine.request, self.controller.clock, Envelope(RIG))
        self.hands.may_touch = may_touch(self.controller, None)

    def weights(self) -> np.ndarray:
        """Of both planes, kg m, complex: y + i z."""
        plant = self.machine.device.plant
        assert isinstance(plant, AmbPlant)
        return np.array(list(plant._s.weight_c)) + 1j * np.array(list(plant._s.weight_s))


def test_a_weight_sits_where_it_was_asked_for_within_the_stated_errors() -> None:
    bench, radius = Bench(), 25e-3
    before = bench.machine.now_ns()
    bench.hands.attach("inboard", 0.2e-3, math.pi / 2)
    assert bench.machine.now_ns() - before == pytest.approx(1e9)
    first, other = bench.weights()
    assert other == 0
    assert abs(first) == pytest.approx(0.2e-3 * radius, rel=0.03)
    assert math.degrees(np.angle(first)) == pytest.approx(90, abs=1.0)
    assert abs(first) != pytest.approx(0.2e-3 * radius, rel=1e-4)
    bench.hands.attach("outboard", 0.1e-3, 0.0)
    bench.hands.attach("outboard", 0.1e-3, math.pi)  # nearly takes the other away
    assert abs(bench.weights()[1]) < 0.1e-3 * radius * 0.1
    bench.hands.detach("outboard")
    assert bench.weights().tolist() == [first, 0]
    bench.hands.detach("inboard")
    assert bench.weights().tolist() == [0, 0]


def test_weights_of_a_run_are_not_those_of_another_seed() -> None:
    one, same = Bench(), Bench()
    for bench in (one, same):
        bench.hands.attach("inboard", 0.2e-3, 1.0)
    assert one.weights().tolist() == same.weights().tolist()


def test_a_weight_that_falls_off() -> None:
    bench = Bench(weight_lost=1.0)
    bench.hands.attach("inboard", 0.2e-3, 1.0)
    assert bench.weights().tolist() == [0, 0]


def test_nobody_touches_a_shaft_that_is_not_landed() -> None:
    bench = Bench()
    bench.controller.enable()
    bench.hands.attach("inboard", 0.1e-3, 0.0)  # the amplifiers may be on
    bench.controller.levitate()
    for act in (lambda: bench.hands.attach("inboard", 0.1e-3, 0.0), lambda: bench.hands.detach("inboard")):
        with pytest.raises(InterlockError, match="nobody may touch the shaft in state LEVITATED"):
            act()
    assert abs(bench.weights()[0]) > 0


@pytest.mark.parametrize("mass", [0.0, -1e-4, 0.51e-3, math.nan])
def test_the_envelope(mass: float) -> None:
    with pytest.raises(InterlockError, match=r"the envelope allows above 0 to 0\.5 g"):
        LineOperator(lambda _: "ok", None, Envelope(RIG)).attach("inboard", mass, 0.0)  # type: ignore[arg-type]
    plain = RIG.model_copy(update={"envelope": RIG.envelope.model_copy(update={"max_trial_weight_kg": 0.0})})
    with pytest.raises(InterlockError, match="to 0 g"):
        LineOperator(lambda _: "ok", None, Envelope(plain)).attach("inboard", 1e-4, 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "line", ["attach", "attach middle 1e-4 0", "attach inboard x 0", "attach inboard nan 0", "attach inboard 1e-4",
             "attach inboard 0 0", "detach", "detach both", "hang M1"],
)  # fmt: skip
def test_lines_that_nobody_understands(line: str) -> None:
    machine = SimulatedRig(RIG, draw(RIG, 4), 1)
    assert machine.request(line) == f"error cannot {line!r}"


def test_the_other_machine_has_no_balancing_planes() -> None:
    rig = load_rig("tsbs12")
    machine = SimulatedRig(rig, draw(rig, 1), 1)
    assert machine.request("attach inboard 1e-4 0").startswith("error")
    hands = LineOperator(machine.request, machine, Envelope(RIG))
    with pytest.raises(BenchError, match=r"asked to fix 0.1 g in the inboard plane and answers .error cannot"):
        hands.attach("inboard", 1e-4, 0.0)


def test_a_person_is_told_every_step() -> None:
    bench, asked, answers = Bench(), list[str](), ["", "", "stop"]

    def prompt(question: str) -> str:
        asked.append(question)
        return answers[len(asked) - 1]

    person = ConsoleOperator(prompt, bench.controller.clock, Envelope(RIG), bench.hands)
    person.may_touch = bench.hands.may_touch
    person.attach("outboard", 0.25e-3, -math.pi / 4)
    assert abs(bench.weights()[1]) > 0
    person.detach("outboard")
    assert bench.weights()[1] == 0
    with pytest.raises(OperatorAbort):
        person.attach("inboard", 0.1e-3, 0.0)
    assert bench.weights()[0] == 0
    assert asked[0].startswith(
        "The shaft is landed and stands. Weigh out 0.250 g and fix it in the outboard balancing plane at 315.0° of its scale"
    )
    assert "Take every weight that was fixed in the outboard balancing plane off" in asked[1]


def test_the_rig_file_states_what_a_weight_is() -> None:
    assert problems_of(RIG) == []
    assert RIG.machine["weight_mass"].standard_uncertainty == pytest.approx(1e-6)
    assert RIG.geometry["balance_radius"].value == 25e-3


def test_the_weight_that_was_really_fixed_can_be_told() -> None:
    bench, answers = Bench(), iter(["0.143 270", "9000 0", "one two", "0.2 nan", ""])
    asked: list[str] = []
    person = ConsoleOperator(
        lambda q: (asked.append(q), next(answers))[1], bench.controller.clock, Envelope(RIG), bench.hands
    )
    person.may_touch = bench.hands.may_touch
    assert person.attach("inboard", 0.145e-3, math.radians(273)) == pytest.approx((0.143e-3, math.radians(270)))
    radius = RIG.geometry["balance_radius"].value
    assert abs(bench.weights()[0]) == pytest.approx(0.143e-3 * radius, rel=0.05)
    assert person.attach("inboard", 0.145e-3, 0.0) == (0.145e-3, 0.0)
    assert "weight: found 9000 g; the envelope allows" in asked[2]
    assert asked[3].startswith("'one two' is no answer here.")
