"""The motor in place of the outboard AMB, the two ways of sharing segment currents, and steps of the angle with each."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
from sim_plants import centred, levitated, quiet

from bench.rigfile import load_rig
from sim_backend.core import LAND, LEVITATE
from sim_backend.machines.tsbs import plant as tsbs_core
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, Plant
from sim_backend.truth import draw

Array = npt.NDArray[np.float64]
COLUMN = {name: k for k, name in enumerate(CHANNELS)}
SEGMENTS = [COLUMN[f"i_m{k}"] for k in range(1, 5)]
OUTBOARD = slice(COLUMN["i_xo_p"], COLUMN["i_yo_n"] + 1)
CONTACT = 4 + 8
STEP = {
    "angle_slew": 1000.0,
    "derivative_on_error": 1.0,
    "angle_hz": 1000.0,
    "kd_theta": 0.5,
    "ki_theta": 50.0,
    "kd_m": 200.0,
}


def machine(seed: int | None) -> PlantParams:
    """The nominal machine, or one drawn from the rig file."""
    return PlantParams() if seed is None else draw(load_rig("tsbs12"), seed).plant


def carried(p: PlantParams, **settings: float) -> Plant:
    """A plant whose outboard end the motor has taken over."""
    plant = levitated(p)
    for name, value in {**settings, "motor_share": 1.0}.items():
        plant.set(name, value)
    plant.run(20000)
    assert plant.trips == 0
    return plant


def radius(rows: Array) -> float:
    """Largest distance in m of the outboard end from the sensors' zero."""
    return float(np.hypot(rows[:, COLUMN["pos_xo"]], rows[:, COLUMN["pos_yo"]]).max())


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_the_motor_carries_at_every_gamma_and_hands_over_and_back(seed: int | None) -> None:
    """From -2.5 to 3.5 deg in the steps of T 6.6.3; the protection range of the rig file is 150 um."""
    plant = levitated(machine(seed))
    plant.set("motor_share", 1.0)
    assert radius(plant.run(20000)) < 5e-5
    assert np.abs(plant.run(2000)[:, OUTBOARD]).max() < 0.03  # the AMB's currents are gone
    for gamma in np.radians(np.arange(-2.5, 3.6, 0.5)):
        plant.set("gamma", gamma)
        assert radius(plant.run(8000)) < 6e-5
        held = plant.run(2000)
        assert np.abs(held[:, :4].mean(axis=0)).max() < 5e-8
    plant.set("gamma", 0.0)
    plant.run(5000)
    plant.set("motor_share", 0.0)
    assert radius(plant.run(20000)) < 5e-5
    assert np.abs(plant.run(2000)[:, :4].mean(axis=0)).max() < 5e-8
    assert plant.trips == 0


def test_statics_while_the_motor_carries() -> None:
    """T (6.13) with F_o = 0 and T (6.8): alpha_d i_y = W l_ia / (l_ia + l_m) - alpha_x y_m; off centre, alpha_x' shows."""
    p = centred(alpha_4=0.0, alpha_6=0.0)
    plant = carried(p)
    share = -p.z_amb[0] / (p.z_motor - p.z_amb[0])
    lift = plant.run(1000)[:, SEGMENTS].mean(axis=0)
    assert (lift[0] - lift[2]) / 2 == pytest.approx(share * p.mass * p.gravity / p.alpha_d, rel=1e-5)
    plant.set("ref_ym", 4e-5)
    plant.run(20000)
    moved = plant.run(1000)[:, SEGMENTS].mean(axis=0) - lift
    height = 4e-5 * (p.z_motor - p.z_amb[0]) / (p.z_sensor[1] - p.z_amb[0])  # the inboard AMB stays where it is
    assert (moved[0] - moved[2]) / 2 == pytest.approx(-p.alpha_x * height / p.alpha_d, rel=1e-4)
    plant.set("ref_ym", 0.0)
    plant.set("gamma", math.radians(3.0))
    plant.run(20000)
    i = plant.run(1000)[:, SEGMENTS].mean(axis=0)
    ix, iy, turn = (i[3] - i[1]) / 2, (i[0] - i[2]) / 2, 8 * math.radians(3.0)
    fx = p.alpha_d * math.cos(turn) * ix - p.alpha_c * math.sin(turn) * iy
    fy = p.alpha_d * math.cos(turn) * iy + p.alpha_c * math.sin(turn) * ix
    np.testing.assert_allclose([fx, fy], [0, share * p.mass * p.gravity], atol=2e-3)


def test_open_loop_currents_are_added_and_ramped() -> None:
    plant = levitated(centred())
    plant.set("i_ramp", 0.5)
    plant.set("i_x", 1.0)
    rows = plant.run(21000)
    found = (rows[:, COLUMN["i_m4"]] - rows[:, COLUMN["i_m2"]]) / 2
    assert found[999] == pytest.approx(0.5, abs=1e-3)  # after 1 s
    assert found[-1] == pytest.approx(1.0, abs=1e-4)
    plant.set("motor_share", 1.0)
    plant.run(20000)
    after = plant.run(100).mean(axis=0)
    carried_x = (after[COLUMN["i_m4"]] - after[COLUMN["i_m2"]]) / 2
    assert carried_x == pytest.approx(0.0, abs=1e-4)  # the PID takes the open-loop current away again


def test_a_landing_gives_the_rotor_back_to_the_bearing() -> None:
    plant = carried(PlantParams())
    plant.set("share_slew", 0.1)
    plant.mode = LAND
    rows = plant.run(12000)
    flags = rows[:, COLUMN["flags"]].astype(int)
    assert not flags[:300].any()  # still free after 0.3 s
    assert np.abs(rows[150, SEGMENTS]).max() < 0.5
    assert flags[-1] & CONTACT
    assert plant.trips == 0


def test_segment_amplifier_closes_on_its_own_sensor() -> None:
    """Gain 0.98 and offset 0.05 A: a reference of 1 A reads 1 A and is (1 - 0.05)/0.98 A."""
    p = centred(segment_sense=(0.98, 1.0, 1.0, 1.0), segment_offset=(0.05, 0.0, 0.0, 0.0))
    released = ControlParams(i_y=1.0, i_ramp=5.0, kp_theta=0.0, kd_theta=0.0, ki_theta=0.0)
    plant = Plant(dataclasses.replace(p, segment_drift=(0.0, 0.1, 0.0, 0.0)), control=released)
    plant.mode = LEVITATE
    plant.run(10000)
    read, state = plant.run(10)[-1][SEGMENTS], plant.state()
    true = (state["segment"] / state["turn"]).real
    assert read[0] == pytest.approx(1.0, abs=1e-3)
    assert true[0] == pytest.approx((1 - 0.05) / 0.98, abs=1e-3)
    assert true[1] - true[3] == pytest.approx(-0.1 * plant.tick * 1e-4, abs=1e-3)  # it drifts, and the loop follows


def allocated(ix: float, iy: float, turn: float, **settings: float) -> Array:
    """Segment references (4,) in A of the law for open-loop i_x, i_y and a torque current of kp_theta * 1 rad."""
    gains = {"kp_theta": turn, "kd_theta": 0.0, "ki_theta": 1e-9, "angle_slew": 1e5, "angle_ref": 1.0}
    control, state = tsbs_core._ffi.new("tsbs_control *"), tsbs_core._ffi.new("tsbs_law_state *")
    reading, out = tsbs_core._ffi.new("tsbs_reading *"), tsbs_core._ffi.new("tsbs_reference *")
    tsbs_core.fill(control, vars(ControlParams(i_x=ix, i_y=iy, i_ramp=1e9, **gains, **settings)))
    state.mode = LEVITATE
    tsbs_core._lib.tsbs_law(control, state, reading, out)
    return np.array(list(out.segment))


def test_static_allocation_is_t_6_9_without_limits() -> None:
    np.testing.assert_allclose(allocated(1.0, 2.0, 30.0), [32.0, 29.0, 28.0, 31.0], rtol=1e-6)


def test_priority_gives_the_numbers_of_t_6_24() -> None:
    """i_x = 1, i_y = 4, I_s = 10: lambda = 6/15 = 0.4, |i_theta| <= 7.5; then T (6.19): 10, 8, 2, 10 A."""
    np.testing.assert_allclose(allocated(1.0, 4.0, 30.0, allocation=1.0), [10.0, 8.0, 2.0, 10.0], rtol=1e-9)
    within = allocated(1.0, 4.0, 2.0, allocation=1.0)
    np.testing.assert_allclose(within, [0.8 * 2 + 4, 1.2 * 2 - 1, 0.8 * 2 - 4, 1.2 * 2 + 1], rtol=1e-6)
    np.testing.assert_allclose(allocated(10.0, -10.0, 5.0, allocation=1.0), [-10.0, -10.0, 10.0, 10.0], rtol=1e-9)


def test_priority_never_exceeds_its_limit_and_keeps_the_force() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        ix, iy, turn = rng.uniform((-12.0, -12.0, 0.0), (12.0, 12.0, 40.0)).tolist()
        i = allocated(ix, iy, turn, allocation=1.0, segment_max=7.0)
        assert np.abs(i).max() <= 7.0
        assert [(i[3] - i[1]) / 2, (i[0] - i[2]) / 2] == pytest.approx(np.clip([ix, iy], -7, 7).tolist(), abs=1e-12)
        assert i.mean() == pytest.approx(
            min(turn, 7 - abs(np.clip(ix, -7, 7)) / 2 - abs(np.clip(iy, -7, 7)) / 2), abs=1e-6
        )


def step(p: PlantParams, degrees: float, allocation: float) -> tuple[float, float, Plant, Array]:
    """Largest radius in m at standstill and after a step of the angle, with the plant and its rows."""
    plant = carried(p, allocation=allocation, **STEP)
    standing = radius(plant.run(5000))
    plant.set("angle_ref", math.radians(degrees))
    rows = plant.run(10000)
    return standing, radius(rows), plant, rows


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_a_step_of_12_deg_shows_what_priority_is_worth(seed: int | None) -> None:
    """T 6.7.1, Figure 6.7: static at least 30 um beyond the standstill's peak, priority at most a third of that."""
    p = machine(seed)
    standing, static, plant, _ = step(p, 12.0, 0.0)
    assert plant.trips == 0
    assert 3e-5 < static - standing < 1e-4
    standing, priority, plant, rows = step(p, 12.0, 1.0)
    assert priority - standing < (static - standing) / 3
    assert rows[-1, COLUMN["angle"]] == pytest.approx(math.radians(12.0), abs=5e-3)


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_a_step_of_20_deg_loses_levitation_without_priority(seed: int | None) -> None:
    """Static: the rotor strikes its touchdown bearings, beyond any protection range. Priority: it does not notice."""
    p = machine(seed)
    _, static, _, rows = step(p, 20.0, 0.0)
    assert (rows[:, COLUMN["flags"]].astype(int) & CONTACT).any()
    assert static > 2e-4
    _, priority, plant, rows = step(p, 20.0, 1.0)
    assert priority < 1e-5
    assert rows[-1, COLUMN["angle"]] == pytest.approx(math.radians(20.0), abs=5e-3)
    assert plant.trips == 0


def test_a_sine_is_added_to_the_angle() -> None:
    plant = levitated(quiet(detent=0.0), control=ControlParams(angle_ref=0.1, angle_slew=5.0))
    plant.set("sine_amplitude", 0.2)
    plant.set("sine_hz", 0.5)
    rows = plant.run(40000)
    t = np.arange(1, len(rows) + 1) * 1e-3
    late = t > 2.0
    design = np.stack([np.ones(late.sum()), np.sin(math.pi * t[late]), np.cos(math.pi * t[late])], axis=1)
    mean, sine, cosine = np.linalg.lstsq(design, rows[late, COLUMN["angle"]], rcond=None)[0]
    assert mean == pytest.approx(0.1, abs=2e-3)
    assert math.hypot(sine, cosine) == pytest.approx(0.2, rel=0.03)
    assert -0.2 < math.atan2(cosine, sine) < 0.0  # it lags
    plant.set("sine_amplitude", 0.0)
    plant.run(20000)
    assert plant.run(100)[:, COLUMN["angle"]].mean() == pytest.approx(0.1, abs=2e-3)
