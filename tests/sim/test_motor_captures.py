"""What captures of tsbs12 hold: readings of single ticks, and what the motor's law makes of them, by its own equations."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import centred, levitated

from bench.rigfile import load_rig
from sim_backend.core import LAND, READY
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant

Array = npt.NDArray[np.float64]
AT = {name: k for k, name in enumerate(TRACE)}
TOLD = {name: k for k, name in enumerate(CHANNELS)}


def column(rows: Array, *names: str) -> Array:
    """Columns of a trace by name."""
    return rows[:, [AT[name] for name in names]].T if len(names) > 1 else rows[:, AT[names[0]]]


def stepped(limit_A: float, allocation: float, degrees: float = 12.0) -> Array:
    """0.4 s at full rate about a step of the angle while the motor carries."""
    plant = levitated(PlantParams())
    settings = {
        "motor_share": 1.0,
        "segment_max": limit_A,
        "allocation": allocation,
        "angle_slew": 1e3,
        "angle_hz": 1e3,
    }
    for name, value in settings.items():
        plant.set(name, value)
    plant.run(20000)
    plant.set("angle_ref", math.radians(degrees))
    return plant.run(4000, 1)[1]


def test_the_rig_file_has_every_reading_once() -> None:
    spec = load_rig("tsbs12").capture
    assert spec is not None
    assert tuple(spec.channels) == TRACE == TSBS.traced({})
    assert [c.index for c in spec.channels.values()] == list(range(len(TRACE)))


def test_telemetry_is_the_mean_of_what_a_capture_holds() -> None:
    plant = levitated(PlantParams())
    plant.set("motor_share", 1.0)
    plant.set("speed_ref", 20.0)
    rows, trace = plant.run(30000, 1)
    means = trace.reshape(-1, 10, len(TRACE)).mean(1)
    for name in (*CHANNELS[:5], "speed", *(f"i_m{k}" for k in range(1, 5))):
        assert means[:, AT[name]] == pytest.approx(rows[:, TOLD[name]], abs=1e-12), name
    last = column(trace, "angle")[9::10]  # within a turn; the row has the encoder's count
    assert last == pytest.approx(np.remainder(rows[:, TOLD["angle"]] + math.pi, 2 * math.pi) - math.pi, abs=1e-9)
    assert np.ptp(rows[:, TOLD["angle"]]) > 2 * math.pi


def test_recording_leaves_the_machine_as_it_is() -> None:
    """Not a bit moves, at any rate of the capture; its samples are those at multiples of the divider."""
    plain, full, tenth = (levitated(PlantParams()) for _ in range(3))
    rows = plain.run(3005)
    whole, every = full.run(3005, 1), tenth.run(3005, 10)
    assert np.array_equal(rows, whole[0])
    assert np.array_equal(rows, every[0])
    got = [k for k in range(len(TRACE)) if not TRACE[k].startswith("i_d")]  # across: noise of its own
    assert np.array_equal(whole[1][::10][:, got], every[1][:, got])


@pytest.mark.parametrize("limit_A", [10.0, 6.0])
def test_force_comes_first_and_torque_within_its_bound(limit_A: float) -> None:
    """T (6.19): bound = I_s - (|i_x| + |i_y|)/2, lambda of (6.24) = (I_s - |i_y|)/(2 I_s - |i_x| - |i_y|)."""
    rows = stepped(limit_A, 1.0)
    x, y, asked, given, bound, share = column(
        rows, "demand_x", "demand_y", "torque_asked", "torque_given", "torque_bound", "lambda"
    )
    assert bound == pytest.approx(limit_A - (abs(x) + abs(y)) / 2, abs=1e-12)
    assert share == pytest.approx((limit_A - abs(y)) / (2 * limit_A - abs(x) - abs(y)), abs=1e-12)
    assert given == pytest.approx(np.clip(asked, -bound, bound), abs=1e-12)
    assert (abs(asked) > bound).sum() > 50  # and it is asked for more than there is
    sizes = np.hypot(column(rows, "i_m1", "i_m2", "i_m3", "i_m4"), column(rows, "i_d1", "i_d2", "i_d3", "i_d4"))
    assert sizes.max() < limit_A + 5 * 5e-3  # noise of 5 mA
    assert sizes.max() > 0.98 * limit_A


def test_a_half_is_bound_by_the_busier_pair() -> None:
    """lambda 0.5: I_s - max(|i_x|, |i_y|)."""
    rows = stepped(10.0, 2.0)
    x, y, bound = column(rows, "demand_x", "demand_y", "torque_bound")
    assert bound == pytest.approx(10.0 - np.maximum(abs(x), abs(y)), abs=1e-12)
    assert (column(rows, "lambda") == 0.5).all()


def test_segments_follow_what_is_asked_for_two_ticks_ago() -> None:
    """Asked at tick k, told to the amplifiers after one sample, there a tick and 1/(2 pi 2 kHz) later: in a steady state
    segment 1 has 2 lambda i_theta + i_y, segment 4 has 2 (1 - lambda) i_theta + i_x."""
    rows = stepped(10.0, 1.0, 0.0)[1000:]
    x, y, given, share = column(rows, "demand_x", "demand_y", "torque_given", "lambda").mean(1)
    along = column(rows, "i_m1", "i_m2", "i_m3", "i_m4").mean(1)
    asked = [2 * share * given + y, 2 * (1 - share) * given - x, 2 * share * given - y, 2 * (1 - share) * given + x]
    assert along == pytest.approx(asked, abs=0.01)
    assert abs(y) > 3  # the weight


def test_currents_lie_across_the_field_by_the_lag() -> None:
    """At 40 rad/s the field leaves currents behind by M w (1.5 T + 1/w_c) = 8 * 40 * 0.23 ms = 0.0734 rad."""
    plant = levitated(centred(drag_share=0.0))
    plant.set("motor_share", 1.0)
    plant.set("speed_ref", 40.0)
    plant.run(60000)
    turning = plant.run(5000, 1)[1]
    plant.set("lag_compensation", 1.0)
    plant.run(5000)
    ahead = plant.run(5000, 1)[1]
    for rows, lag in ((turning, 8 * 40 * (1.5e-4 + 1 / (4000 * math.pi))), (ahead, 0.0)):
        one = column(rows, "i_m1").mean() + 1j * column(rows, "i_d1").mean()
        assert np.angle(one) == pytest.approx(-lag, abs=0.012)


def test_gamma_is_told_on_its_way_and_loads_while_the_motor_carries() -> None:
    """25 deg/s. The load is -48.55 N by statics: weight's share at the motor with the inboard plane held, T (6.25)."""
    plant = levitated(centred())
    before = plant.run(100, 1)[1]
    assert not column(before, "load_x", "load_y").any()
    plant.set("motor_share", 1.0)
    plant.run(20000)
    standing = plant.run(2000, 1)[1]
    assert column(standing, "load_y").mean() == pytest.approx(-48.55, abs=0.05)
    assert abs(column(standing, "load_x").mean()) < 0.05
    plant.set("gamma_slew", math.radians(25.0))
    plant.set("gamma", math.radians(2.0))
    rows = plant.run(1000, 1)[1]
    ramp = np.minimum(np.radians(25.0) * 1e-4 * np.arange(1, 1001), math.radians(2.0))
    assert column(rows, "gamma") == pytest.approx(ramp, abs=1e-9)


def test_a_rotor_that_rests_is_asked_for_nothing() -> None:
    plant = Plant(PlantParams())
    plant.mode = 1
    rows = plant.run(100, 1)[1]
    assert not column(rows, "demand_x", "demand_y", "torque_asked", "torque_given", "torque_bound", "lambda").any()
    assert column(rows, "pos_yo").mean() == pytest.approx(-250e-6, abs=2e-6)


def test_what_was_asked_for_before_a_landing_is_not_told_after_it() -> None:
    """Handed back, the motor has no load; at rest, nothing is asked for. The law's last numbers stay in its memory."""
    plant = levitated(centred())
    plant.set("motor_share", 1.0)
    plant.run(20000)
    assert column(plant.run(10, 1)[1], "load_y").max() < -40
    plant.set("motor_share", 0.0)
    plant.run(20000)
    assert not column(plant.run(100, 1)[1], "load_x", "load_y").any()
    plant.mode = LAND
    plant.run(12000)
    plant.mode = READY
    assert not column(plant.run(100, 1)[1], "torque_bound", "lambda", "demand_y").any()
