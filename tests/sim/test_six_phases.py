"""The motor as six phases in two segments (T chapter 7): its law by hand, its drive, and what it does with the shaft."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import centred, levitated

from bench.rigfile import load_rig
from sim_backend.core import LEVITATE
from sim_backend.machines.tsbs import plant as tsbs_core
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant, derivative
from sim_backend.machines.tsbs.six import DEFECTS, PAIRS, TOLD, TRACED
from sim_backend.truth import draw, nominal

Array = npt.NDArray[np.float64]
COLUMN = {name: k for k, name in enumerate(CHANNELS)}
AT = {name: k for k, name in enumerate(TRACE)}
WORDS = [COLUMN[f"i_m{k}"] for k in range(1, 5)]
ALPHA_T, ALPHA_N = math.sqrt(2) * 12.1, math.sqrt(2) * 14.3
STEP = {"angle_slew": 1000.0, "derivative_on_error": 1.0, "angle_hz": 1000.0, "kd_theta": 0.5, "ki_theta": 50.0}


def law(ix: float, iy: float, turn: float, **settings: float) -> tuple[Array, list[float]]:
    """Segment currents (4,) along + j across and what the law tells of them, with open-loop i_x, i_y in the law's own frame."""
    gains: dict[str, Any] = {"kp_theta": turn, "kd_theta": 0.0, "ki_theta": 1e-9, "angle_slew": 1e5, "angle_ref": 1.0}
    control, state = tsbs_core._ffi.new("tsbs_control *"), tsbs_core._ffi.new("tsbs_law_state *")
    reading, out = tsbs_core._ffi.new("tsbs_reading *"), tsbs_core._ffi.new("tsbs_reference *")
    asked: dict[str, Any] = {"i_x": ix, "i_y": iy, "i_ramp": 1e9, "phases": 6.0, "allocation": 1.0}
    tsbs_core.fill(control, vars(ControlParams(**{**asked, **gains, **settings})))
    state.mode = LEVITATE
    tsbs_core._lib.tsbs_law(control, state, reading, out)
    return np.array(list(out.segment)) + 1j * np.array(list(out.across)), list(state.told)


def test_sharing_by_hand() -> None:
    """(7.12) i_q1 = i_t + i_y, i_q2 = i_t - i_y, i_d1 = -i_x, i_d2 = i_x; i_x 6, i_y 4, I_s 10: bound sqrt(64) - 4 = 4 A."""
    found, told = law(6.0, 4.0, 30.0)
    np.testing.assert_allclose(found, [8 - 6j, 8 - 6j, 6j, 6j], atol=1e-9)
    assert told == pytest.approx([6.0, 4.0, 30.0, 4.0, 4.0, 0.5], rel=1e-6)
    free, _ = law(6.0, 4.0, 30.0, allocation=0.0)  # what exceeds is the amplifiers' to cut
    np.testing.assert_allclose(free, [34 - 6j, 34 - 6j, 26 + 6j, 26 + 6j], atol=1e-6)


def test_printed_bound_grants_torque_that_is_not_there() -> None:
    """T (7.18) at i_x 6, i_y 9, I_s 10: as printed abs(9 - 8) = 1 A; force alone is 10.8 A, beyond the amplifiers."""
    assert law(6.0, 9.0, 5.0)[1][4] == pytest.approx(0.0, abs=1e-12)
    assert law(6.0, 9.0, 5.0, literal_7_18=1.0)[1][4] == pytest.approx(1.0)


def test_printed_shares_push_the_other_way() -> None:
    """T (7.13c,d) as printed: i_q1 = i_t - i_y. By the forces of four segments 1 A of i_y then gives -17.1 N along y6."""
    for literal, sign in ((0.0, 1.0), (1.0, -1.0)):
        found, _ = law(0.0, 1.0, 0.0, literal_7_13=literal)
        across, along = pushed(found)
        assert along == pytest.approx(sign * ALPHA_T, rel=1e-9)
        assert across == pytest.approx(0.0, abs=1e-9)


def pushed(segments: Array) -> tuple[float, float]:
    """Force in N of segment currents (4,) across and along the motor's own frame, by the plant's mechanics at rest."""
    still = {"alpha_6": 0.0, "beta_2": 0.0, "alpha_4": 0.0, "detent": 0.0, "gravity": 0.0, "target": (0.0,) * 8}
    p, s = centred(**still), np.zeros(14)
    base = derivative(p, s, np.zeros(10), np.zeros(4))
    fx, fy = (derivative(p, s, np.zeros(10), segments) - base)[6:8] * p.mass
    return (fx + fy) / math.sqrt(2), (fy - fx) / math.sqrt(2)


def test_an_ampere_pushes_along_axes_turned_by_45_degrees() -> None:
    """alpha_t = sqrt 2 alpha_d = 17.11 N/A along, alpha_n = sqrt 2 alpha_c = 20.22 N/A across; torque alpha_tau a mean q."""
    assert pushed(law(0.0, 1.0, 0.0)[0]) == pytest.approx((0.0, 17.11), abs=0.01)
    assert pushed(law(1.0, 0.0, 0.0)[0]) == pytest.approx((20.22, 0.0), abs=0.01)
    p = centred()
    turned = derivative(p, np.zeros(14), np.zeros(10), law(0.0, 0.0, 1.0)[0])[11]
    assert turned - derivative(p, np.zeros(14), np.zeros(10), np.zeros(4))[11] == pytest.approx(2.87 / 0.033, rel=1e-6)


def carried(p: PlantParams, **settings: float) -> Plant:
    """The motor carries, with the gains of a step."""
    plant = levitated(p)
    for name, value in (STEP | {"allocation": 1.0, "motor_share": 1.0} | settings).items():
        plant.set(name, value)
    plant.run(20000)
    return plant


def test_gravity_loads_both_axes() -> None:
    """48.5 N at the motor are 34.3 N along each axis: i_x = 34.3/20.22 = 1.70 A, i_y = 34.3/17.11 = 2.01 A."""
    q1, d1, q2, d2 = carried(centred(phases=6.0)).run(2000)[:, WORDS].mean(axis=0)
    assert (d2 - d1) / 2 == pytest.approx(1.70, abs=0.01)
    assert (q1 - q2) / 2 == pytest.approx(2.01, abs=0.01)
    assert abs(q1 + q2) / 2 < 0.02


@pytest.mark.parametrize(
    ("allocation", "degrees", "low", "high"),
    [(1.0, 15, 0.5, 2.0), (1.0, 90, 1, 5), (0.0, 10, 14, 22), (0.0, 15, 50, 110)],
)
def test_a_step_leaves_no_trace_where_force_comes_first(
    allocation: float, degrees: float, low: float, high: float
) -> None:
    """Peaks in um beside a prototype's 0.8, 2.0, 14, 79 above its standstill."""
    plant = carried(centred(phases=6.0), allocation=allocation)
    plant.set("angle_ref", math.radians(degrees))
    rows = plant.run(6000)
    assert plant.trips == 0
    assert rows[-1, COLUMN["angle"]] == pytest.approx(math.radians(degrees), abs=6e-3)
    assert low < 1e6 * np.hypot(rows[:, COLUMN["pos_xo"]], rows[:, COLUMN["pos_yo"]]).max() < high


def test_no_segment_carries_more_than_its_limit_and_torque_stays_within_its_bound() -> None:
    plant = carried(centred(phases=6.0))
    plant.set("angle_ref", math.radians(15.0))
    rows, trace = plant.run(4000, 1)
    words = trace[:, [AT[f"i_m{k}"] for k in range(1, 5)]]
    amplitude = np.hypot(words[:, ::2], words[:, 1::2])
    assert 9.9 < amplitude.max() < 10 + 5 * 5e-3  # noise of 5 mA
    x, y, given = (trace[:, AT[name]] for name in ("demand_x", "demand_y", "torque_given"))
    bound = np.sqrt(100 - x**2) - np.abs(y)
    assert (np.abs(given) - bound).max() < 1e-12
    assert (np.abs(given) > bound - 1e-9).sum() > 50
    assert not (rows[:, COLUMN["flags"]].astype(int) & 2).any()


@pytest.mark.parametrize(("literal", "value"), [("literal_7_6b", 1.0), ("literal_7_13", 1.0), ("literal_7_14", 2.0)])
def test_a_printed_sign_loses_the_shaft(literal: str, value: float) -> None:
    """Of (7.14) here the minus of force alone: that of torque turns the rotor away before."""
    plant = levitated(centred(phases=6.0, **{literal: value}))
    plant.set("allocation", 1.0)
    plant.set("motor_share", 1.0)
    plant.run(10000)
    assert plant.trips != 0


def test_two_printed_signs_cancel() -> None:
    """(7.6b) with (7.13): the shaft is held, and only the direction of a push shows it."""
    plant = carried(centred(phases=6.0, literal_7_6b=1.0, literal_7_13=1.0))
    rows = plant.run(5000)
    assert plant.trips == 0
    assert np.hypot(rows[:, COLUMN["pos_xo"]], rows[:, COLUMN["pos_yo"]]).max() < 5e-6


def test_the_truth_of_a_rig_is_six_phases() -> None:
    rig = load_rig("tsbs6")
    drawn = draw(rig, 1)
    assert drawn.machine.channels == TOLD
    assert drawn.plant.phases == 6.0
    assert set(PAIRS) <= set(rig.channels)
    assert rig.capture is not None
    assert set(rig.capture.channels) <= set(TRACED)
    assert len({*drawn.plant.segment_gain}) == 4  # segments of a pair differ
    plain = draw(rig, 1, nominal(rig))
    assert plain.quantities["alpha_t"] == pytest.approx(17.11, abs=0.01)
    assert plain.quantities["alpha_n"] == pytest.approx(20.22, abs=0.01)
    assert {"literal_7_6b", "literal_7_13", "literal_7_14", "literal_7_18"} <= set(DEFECTS)


def test_an_amplifier_s_sensors_err_in_both_parts() -> None:
    """Offsets of q and d: the pair's true current is the demand less the offset, over the gain."""
    p = centred(phases=6.0, segment_sense=(1.01, 0.98, 1.0, 1.0), segment_offset=(0.02, -0.03, 0.0, 0.0))
    plant = levitated(p)
    plant.set("i_y", 1.0)
    plant.set("i_x", 0.5)
    plant.run(20000)
    trace = plant.run(2000, 1)[1].mean(axis=0)
    assert trace[[AT["i_m1"], AT["i_m2"]]] == pytest.approx([1.0, -0.5], abs=0.02)
    state = plant.state()
    true = state["segment"][0] / state["turn"]
    assert (true.real, true.imag) == pytest.approx(((1.0 - 0.02) / 1.01, (-0.5 + 0.03) / 0.98), abs=0.02)
    assert state["segment"][1] == state["segment"][0]
