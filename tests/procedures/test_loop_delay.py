"""How the currents lag: what a rig file states of it, what is taken where it does not, and what `step` makes of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from procedures.amb_rotor import loops
from procedures.amb_rotor.onset import onset
from procedures.step.acting import WINDOW_S
from procedures.step.estimates import ALIAS, aliased
from procedures.step.influences import lag_estimate
from procedures.step.rising import RISE_SHARE, spline_left
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


@pytest.mark.parametrize("begun", [0.0, 6e-5, 1.1e-4])
def test_single_readings_tell_a_start_that_means_of_half_a_millisecond_miss(begun: float) -> None:
    """The shape of the plain stand's currents, whose shaft is half way in a millisecond."""
    lag, tick = 2e-4, 1.25e-4
    t = np.arange(-200, 80) * tick
    since = np.maximum(t - tick - begun - 2 * tick, 0)
    current = 1 - np.exp(-since / lag) - 2e5 * since**2
    current = current + 0.02 * np.random.default_rng(0).standard_normal(len(t))
    found, _ = onset(t, current, begun - 7e-4, begun + 3e-4, tick=tick, ticks=1, lag_s=lag, window_s=WINDOW_S)
    assert found == pytest.approx(begun, abs=4e-5)


def test_what_sampling_leaves_falls_with_the_samples_of_a_rise() -> None:
    assert spline_left(2.6e-3, 1e-3) == RISE_SHARE * 1e-3
    assert spline_left(2.6e-3, 5e-4) == pytest.approx(2e-6, rel=0.01)
    assert aliased(100.0, 1e-3) == ALIAS * 100.0
    assert aliased(115.0, 5e-4) == pytest.approx(6.8e-4 * 115, rel=0.01)
    assert aliased(480.0, 2.5e-3) == ALIAS * 480.0
