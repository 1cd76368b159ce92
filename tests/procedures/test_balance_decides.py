"""Which numbers decide in a balancing: each decision flips where they do, and with nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from balanced import RIG

from bench.analysis.balance import bound
from bench.analysis.vectors import Vectors
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.balance import checks, decision
from procedures.balance.plan import Plan
from procedures.balance.planes import planes_of
from procedures.balance.steps import DECISION

PER = 1e-6  # kg m, permissible in both planes


def left(inboard: float, outboard: float, u: float = 0.0, per: tuple[float, float] = (PER, PER)) -> Any:
    """A balancing of which a run has left so much by plane, kg m, with u in each part."""
    vectors = Vectors(np.array([inboard, outboard], complex), np.eye(4) * u**2, 10.0)
    return SimpleNamespace(
        unbalance={"run": vectors}, permissible=[SimpleNamespace(value=x) for x in per], planes=planes_of(RIG)
    )


@pytest.mark.parametrize(("amount", "inside"), [(0.999, True), (1.001, False)])
def test_a_plane_is_reached_by_its_own_amount_against_its_own_permissible_one(amount: float, inside: bool) -> None:
    assert decision.is_reached(left(amount * PER, 0.0), "run") == (inside, True)
    assert decision.is_reached(left(0.0, amount * PER), "run") == (True, inside)
    both = left(3 * PER, amount * PER, per=(4 * PER, PER))
    assert decision.is_reached(both, "run") == (True, inside)
    assert decision.correction(left(0.0, amount * PER), "run", RIG, Plan()).reached == inside
    assert decision.correction(left(amount * PER, 0.0), "run", RIG, Plan()).reached == inside


def test_what_is_not_known_of_the_amount_decides_with_it() -> None:
    """The farthest point of the 95 % region, not the middle: at 0.8 of the permissible one the scatter alone flips it."""
    sharp, blurred = left(0.8 * PER, 0.0, u=0.01 * PER), left(0.8 * PER, 0.0, u=0.2 * PER)
    assert decision.is_reached(sharp, "run") == (True, True)
    assert decision.is_reached(blurred, "run") == (False, True)
    assert bound(blurred.unbalance["run"].one(0)) > PER > bound(sharp.unbalance["run"].one(0))
    assert not decision.correction(blurred, "run", RIG, Plan()).reached


@pytest.mark.parametrize(
    ("amounts", "u", "codes"),
    [((0.9, 0.9), 0.0, ["reached", "reached"]), ((0.9, 1.1), 0.0, ["reached", "not-reached"]),
     ((1.1, 0.9), 0.0, ["not-reached", "reached"]), ((0.9, 0.1), 0.1, ["not-reached", "reached"])],
)  # fmt: skip
def test_the_line_of_each_plane_says_what_was_decided(amounts: tuple[float, float], u: float, codes: list[str]) -> None:
    balance = left(*(x * PER for x in amounts), u=u * PER)
    balance.solved = SimpleNamespace(condition=2.0, influence=np.ones((1, 4, 2), complex))
    recorded: Any = SimpleNamespace(machine=conventions(RIG), on=(), fixed=())
    run: Any = SimpleNamespace(name="run")
    found = [f for f in checks.of_result(balance, recorded, [run], Plan(), RIG) if f.code in ("reached", "not-reached")]
    assert [f.code for f in found] == codes
    for p, f in enumerate(found):
        most = bound(balance.unbalance["run"].one(p))
        assert f"U_res {amounts[p]:.2f}" in f.text
        assert f"together {most / PER:.2f} g mm; U_per 1.00 g mm" in f.text
        assert (f.code == "reached") == (most <= PER)


def with_heaviest(kg: float) -> RigFile:
    return RIG.model_copy(update={"envelope": RIG.envelope.model_copy(update={"max_trial_weight_kg": kg})})


@pytest.mark.parametrize(("share", "refused"), [(0.999, True), (1.001, False)])
def test_a_correction_is_refused_by_its_heaviest_weight_against_the_envelope(share: float, refused: bool) -> None:
    found = left(3 * PER, 5 * PER)
    kg = 5 * PER / planes_of(RIG)[1].radius.value
    needed = decision.correction(found, "run", with_heaviest(share * kg), Plan())
    assert needed.too_heavy == pytest.approx(kg if refused else 0.0)
    assert [plane for plane, _, _ in needed.weights] == [0, 1]


@pytest.mark.parametrize(("too_heavy", "codes"), [(1e-3, ["correction-refused"]), (0.0, [])])
def test_the_recorded_decision_is_told_by_its_weight(too_heavy: float, codes: list[str]) -> None:
    decided = {DECISION: [{"run": "check 1", "reached": False, "too_heavy_kg": too_heavy}]}
    recording: Any = SimpleNamespace(events=lambda name: decided.get(name, []))
    found = list(checks.refusals(recording))
    assert [f.code for f in found] == codes
    assert all(f.where == "check 1" and "1 g in one place" in f.text for f in found)


def two_biases(inboard: float, outboard: float) -> RigFile:
    """The AMB stand with a bias of its own for each bearing, and no law that inverts their forces."""
    one = RIG.parameters["bias"]
    parameters = {**RIG.parameters, "bias": one.model_copy(update={"default": inboard}),
                  "bias_o": one.model_copy(update={"default": outboard, "index": 999})}  # fmt: skip
    can = RIG.capabilities.model_copy(update={"bias": {"inboard": "bias", "outboard": "bias_o"}, "flatness": {}})
    return RIG.model_copy(update={"parameters": parameters, "capabilities": can})


def test_the_first_guess_of_the_response_goes_by_the_bias_of_each_bearing() -> None:
    """A softer bearing lets the shaft move farther on its way through the rigid modes: less bias, less of kp and kd."""
    plan = Plan(law="PID", speeds_rad_s=(400.0, 1000.0))
    alike = decision.gain(two_biases(1.0, 1.0), plan, 0)
    near, far = (decision.gain(two_biases(*b), plan, 0) for b in ((0.8, 1.0), (1.0, 0.8)))
    both = decision.gain(two_biases(0.8, 0.8), plan, 0)
    assert alike == pytest.approx(decision.gain(RIG, plan, 0), rel=1e-9)
    assert near != pytest.approx(alike, rel=1e-3)
    assert far != pytest.approx(alike, rel=1e-3)
    assert abs(both - alike) > max(abs(near - alike), abs(far - alike))


def test_without_a_bias_that_is_told_the_response_is_taken_at_its_most() -> None:
    plan = Plan(law="PID", speeds_rad_s=(400.0, 1000.0))
    told = two_biases(1.0, 1.0)
    lacking = told.model_copy(
        update={"capabilities": told.capabilities.model_copy(update={"bias": {"inboard": "bias"}})}
    )
    own = decision.gain(told, plan, 0) / decision.gain(lacking, plan, 0) * decision.AMPLIFIED
    assert decision.gain(lacking, plan, 0) > decision.gain(told, plan, 0)
    assert 1 <= own < decision.AMPLIFIED
    kg, less = (decision.allowed_kg(rig, plan, 0) for rig in (told, lacking))
    assert less < kg
