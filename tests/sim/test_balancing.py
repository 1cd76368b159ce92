"""Load balancing of drawn machines: what they do, against the quasi-static formula by their own constants."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.rigfile import load_rig
from sim_backend.machines.tsbs.balancing import folded, top
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


@pytest.mark.parametrize("hz", [0.01, 0.1, 0.25, 0.3, 0.37, 1.0])
def test_a_circle_of_any_rate_has_the_peak_of_its_load(hz: float) -> None:
    """48 turns at 1 kHz, |i_y| = 4.0 + 2.8 cos A with its top at 126 degrees: a turn of 0.3 Hz is no whole number of values."""
    t = (np.arange(round(48 / (hz * 1e-3))) + 0.5) * 1e-3
    found = folded(4.0 + 2.8 * np.cos(2 * math.pi * (hz * t - 0.35)), hz)
    assert 100 <= len(found) <= 400
    assert top(found) == pytest.approx(6.8, rel=1e-5)
    assert abs(np.argmax(found) / len(found) - 0.35) < 1.5 / len(found)


def test_circles_whose_turn_is_no_whole_number_of_means_have_a_truth() -> None:
    """At 0.3 Hz as at 0.25: the load is the same, and the path hardly another."""
    found, usual = (circled("tsbs12-offset", 2, -1, hz=hz) for hz in (0.3, 0.25))
    assert found["peak_i_y", "before"] == pytest.approx(usual["peak_i_y", "before"], rel=1e-3)
    assert found["reduction", ""] == pytest.approx(found["predicted_reduction", ""], abs=2e-3)
