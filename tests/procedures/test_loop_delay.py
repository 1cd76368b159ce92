"""How the currents lag: what a rig file states of it, what is taken where it does not, and what `step` makes of it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from procedures.amb_rotor import loops
from procedures.step.estimates import ALIAS, RISE_SHARE, START_S, aliased, lag_estimate, spline_left, start_s
from sim_backend.machines.twin.rules import drawn

STAND = Path(__file__).parents[2] / "examples" / "plain-stand" / "stand.toml"


def stated(line: str) -> RigFile:
    """The plain stand with another line of its loop delay."""
    rig = load_rig(str(STAND))
    lines = [line if one.startswith("loop_delay") else one for one in rig.toml_text.splitlines()]
    return RigFile.parse("\n".join(lines), rig.dbc_text)


def test_a_tick_of_computing_is_no_part_of_the_currents_lag() -> None:
    rig = load_rig(str(STAND))
    doubt = loops.lag_doubt(rig)
    assert loops.lag_s(rig) == pytest.approx(1.99e-4)
    assert doubt is not None
    assert (doubt.value, doubt.half_width) == (0.0, pytest.approx(1e-5))


def test_a_plain_number_is_known_to_a_tenth() -> None:
    told = stated("loop_delay_s = 3.24e-4").capabilities.loop_delay
    assert told is not None
    assert (told.value, told.unit, told.half_width) == (3.24e-4, "s", pytest.approx(3.24e-5))


def test_what_is_not_told_can_be_anything_and_says_which_key_tells_it() -> None:
    lag = lag_estimate(stated(""))
    assert lag is not None
    (influence,) = lag.sensitivities
    assert loops.lag_s(stated("")) == pytest.approx(3e-4)
    assert influence.u == pytest.approx(3e-4 / math.sqrt(3))
    assert influence.id == "capabilities/loop_delay"
    assert "capabilities.loop_delay" in influence.source


def test_what_the_controller_knows_is_in_no_doubt() -> None:
    assert lag_estimate(load_rig("amb5dof")) is None


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ('loop_delay = { value = 1, unit = "m", half_width = 0.1, distribution = "rectangular", source = "?" }',
         "capabilities.loop_delay.unit: found m; expected a time"),
        ("loop_delay_s = 1e-4", "capabilities.loop_delay: found 0.1 ms; expected more than a tick, 0.125 ms"),
    ],
)  # fmt: skip
def test_a_delay_that_cannot_be_is_refused(line: str, found: str) -> None:
    (problem,) = problems_of(stated(line))
    assert found in str(problem)


def test_the_twins_amplifiers_are_what_the_file_says() -> None:
    at = drawn(load_rig(str(STAND)))["amplifier_hz"]
    slow = drawn(stated("loop_delay_s = 5.25e-4"))["amplifier_hz"]
    by_rule = drawn(stated(""))["amplifier_hz"]
    assert (at.value, at.half_width) == (pytest.approx(800, rel=1e-3), pytest.approx(40, rel=0.01))
    assert slow.value == pytest.approx(1 / (2 * math.pi * 4e-4))
    assert (by_rule.value, by_rule.half_width) == (800, 40)


def test_a_lag_that_only_the_controller_tells_is_known_to_a_data_sheets_share() -> None:
    amb = load_rig("amb5dof")
    assert lag_estimate(amb) is None
    assert start_s(amb) == pytest.approx(START_S + 0.05 * loops.lag_s(amb))
    assert start_s(load_rig(str(STAND))) == START_S


def test_what_sampling_leaves_falls_with_the_samples_of_a_rise() -> None:
    assert spline_left(2.6e-3, 1e-3) == RISE_SHARE * 1e-3
    assert spline_left(2.6e-3, 5e-4) == pytest.approx(2e-6, rel=0.01)
    assert aliased(100.0, 1e-3) == ALIAS * 100.0
    assert aliased(115.0, 5e-4) == pytest.approx(6.8e-4 * 115, rel=0.01)
    assert aliased(480.0, 2.5e-3) == ALIAS * 480.0
