"""Load balancing of drawn machines: what they do, against the quasi-static formula by their own constants."""

from __future__ import annotations

import math

import pytest

from bench.rigfile import load_rig
from sim_backend.motion import CircleAsked
from sim_backend.truth import draw, nominal

LIMIT, SLEW = math.radians(8), math.radians(25)


def circled(rig: str, seed: int, branch: int, hz: float = 0.25, **truth: float) -> dict[tuple[str, str], float]:
    file = load_rig(rig)
    drawn = draw(file, seed, truth)
    asked = CircleAsked(
        {name: p.default for name, p in file.parameters.items()}, {"motor_share": 1.0, "allocation": 1.0, "gamma_slew": SLEW},
        {"circle_radius": 1e-4, "circle_hz": hz}, {"balance": 1.0}, 1e-4, hz, 4.0, math.radians(126), SLEW, LIMIT, [branch],
    )  # fmt: skip
    assert drawn.machine.motions.circle is not None
    return dict(drawn.machine.motions.circle(file, drawn, asked))


@pytest.mark.parametrize(("rig", "seed", "branch"), [("tsbs12", 1, 1), ("tsbs12", 3, -1), ("tsbs12-offset", 2, -1)])
def test_drawn_machines_do_what_the_formula_says(rig: str, seed: int, branch: int) -> None:
    found = circled(rig, seed, branch)
    assert found["reduction", ""] == pytest.approx(found["predicted_reduction", ""], abs=2e-3)
    assert found["unbalance_ratio", ""] < (1 / 1.5 if found["gamma_extreme", ""] > 0.999 * LIMIT else 1 / 2.5)


def test_the_printed_reduction_and_what_wrapping_leaves_of_it() -> None:
    """T 6.7.3 prints 26 %; wrapped into two quadrants the prototype of the design has 2.3 %."""
    truth = dict(nominal(load_rig("tsbs12-offset")))
    assert circled("tsbs12-offset", 1, -1, **truth)["reduction", ""] == pytest.approx(-0.26, abs=0.02)
    wrapped = circled("tsbs12-offset", 1, -1, **truth, factor_balance=2.0)
    assert wrapped["reduction", ""] == pytest.approx(-0.023, abs=0.015)


def test_a_bound_that_is_another_than_was_asked_is_a_bound_to_the_truth_too() -> None:
    """A top cut off at 0.7 of the limit: a parabola through its flat part is 1.2 % above what gamma goes to."""
    asked = {**nominal(load_rig("tsbs12-offset")), "factor_gamma_max": 0.7}
    found = circled("tsbs12-offset", 1, -1, **asked)
    assert found["gamma_extreme", ""] == pytest.approx(0.7 * LIMIT, rel=1e-4)
