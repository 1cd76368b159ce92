"""The operator's verbs from the role through the line to the simulated shaft, and through a person."""

from __future__ import annotations

import pytest

from bench.errors import BenchError, InterlockError, OperatorAbort
from bench.procedure.roles import NOTHING, Load
from bench.rigfile import load_rig
from bench.rigfile.envelope import Envelope
from drivers.operator import LineOperator
from drivers.person import ConsoleOperator
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("tsbs12")


@pytest.fixture
def machine() -> SimulatedRig:
    return SimulatedRig(RIG, draw(RIG, 1))


@pytest.fixture
def hands(machine: SimulatedRig) -> LineOperator:
    return LineOperator(machine.request, machine, Envelope(RIG))


def test_a_mass_on_the_lever_turns_the_shaft(machine: SimulatedRig, hands: LineOperator) -> None:
    state, truth = machine.device.plant._s, machine.truth
    for side, load, sign in (("left", "M2", 1), ("right", "M3", -1), ("right", "", 0)):
        before = machine.now_ns()
        hands.lever(side, Load(load))  # type: ignore[arg-type]
        assert machine.now_ns() - before == pytest.approx(0.3e9)
        kg, newtons, arm = truth.on_lever(side, load)
        assert state.lever_moment == pytest.approx(newtons * arm, rel=1e-9)
        assert state.lever_weight == pytest.approx(newtons, rel=1e-9)
        assert state.lever_inertia == pytest.approx(kg * arm**2, rel=1e-12)
        assert (state.lever_moment > 0) - (state.lever_moment < 0) == sign
    assert state.weight == 0  # the hook is another matter


def test_the_ring_is_put_on_and_taken_off(machine: SimulatedRig, hands: LineOperator) -> None:
    state = machine.device.plant._s
    hands.mount("ring")
    assert state.ring_inertia == machine.truth.values["ring_inertia"]
    hands.mount("")
    assert state.ring_inertia == 0


@pytest.mark.parametrize(
    "line", ["lever up M2", "lever left M9", "lever left", "mount wheel", "hang M9", "hang", "", "dance"]
)
def test_what_cannot_be_done_is_said(machine: SimulatedRig, line: str) -> None:
    assert machine.request(line) == f"error cannot {line!r}"


def test_answers(machine: SimulatedRig) -> None:
    assert machine.request("lever left M1") == "ok 0.3"
    assert machine.request("lever left -") == "ok 0.3"
    assert machine.request("hang -") == "ok 0.3"
    assert machine.request("mount -") == "ok 0.3"
    assert machine.request("ask is it there?") == "yes"


def test_a_mass_beyond_the_envelope_is_not_asked_for() -> None:
    asked: list[str] = []
    low = RIG.model_copy(update={"envelope": RIG.envelope.model_copy(update={"max_hung_kg": 1.5})})
    hands = LineOperator(lambda line: asked.append(line) or "ok", None, Envelope(low))  # type: ignore[arg-type, func-returns-value]
    with pytest.raises(InterlockError, match="2 kg"):
        hands.lever("left", Load("M3"))
    assert asked == []


def test_a_refusal_says_what_was_asked() -> None:
    hands = LineOperator(lambda _: "error no lever", None, Envelope(RIG))  # type: ignore[arg-type]
    with pytest.raises(BenchError, match="asked to hang M2 on the lever's left and answers 'error no lever'"):
        hands.lever("left", Load("M2"))
    with pytest.raises(BenchError, match="asked to mount nothing"):
        hands.mount("")


def test_a_person_is_asked_and_the_simulated_rig_follows(machine: SimulatedRig, hands: LineOperator) -> None:
    asked: list[str] = []

    def prompt(question: str) -> str:
        asked.append(question)
        return "" if len(asked) < 5 else "stop"

    person = ConsoleOperator(prompt, machine, Envelope(RIG), hands)
    person.lever("left", Load("M1"))
    person.lever("left", NOTHING)
    person.mount("ring")
    person.mount("")
    assert "level and hang M1 on its left end (seen from outboard)" in asked[0]
    assert ["every mass off" in asked[1], "Mount the ring" in asked[2], "ring off" in asked[3]] == [True] * 3
    assert machine.device.plant._s.ring_inertia == 0
    with pytest.raises(OperatorAbort):
        person.mount("ring")


def person_answering(*answers: str, machine: SimulatedRig, hands: LineOperator) -> tuple[ConsoleOperator, list[str]]:
    asked: list[str] = []

    def prompt(question: str) -> str:
        asked.append(question)
        return answers[len(asked) - 1]

    return ConsoleOperator(prompt, machine, Envelope(RIG), hands), asked


def test_a_wrong_answer_is_explained_and_the_question_comes_again(machine: SimulatedRig, hands: LineOperator) -> None:
    person, asked = person_answering("xyz", "?", "", machine=machine, hands=hands)
    assert person.hang(Load("M2")) == Load("M2")
    assert asked[0].splitlines() == [
        "Hang M2 on the hanger.",
        "Press Enter when it hangs still, or type stop to end the run, ? for more.",
    ]
    assert asked[1].startswith("'xyz' is no answer here. Another mass hangs: type its label")
    assert asked[1].endswith(asked[0])
    assert asked[2].startswith("Another mass hangs: type its label (M1, M2, M3, M4, - for none).")


def test_who_is_there_is_asked_whether_to_go_on_and_nobody_says_no(machine: SimulatedRig, hands: LineOperator) -> None:
    person, asked = person_answering("hm", "yes", "no", "stop", machine=machine, hands=hands)
    assert person.goes_on("M4 hangs, and the current falls.")
    assert asked[0].splitlines() == ["M4 hangs, and the current falls.", "That is an error of this run. Go on all the same?",
                                     "Type yes or no, or stop to end the run."]  # fmt: skip
    assert asked[1].endswith(asked[0])
    assert not person.goes_on("The same.")
    with pytest.raises(OperatorAbort):
        person.goes_on("The same.")
    assert not hands.goes_on("The same.")


def test_nothing_is_asked_twice(machine: SimulatedRig, hands: LineOperator) -> None:
    person, asked = person_answering("", "", "", machine=machine, hands=hands)
    for load in (NOTHING, NOTHING, Load("M1"), NOTHING):
        person.hang(load)
    assert ["every mass off" in q for q in asked] == [True, False, True]


def test_what_really_hangs_can_be_told(machine: SimulatedRig, hands: LineOperator) -> None:
    person, asked = person_answering("m1", "", machine=machine, hands=hands)
    assert person.hang(Load("M2")) == Load("M1")
    assert person.hang(Load("M2")) == Load("M2")
    assert len(asked) == 2


class Steps:
    """A recorder whose newest step may have a load."""

    def __init__(self, loaded: bool) -> None:
        self.loaded, self.told = loaded, list[dict[str, str]]()

    def correct(self, **labels: str) -> bool:
        self.told += [labels] if self.loaded else []
        return self.loaded

    def event(self, kind: str, **fields: object) -> None: ...


@pytest.mark.parametrize(
    ("loaded", "said"), [(True, "Written down: M1 hung in the step before."), (False, "No step with a load")]
)
def test_what_hung_before_can_be_told(machine: SimulatedRig, hands: LineOperator, loaded: bool, said: str) -> None:
    person, asked = person_answering("was M1", "", machine=machine, hands=hands)
    person.recorder = steps = Steps(loaded)  # type: ignore[assignment]
    assert person.hang(Load("M2")) == Load("M2")
    assert asked[1].startswith(said)
    assert steps.told == ([{"load": "M1"}] if loaded else [])


def test_a_question_takes_yes_or_no(machine: SimulatedRig, hands: LineOperator) -> None:
    person, asked = person_answering("", "perhaps", "No", "y", machine=machine, hands=hands)
    assert not person.ask("Is the coupling off?")
    assert person.ask("Is the coupling off?")
    assert asked[1].startswith("An empty line is no answer here.")
    assert asked[2].startswith("'perhaps' is no answer here.")
