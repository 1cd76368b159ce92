"""The rotary-linear motor's plant: signs by hand, its slow reference, energy, order of a step, friction, encoders, defects."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rlsrm_bench import COLUMN, column

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm import reference
from sim_backend.machines.rlsrm.params import DEG, PHASES, ControlParams, Map, PlantParams
from sim_backend.machines.rlsrm.plant import TICKS_S, Plant, ideal, rubbed, slopes

H = 1 / TICKS_S
UNLIKE = Map(gain=(1.02, 0.99, 1.01, 0.98, 1.03, 1.0), zero=(0.004, -0.006), centre=2e-4, uneven=0.02, uneven_phase=0.7)
"""No two numbers of it are alike: a formula that takes the wrong one shows."""
SMOOTH = replace(ideal(), coulomb=0.0, copper=0.0)


def driven(params: PlantParams, amperes: dict[str, float], at: tuple[float, float] = (0.0, 0.0)) -> Plant:
    """Amplifiers on, currents in some phases, no loop closed."""
    plant = Plant(params)
    plant.put(*at)
    plant.drive(np.array([amperes.get(name, 0.0) for name in PHASES]))
    plant.switch(on=True)
    return plant


def test_which_phase_pulls_which_way() -> None:
    """By hand. Stator 0 draws towards -x, stator 1 towards +x. A is aligned at 0, C at 30, B at 60 degrees. At 20 degrees A
    pulls back and C, 10 degrees short, on; B, 40 degrees short, on with less. At 75 degrees A (at 90) pulls on, B back, and C
    is between two teeth."""
    _, along, around = slopes(Map(), 0.0, 20 * DEG)
    assert (along[:3] < 0).all()
    assert (along[3:] > 0).all()
    assert np.sign(around).tolist() == [-1, 1, 1] * 2
    assert around[1] < 0.6 * around[2]
    _, _, around = slopes(Map(), 0.0, 75 * DEG)
    assert np.sign(around[:2]).tolist() == [1, -1]
    assert abs(around[2]) < 1e-12
    _, _, around = slopes(Map(), 0.0, 0.0)
    assert abs(around[0]) < 1e-12  # aligned
    assert around[1] < 0 < around[2]  # B was passed 30 degrees ago (at -30), C comes in 30


def test_zeros_and_the_centre_shift_the_map() -> None:
    shifted = Map(zero=(0.01, -0.02), centre=1e-3)
    _, _, around = slopes(shifted, 0.0, 0.0)
    assert around[0] > 0 > around[3]  # A1 is aligned at +0.01, A2 at -0.02
    assert slopes(shifted, 1e-3, 0.3)[1][:3].sum() != 0
    g, along, _ = slopes(Map(centre=1e-3), 1e-3, 0.3)
    assert g[:3] == pytest.approx(g[3:])
    assert along[:3] == pytest.approx(-along[3:])


def test_force_and_torque_at_2_A_by_hand() -> None:
    """G' aligned is 0.79 H/m times 14/sqrt(14^2 + 1.5^2) = 0.7855, q(2 A) = 8.5^2 (sqrt(1 + (2/8.5)^2) - 1) = 1.9729 A^2."""
    locked = replace(ideal(), locked=(1.0, 1.0))
    plant = driven(locked, {"A2": 2.0})
    plant.run(0.1, 0)
    assert plant.acting == pytest.approx([1.5497, 0.0], abs=2e-4)
    plant = driven(locked, {"C1": 2.0}, (0.0, 20 * DEG))
    plant.run(0.1, 0)
    assert plant.acting[1] == pytest.approx(1.9729 * slopes(Map(), 0.0, 20 * DEG)[2][2], rel=1e-4)
    assert plant.acting[0] < 0


def test_the_linear_formula_is_wrong_by_11_percent_at_6_A() -> None:
    """R (9) takes i^2/2: 18 A^2 against 16.19."""
    plant = driven(replace(ideal(), locked=(1.0, 1.0)), {"A2": 6.0})
    plant.run(0.1, 0)
    linear = 18 * slopes(Map(), 0.0, 0.0)[1][3]
    assert linear / plant.acting[0] == pytest.approx(1.112, abs=0.001)


def test_slopes_are_those_of_the_references_coenergy() -> None:
    rng, i = np.random.default_rng(1), 5.0
    q = Map().saturation ** 2 * (math.sqrt(1 + (i / Map().saturation) ** 2) - 1)
    for _ in range(12):
        x, angle = rng.uniform(-0.014, 0.014), rng.uniform(-4, 4)
        _, along, around = slopes(UNLIKE, x, angle)
        for k in range(6):
            force, torque = reference.pulls(UNLIKE, k, x, angle, i)
            assert force == pytest.approx(along[k] * q, abs=1e-7)
            assert torque == pytest.approx(around[k] * q, abs=1e-8)


def test_a_move_is_that_of_the_reference() -> None:
    params = replace(SMOOTH, map=UNLIKE, resistance=(7.6, 7.7, 7.8, 7.9, 8.0, 8.1))
    plant = driven(params, {"C1": 4.0, "B2": 5.5}, (3e-3, 0.2))
    plant.put(x_rate=0.1, angle_rate=8.0)
    state = np.concatenate([plant.place, np.zeros(6)])
    for _ in range(60):  # 3 ms: rise, saturation, emf
        plant.run(H, 0)
        state = reference.advanced(params, state, plant.voltages, H, 1)
    i = [reference.current_of(params.map, k, state[0], state[1], state[4 + k]) for k in range(6)]
    assert plant.currents == pytest.approx(i, abs=2e-4)
    assert plant.place[:2] == pytest.approx(state[:2], abs=2e-7)  # 27 mrad, 0.3 mm on its way
    assert plant.place[2:] == pytest.approx(state[2:4], rel=3e-5)
    assert plant.currents.max() > 5


def test_energy_closes_over_a_move_that_saturates() -> None:
    """What the amplifiers give is heat, field and motion: at once to 200 degrees and 10 mm, currents at their limit."""
    params = replace(SMOOTH, viscous=(0.0, 0.0))
    plant = Plant(params, ControlParams(offset=(0.01, 200 * DEG)))
    plant.switch(on=True, x=True, angle=True)
    rows = plant.run(0.25 + H, 1)
    i, u = rows[:, COLUMN["i_A1"] :][:, :6], rows[:, COLUMN["u_A1"] :][:, :6]
    mean = 0.5 * (i[1:] + i[:-1])
    given, heat = H * (u[1:] * mean).sum(), H * (7.8 * mean * mean).sum()
    end = rows[-1]
    field = reference.stored(params.map, end[COLUMN["true_x"]], end[COLUMN["true_angle"]], i[-1])
    v = column(rows, "rate_x", "rate_angle")[-1]
    motion = 0.5 * (params.mass * v[0] ** 2 + params.inertia * v[1] ** 2)
    assert (column(rows, "flags").astype(int) & 1).mean() > 0.1
    assert i.max() > 5.9
    assert motion > 0.01
    assert field > 0.1
    assert abs(given - heat - field - motion) < 3e-5 * given
    back = H * ((u[1:] - 7.8 * mean) * mean).sum()  # without the heat, which is nearly all: 0.2 %
    assert abs(back - field - motion) < 3e-3 * abs(np.diff(_kinetic(rows, params))).sum()


def _kinetic(rows: Array, params: PlantParams) -> Array:
    v = column(rows, "rate_x", "rate_angle")
    return 0.5 * (params.mass * v[:, 0] ** 2 + params.inertia * v[:, 1] ** 2)


def test_the_step_is_of_second_order() -> None:
    def end(substeps: int) -> Array:
        plant = driven(replace(SMOOTH, substeps=float(substeps)), {"C1": 4.0, "B2": 5.5}, (3e-3, 0.2))
        plant.run(0.05, 0)
        return plant.place[:2]

    best = end(64)
    off = np.array([abs(end(n) - best) for n in (1, 2, 4)])
    order = np.log2(off[:-1] / off[1:])
    assert order == pytest.approx(np.full((2, 2), 2.0), abs=0.1)
    assert off[0] == pytest.approx([0, 0], abs=3e-6)


def test_friction_is_the_least_of_a_convex_function() -> None:
    params, rng = replace(PlantParams(), viscous=(0.0, 0.0)), np.random.default_rng(3)
    stuck = 0
    for _ in range(20):
        v, f = rng.normal(0, 1, 2) * [1e-3, 0.1], rng.normal(0, 1, 2) * [3, 0.05]
        ours = rubbed(params, v, f, 1e-3)
        stuck += bool((ours == 0).all())
        assert ours == pytest.approx(reference.rubbed(params, v, f, 1e-3), abs=2e-6)
    assert rubbed(params, np.zeros(2), np.array([1.4, 0.003]), 1e-3).tolist() == [0, 0]
    assert stuck < 20


def test_friction_along_the_path_leaves_little_of_it_along_x() -> None:
    """5 mm/s along while 5 rad/s around at 8 mm: 5/sqrt(5^2 + 40^2) = 0.124 of the 1.5 N, and 0.992 of the 12 N mm."""
    params, h = replace(PlantParams(), viscous=(0.0, 0.0)), 1e-7
    drag = (np.array([5e-3, 5.0]) - rubbed(params, np.array([5e-3, 5.0]), np.zeros(2), h)) / h
    assert drag * [3.35, 1.5e-3] == pytest.approx([0.1240 * 1.5, 0.9923 * 0.012], rel=1e-3)
    apart = replace(params, along_path=0.0)
    drag = (np.array([5e-3, 5.0]) - rubbed(apart, np.array([5e-3, 5.0]), np.zeros(2), h)) / h
    assert drag * [3.35, 1.5e-3] == pytest.approx([1.5, 0.012], rel=1e-6)


def test_below_friction_nothing_moves() -> None:
    plant = Plant()
    plant.push(1.4)
    plant.run(10, 0)
    assert plant.place.tolist() == [0, 0, 0, 0]
    plant.put(x_rate=1e-4)  # set going, it comes to rest and does not creep
    plant.run(0.1, 0)
    there = plant.place[0]
    assert plant.place[2] == 0
    plant.run(10, 0)
    assert plant.place[0] == there
    plant.push(1.6)
    plant.run(0.1, 0)
    assert plant.place[2] == pytest.approx(0.1 / 4 * (1 - math.exp(-4 * 0.1 / 3.35)), rel=1e-3)


def test_what_turns_is_pushed_along_by_less_than_the_friction() -> None:
    plant = Plant()
    plant.push(0.5)
    plant.put(angle_rate=10.0)
    plant.run(0.2, 0)
    assert plant.place[0] > 1e-4


def test_friction_can_differ_both_ways() -> None:
    params, h = replace(PlantParams(), viscous=(0.0, 0.0), coulomb_sides=0.2), 1e-6
    for way, share in ((1, 1.2), (-1, 0.8)):
        drag = (way * 0.1 - rubbed(params, np.array([way * 0.1, 0.0]), np.zeros(2), h)[0]) / h * 3.35
        assert drag == pytest.approx(way * share * 1.5, rel=1e-6)


def test_friction_that_differs_goes_by_the_path_and_not_by_momentum() -> None:
    """5 mm/s along and 5 mm/s of the surface around: 1.5 N (1 + 0.2/sqrt 2) on a path at 45 degrees, 1.2107 N and at 8 mm 9.686
    mN m, however long the kick. A shaft at rest goes where it is pushed, at 1.5 N (1 + 0.2 cos) there."""
    params, v = replace(PlantParams(), viscous=(0.0, 0.0), coulomb_sides=0.2), np.array([5e-3, 5 / 8])
    for h in (1e-7, 1e-5):
        drag = (v - rubbed(params, v, np.zeros(2), h)) / h * [3.35, 1.5e-3]
        assert drag == pytest.approx([1.2107, 9.686e-3], rel=2e-3)
    for turn in (0.3, 1.2, 2.5):
        least = 1.5 * (1 + 0.2 * math.cos(turn))
        push = np.array([math.cos(turn), 8e-3 * math.sin(turn)])
        assert not rubbed(params, np.zeros(2), 0.999 * least * push, 2.5e-5).any()
        assert rubbed(params, np.zeros(2), 1.001 * least * push, 2.5e-5).all()


def test_bumpers_push_and_never_pull() -> None:
    """From 0.3 m/s it comes back slower and is free again; what it loses there is the damper's."""
    plant = Plant(replace(SMOOTH, viscous=(0.0, 0.0)))
    plant.put(x=14.9e-3, x_rate=0.3)
    rows = plant.run(0.05, 1)
    x, v = column(rows, "true_x", "rate_x").T
    assert 15.5e-3 < x.max() < 16.3e-3  # 0.3 m/s and 244 rad/s: 1.2 mm, less the damper
    assert -0.3 < v[-1] < -0.1
    assert (np.diff(v) <= 1e-15).all()


def test_tilt_and_outer_forces_point_along_the_axes() -> None:
    plant = Plant(replace(SMOOTH, tilt=1e-3, viscous=(0.0, 0.0)))
    plant.push(0.0, -0.01)
    plant.run(0.1, 0)
    assert plant.place[2] == pytest.approx(9.81e-3 * 0.1, rel=1e-9)
    assert plant.place[3] == pytest.approx(-0.01 / 1.5e-3 * 0.1, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "x", "angle", "counts"),
    [
        ({}, 1.2344e-3, 1.0, (1234, 398)),  # 57.2958/0.144 = 397.887
        ({}, -1.2344e-3, -1.0, (-1234, -398)),
        ({"truncate": (1.0, 1.0)}, 1.2344e-3, 1.0, (1234, 397)),
        ({"truncate": (1.0, 1.0)}, -1.2344e-3, -1.0, (-1235, -398)),
        ({"edge": (0.3, -0.4)}, 1.2344e-3, 1.0, (1235, 397)),
        ({"scale": 1e-3}, 10e-3, 0.0, (10010, 0)),
        ({"once": 1.0 * DEG}, 0.0, math.pi / 2, (0, 632)),  # 91/0.144
        ({"once": 1.0 * DEG, "once_phase": math.pi / 2}, 0.0, math.pi / 2, (0, 625)),
        ({"pitch": (1e-6, 0.036 * DEG)}, 0.0, 1.0, (0, 1592)),  # four times the counts: planted
    ],
)
def test_encoders_count(change: dict[str, object], x: float, angle: float, counts: tuple[int, int]) -> None:
    plant = Plant(replace(PlantParams(), **change))  # type: ignore[arg-type]
    plant.put(x, angle)
    row = plant.run(H, 1)[0]
    assert plant.counts == counts
    assert column(row[None], "x", "angle") == pytest.approx([counts[0] * 1e-6, counts[1] * 0.144 * DEG])


def test_a_winding_warms_and_its_resistance_with_it() -> None:
    """C dT/dt = i^2 R_20 (1 + a T) - T/R_th above 20 degrees, in closed form for a constant current."""
    plant = driven(replace(PlantParams(), locked=(1.0, 1.0)), {"B1": 2.0})
    plant.run(20, 0)
    heat, loss = 4 * 7.8, 1 / 1.5 - 4 * 7.8 * 0.00393
    assert plant.warmth[1] == pytest.approx(20 + heat / loss * (1 - math.exp(-20 * loss / 60)), rel=1e-3)
    assert plant.warmth[0] == 20
    hot = 7.8 * (1 + 0.00393 * (plant.warmth[1] - 20))
    assert plant.voltages[1] / plant.currents[1] == pytest.approx(hot, rel=1e-3)
    assert plant.means[1] == pytest.approx(2, rel=1e-6)


def test_a_current_rises_as_fast_as_the_voltage_lets_it() -> None:
    """0 to 6 A aligned: the flux at 6 A and what the resistance takes on the way, over 90 V: 0.96 ms; with half of
    it, 3 A take more than twice as long, and 6 A in 7.8 ohm never come."""
    locked = replace(SMOOTH, locked=(1.0, 1.0))
    plant = driven(locked, {"A1": 6.0})
    i = column(plant.run(3e-3, 1), "i_A1")
    late = 2 * H  # from the reading to the reference
    assert (i > 5.7).argmax() * H - late == pytest.approx(0.92e-3, abs=0.06e-3)
    weak = driven(replace(locked, share=(0.5, *[1.0] * 5)), {"A1": 6.0})
    rows = weak.run(3e-3, 1)
    assert column(rows, "u_A1").max() == 45
    assert (column(rows, "i_A1") > 3).argmax() - 2 > 2 * ((i > 3).argmax() - 2)
    assert weak.run(0.1, 1)[-1, COLUMN["i_A1"]] == pytest.approx(45 / 7.8, rel=1e-3)


def test_a_current_ends_at_zero_and_not_beyond() -> None:
    plant = driven(replace(ideal(), locked=(1.0, 1.0)), {"C2": 6.0}, (-14e-3, 0.0))  # little iron: the gain overshoots
    plant.run(0.01, 0)
    plant.drive(np.zeros(6))
    rows = plant.run(0.01, 1)
    assert column(rows, "i_C2").min() == 0
    assert column(rows, "i_C2")[-1] == 0
    assert column(rows, "u_C2")[-1] == 0


def test_defects_of_amplifiers_are_where_they_are_planted() -> None:
    locked = replace(ideal(), locked=(1.0, 1.0))
    crossed = driven(replace(locked, wired=(0.0, 2.0, 1.0, 3.0, 4.0, 5.0)), {"B1": 3.0})
    crossed.run(0.05, 0)
    assert crossed.currents == pytest.approx([0, 0, 3, 0, 0, 0], abs=1e-5)
    off = replace(locked, current_gain=(1.1, *[1.0] * 5), current_offset=(0.0, 0.02, *[0.0] * 4))
    reads = driven(off, {"A1": 3.3, "B1": 2.0})
    reads.run(0.05, 0)
    assert reads.currents == pytest.approx([3.0, 1.98, 0, 0, 0, 0], abs=1e-5)
    assert reads.means == pytest.approx([3.3, 2.0, 0, 0, 0, 0], abs=1e-5)
    assert crossed.means == pytest.approx([0, 3, 0, 0, 0, 0], abs=1e-5)


def test_a_brake_holds_one_axis_and_leaves_the_other() -> None:
    plant = Plant(replace(PlantParams(), brake=(0.0, 0.5)))
    plant.push(3.0, 0.3)
    plant.run(0.1, 0)
    assert plant.place[1] == 0
    assert plant.place[0] > 1e-3
