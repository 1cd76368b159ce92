"""Plans of a rig for which nobody states one: with its own masses, and at speeds that it may have."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from bench.cli.loading import load_procedure
from bench.plan import BenchPlan
from bench.procedure.plans import assemble
from bench.rigfile import RigFile, load_rig
from bench.units import RPM
from procedures.shared.default_masses import by_weight

ROOT = Path(__file__).resolve().parents[2]


def plan(procedure: str, rig: RigFile) -> Any:
    of = load_procedure(procedure)
    made: BenchPlan = assemble(of.plan, of.defaults(rig))
    return made


def stand(**masses: float) -> RigFile:
    """The plain stand without plans of its own, and with other masses, kg."""
    rig = load_rig(str(ROOT / "examples/plain-stand/stand.toml"))
    hung = {label: rig.masses["G1"].model_copy(update={"value": kg}) for label, kg in masses.items()}
    return rig.model_copy(update={"plans": {}, **({"masses": hung} if masses else {})})


def spindle(most: float) -> RigFile:
    """The vertical spindle without plans of its own, with that envelope, rad/s."""
    rig = load_rig(str(ROOT / "examples/vertical-spindle/spindle.toml"))
    return rig.model_copy(update={"plans": {}, "envelope": rig.envelope.model_copy(update={"max_speed_rad_s": most})})


def test_the_rig_s_own_masses_hang_in_the_order_of_their_weight() -> None:
    rig = stand(**{"5 N": 0.5, "red": 0.2, "blue": 1.0, "ten": 10.0, "green": 0.7, "red too": 0.2})
    assert by_weight(rig) == ("red", "5 N", "green", "blue")  # the envelope has 1.6 kg
    assert plan("amb-calibration", rig).masses == ("red", "5 N", "green", "blue")
    assert plan("estimator-compare", rig).load == "red"
    assert plan("load-response", rig).lever_masses == ("5 N", "green")
    assert (plan("axis-friction", rig).mass, plan("axis-friction", rig).lever_mass) == ("5 N", "red")


def test_what_the_rig_file_plans_comes_before() -> None:
    rig = stand(a=0.1, b=0.2, c=0.3, d=0.4, e=0.5)
    rig = rig.model_copy(update={"plans": {"amb-calibration": {"masses": ["b", "c", "d", "e"]}}})
    assert plan("amb-calibration", rig).masses == ("b", "c", "d", "e")


def test_too_few_masses_are_named_by_the_rig_s_names() -> None:
    rig, procedure = stand(small=0.2, large=0.5), load_procedure("amb-calibration")
    (said,) = procedure.check(rig, plan("amb-calibration", rig))
    assert said == "masses: found small, large; expected 4 or more, each heavier than the one before"


@pytest.mark.parametrize("procedure", ["unbalance", "run-up", "coast-down", "balance"])
def test_speeds_are_those_that_the_envelope_allows(procedure: str) -> None:
    """At 8000 r/min the fastest is 7600; the others, and a slow roll beside them, in the same ratio or as they were."""
    ours, theirs = plan(procedure, spindle(math.inf)), plan(procedure, spindle(8000 / RPM))
    fastest = getattr(theirs, "top_rad_s", max(theirs.speeds_rad_s))
    assert fastest * RPM == pytest.approx(7600)
    share = fastest / getattr(ours, "top_rad_s", max(ours.speeds_rad_s))
    assert theirs.speeds_rad_s == pytest.approx([share * s for s in ours.speeds_rad_s])
    assert theirs.slow_rad_s <= 0.15 * min(theirs.speeds_rad_s) * (1 + 1e-12)
    assert not list(load_procedure(procedure).check(spindle(8000 / RPM), theirs))


def test_an_envelope_that_is_too_low_is_what_is_said() -> None:
    said = list(load_procedure("unbalance").check(spindle(75.0), plan("unbalance", spindle(75.0))))
    assert any("found 10000 r/min; the envelope allows 716 r/min" in text for text in said)
