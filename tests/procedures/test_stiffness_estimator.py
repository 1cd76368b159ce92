"""The stiffness estimators on exact statics: right answers, what drops out, and the errata."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tsbs_statics import Shaft, amb_data, motor_data, parameters

from procedures.negative_stiffness import fit as negative_stiffness_fit

LEVELS = (-40e-6, -20e-6, 0.0, 20e-6, 40e-6)


@pytest.mark.parametrize("gamma_0", [0.0, np.radians(0.5), np.radians(-0.5)])
def test_the_motors_current_gives_the_stiffness(gamma_0: float) -> None:
    """Also with an encoder zero that is off: half a degree would be 0.7 % by i_y alone."""
    shaft = Shaft(gamma_0=gamma_0, winding=1.01)
    fit = negative_stiffness_fit.by_motor(motor_data(shaft, LEVELS), parameters(shaft))
    assert fit.stiffness == pytest.approx(shaft.stiffness, rel=1e-9)
    assert negative_stiffness_fit.scaled(fit.fit) < 1e-9


def test_by_the_vertical_current_alone_the_encoder_zero_biases_it() -> None:
    shaft = Shaft(gamma_0=np.radians(0.5))
    data = motor_data(shaft, LEVELS)
    i_y = (data.segments[0] - data.segments[2]) / 2
    alone = -parameters(shaft)["alpha_d"] * np.polyfit(data.y[1], i_y, 1)[0]
    assert alone / shaft.stiffness - 1 == pytest.approx(-((14.3 / 12.1 * np.tan(np.radians(4))) ** 2), rel=0.02)


@pytest.mark.parametrize("change", [{"beta_i": 3e-6}, {"offset_i": 60e-6}, {"gap": 0.45e-3}])
def test_the_inboard_amb_drops_out_of_the_motors_way(change: dict[str, float]) -> None:
    shaft = replace(Shaft(), **change)
    fit = negative_stiffness_fit.by_motor(motor_data(shaft, LEVELS), parameters(shaft))
    assert fit.stiffness == pytest.approx(Shaft().stiffness, rel=1e-9)


def test_an_inboard_sensor_that_does_not_read_zero_is_corrected() -> None:
    shaft = Shaft()
    fit = negative_stiffness_fit.by_motor(motor_data(shaft, LEVELS, y_is=3e-6), parameters(shaft))
    assert fit.stiffness == pytest.approx(shaft.stiffness, rel=1e-9)


def test_drift_shows_and_does_not_matter() -> None:
    shaft = Shaft()
    data = motor_data(shaft, LEVELS)
    ramp = np.zeros_like(data.segments)
    ramp[0] = 2e-3 * data.time_s
    fit = negative_stiffness_fit.by_motor(replace(data, segments=data.segments + ramp), parameters(shaft))
    assert fit.stiffness == pytest.approx(shaft.stiffness, rel=1e-6)
    assert fit.fit.terms[2] / shaft.alpha_d == pytest.approx(8e-3, rel=1e-3)  # half of 2 mA/s over 8 s


@pytest.mark.parametrize("change", [{}, {"offset_o": 40e-6}, {"gap": 0.48e-3, "beta_o": 1.7e-6}, {"alpha_x": 180e3}])
def test_two_biases_tell_motor_and_amb_apart(change: dict[str, float]) -> None:
    shaft = replace(Shaft(), **change)
    fit = negative_stiffness_fit.by_ambs(amb_data(shaft, LEVELS, (3.0, 4.0)), parameters(shaft))
    assert fit.stiffness == pytest.approx(shaft.stiffness, rel=1e-7)
    assert fit.gap_m == pytest.approx(shaft.gap, rel=1e-7)


def test_the_play_of_the_ambs_is_taken_by_the_branch() -> None:
    shaft = Shaft()
    plain = negative_stiffness_fit.by_ambs(amb_data(shaft, LEVELS, (3.0, 4.0), play=1e-3), parameters(shaft))
    assert plain.stiffness == pytest.approx(shaft.stiffness, rel=5e-4)
    assert plain.fit.terms[3] == pytest.approx(0.0744, rel=0.05)


def test_erratum_amb_currents_at_one_bias() -> None:
    """T 6.6.2 "analogous to that just described": the AMBs' own position stiffness comes in. Force row with the inboard
    sensor held 842 instead of 322 N/mm (seed map); by moments about the inboard AMB still half as much again."""
    shaft = Shaft(offset_i=0.0, offset_o=0.0)
    y = np.array(LEVELS)
    i = np.array([shaft.by_ambs(0.0, v, 3.0) for v in y])
    force_row = -np.polyfit(y, 73.2 * i[:, 0] + 74.4 * i[:, 1], 1)[0]
    assert force_row == pytest.approx(842e3, rel=0.05)
    moments = negative_stiffness_fit.at_one_bias(amb_data(shaft, LEVELS, (3.0, 4.0)), parameters(shaft))
    assert moments > 1.4 * shaft.stiffness


def test_the_gap_sees_a_position_gain_that_the_two_ways_cannot() -> None:
    """Both stiffnesses are wrong by the same fifth; so is the gap, and that has a drawing."""
    shaft = Shaft()
    motor, amb = motor_data(shaft, LEVELS), amb_data(shaft, LEVELS, (3.0, 4.0))
    wrong = np.array([[1.0], [1.2]])
    one = negative_stiffness_fit.by_motor(replace(motor, y=motor.y * wrong), parameters(shaft)).stiffness
    two = negative_stiffness_fit.by_ambs(replace(amb, y=amb.y * wrong), parameters(shaft))
    assert one == pytest.approx(shaft.stiffness / 1.2, rel=1e-6)
    assert two.stiffness == pytest.approx(shaft.stiffness / 1.2, rel=0.02)
    assert two.gap_m == pytest.approx(1.2 * shaft.gap, rel=0.03)
