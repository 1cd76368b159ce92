"""The bare model of encoder zeros: from answers of currents to angles, and what gains of current sensors do to them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from bench.errors import AnalysisError
from bench.rigfile import load_rig
from procedures.encoder_zero.fit import field, turned
from procedures.encoder_zero.groups import Group, groups, settings_of, settle_s, slowest_s, target
from procedures.encoder_zero.plan import Plan

Array = npt.NDArray[np.float64]


def answers(constants: Array, angles: Array) -> Array:
    """Rows (2 n - 1, 2 n) of unit steps along each motor and across all but the last one, by the forces' balance: the common
    reference answers to everything."""
    n = len(constants)
    s, c = constants * np.sin(angles), constants * np.cos(angles)
    out = []
    for k in range(n):
        row = np.zeros((n, 2))
        row[k, 0] = 1.0
        row[:, 1] = -s[k] / c.sum()
        out.append(row.ravel())
    for k in range(n - 1):
        row = np.zeros((n, 2))
        row[:, 1] = -c[k] / c.sum()
        row[k, 1] += 1.0
        out.append(row.ravel())
    return np.array(out)


@pytest.mark.parametrize("degrees", [-10.0, -0.3, 0.0, 5.0])
def test_one_motor(degrees: float) -> None:
    """tan d = -di_q/di_d, by hand: 10 deg makes 176.3 mA of 1 A."""
    found = field(np.array([[1.0, -math.tan(math.radians(degrees))]]))
    assert math.degrees(found.angle[0]) == pytest.approx(degrees, abs=1e-12)


@pytest.mark.parametrize(
    ("constants", "degrees"),
    [
        ((0.21, 0.21), (3.0, 3.0)),
        ((0.2163, 0.2037), (-10.0, 10.0)),
        ((0.2, 0.21), (0.0, 4.0)),
        ((1.0, 2.0, 3.0), (5.0, -7.0, 1.0)),
    ],
)
def test_several_motors(constants: tuple[float, ...], degrees: tuple[float, ...]) -> None:
    found = field(answers(np.array(constants), np.radians(degrees)))
    assert np.degrees(found.angle) == pytest.approx(degrees, abs=1e-9)
    assert found.constant / found.constant[-1] == pytest.approx(np.array(constants) / constants[-1])


def test_the_formula_of_two_motors() -> None:
    """K_1 i_d sin d_1 = -di_q (K_1 cos d_1 + K_2 cos d_2), by hand: d 3 and -2 deg, K 0.22 and 0.20 N m/A. K sin d is
    0.011514 and -0.006980, the sum of K cos d 0.219698 + 0.199878 = 0.419577; their
    ratios -0.027442 and 0.016636; across 0.523619."""
    rows = [[1, -0.0274417, 0, -0.0274417], [0, 0.0166356, 1, 0.0166356], [0, 0.4763806, 0, -0.5236194]]
    found = field(np.array(rows, dtype=float))
    assert np.degrees(found.angle) == pytest.approx([3.0, -2.0], abs=2e-5)
    assert found.constant[0] / found.constant[1] == pytest.approx(1.1, abs=1e-6)


def test_a_motor_that_works_against_the_other() -> None:
    found = field(answers(np.array([0.15, 0.21]), np.array([math.pi, 0.0])))
    assert abs(found.angle[0]) == pytest.approx(math.pi)
    assert found.angle[1] == pytest.approx(0.0, abs=1e-12)


def test_alike_answers_tell_nothing() -> None:
    row = np.array([1.0, -0.1, 0.0, -0.1])
    with pytest.raises(AnalysisError, match="too much alike"):
        field(np.array([row, row, 1.001 * row]))


def split(currents: Array, phase: float) -> Array:
    """(d, q) of coils whose k-th is at k 120 deg."""
    at = phase + 2 * np.pi / 3 * np.arange(len(currents))
    return 2 / len(currents) * np.array([currents @ np.cos(at), -(currents @ np.sin(at))])


def join(dq: Array, phase: float, coils: int) -> Array:
    at = phase + 2 * np.pi / 3 * np.arange(coils)
    return np.asarray(dq[0] * np.cos(at) - dq[1] * np.sin(at))


@pytest.mark.parametrize("coils", [3, 6])
@pytest.mark.parametrize("angle", [-0.17, 0.05])
def test_gains_of_current_sensors(coils: int, angle: float) -> None:
    """Coil currents read with gains, regulated by what is read: the slopes turn what is found back to first order, and what a
    quarter of a turn on shows is turned the other way."""
    errors = np.random.default_rng(1).uniform(-1e-4, 1e-4, coils)
    found = {}
    for phase in (0.4, 0.4 + np.pi / 2):
        read = np.array(
            [split((1 + errors) * join(np.eye(2)[k], phase, coils), phase) for k in (0, 1)]
        ).T  # read of true
        true = np.array([math.cos(angle), -math.sin(angle)])  # no force: sin d i_d + cos d i_q = 0
        along = read @ true
        found[phase] = float(field(along.reshape(1, 2) / along[0]).angle[0])
        slopes = turned(found[phase], phase, coils)[0]
        assert abs(found[phase] - angle) > 3e-6
        assert found[phase] + slopes @ errors == pytest.approx(angle, abs=3e-8)
    assert np.mean(list(found.values())) == pytest.approx(angle, abs=3e-8)


def test_constants_by_gains() -> None:
    """All coils that read 1 % too much make a constant that is found 1 % too small: to be added to its logarithm."""
    assert turned(0.1, 0.3, 6)[1].sum() == pytest.approx(1.0)
    assert turned(0.1, 0.3, 6)[0].sum() == pytest.approx(0.0, abs=1e-15)


def test_how_long_is_waited() -> None:
    """By the gains of the rig file: 1.45e-3 s^3 + 0.8 s^2 + k s + 99 has its slowest root at -6.75, -4.64 and -3.65 1/s
    for k of 20, 25 and 30 N m/rad, where k_P/k_I alone says 0.253 s; along it is a pair at -52.9 1/s for 100 N/mm."""
    rig = load_rig("lira")
    assert slowest_s(rig, "gamma") == pytest.approx(1 / 3.65361, rel=1e-4)
    assert slowest_s(rig, "z") == pytest.approx(1 / 52.9329, rel=1e-4)
    slow = rig.model_copy(
        update={"parameters": {**rig.parameters, "ki.r": rig.parameters["ki.r"].model_copy(update={"default": 9.9})}}
    )
    assert slowest_s(slow, "gamma") > 9 * slowest_s(rig, "gamma")
    of = {g.loop: g for g in groups(rig)}
    assert settle_s(rig, Plan(), of["gamma"]) == pytest.approx(8 * slowest_s(rig, "gamma"))


def test_what_is_stepped() -> None:
    rig = load_rig("lira")
    of = {g.loop: g for g in groups(rig, Plan(motors=("RA1",)))}
    assert of == {"gamma": Group("gamma", ("RA1", "RA2"))}  # both, or neither is known
    assert of["gamma"].stepped == (("RA1", "along"), ("RA2", "along"), ("RA1", "across"))
    (axial,) = (g for g in groups(rig) if g.loop == "z")
    assert axial.stepped == (("LA", "along"),)
    assert [s.sign for s in settings_of(axial, 0, "", 3)] == [1, -1, -1, 1, 1, -1]
    assert target(rig, axial, 1) - target(rig, axial, 0) == pytest.approx(12.5e-3 / 4)
