"""The linear-rotary actuator's plant against its slow reference, against energy, and against what L prints of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lira_plants import RADIAL, column, current_step, flying, rise_s

from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import MEASURED, TICKS_S, WHOLE, Plant, coils, ideal
from sim_backend.machines.lira.reference import advanced, fluxes, moved, rates, stored

H = 1 / TICKS_S


def uneven() -> PlantParams:
    """A machine none of whose numbers is alike: a formula that takes the wrong one shows."""
    k = np.arange(15)

    def spread(nominal: tuple[float, ...], share: float, way: int) -> tuple[float, ...]:
        return tuple(float(x) for x in np.array(nominal) * (1 + share * (way * k % 5 - 2) / 2))

    p = PlantParams()
    return replace(
        ideal(), torque_constant=(0.205, 0.218), bearing_constant=(3.6, 3.85), pull=(360e3, 392e3), bearing_plane=0.0447,
        transverse_inertia=3.1e-3, zero_ra=(0.03, -0.05), zero_la=0.02, centre=(4e-6, -6e-6, 5e-6, 2e-6),
        coil_r=spread(p.coil_r, 0.03, 7), coil_l=spread(p.coil_l, 0.02, 3), filter_l=spread(p.filter_l, 0.1, 2),
        filter_c=spread(p.filter_c, 0.1, 4), damper_c=spread(p.damper_c, 0.1, 6), damper_r=spread(p.damper_r, 0.02, 9),
        clearance=1.0, clearance_out=1.0,
    )  # fmt: skip


def state_of(plant: Plant) -> Array:
    return np.concatenate([plant.place, plant.electric.ravel()])


def moving(params: PlantParams) -> Plant:
    """On its way along z and around, a plane pushed aside: currents limited, every coil at work."""
    plant = flying(params, observer=2)
    plant.run(0.01)
    plant.refer("z", 0.0135)
    plant.refer("angle", 0.3)
    plant.refer("x1", 10e-6)
    return plant


def test_a_flight_is_that_of_the_reference() -> None:
    params = uneven()
    plant = moving(params)
    plant.run(2e-3)
    state = state_of(plant)
    for _ in range(560):  # 2 ms
        sent = plant.sent
        plant.run(H, 0)
        state = advanced(params, state, sent, H, 2)
    ours = state_of(plant)
    apart = abs(ours - state)
    assert apart[:2].max() < 2e-10  # m; 10 um are moved
    assert apart[4] < 1e-9
    assert apart[5] < 1e-8
    assert apart[12:].reshape(4, 15)[3].max() < 2e-3  # A of some 10: the emf is held over a tick
    assert abs(plant.electric[3]).max() > 2


def test_what_the_coils_give_is_what_the_fluxes_say() -> None:
    """(2)-(4): T = K_R i_q, F = K_B (i_d, i_q), F_z = K_L i_q, and the torque of bearing currents off the middle."""
    p = replace(ideal(), pull=(0.0, 0.0), cogging_force=0.0, cogging_torque=0.0, gravity=0.0)
    q = np.array([20e-6, -30e-6, 0.0, 0.0, p.middle, 0.37])
    dq = np.array([0.7, 1.3, -0.4, 2.1])
    state = np.concatenate([q, np.zeros(6), np.zeros(45), coils(dq, 8 * 0.37), np.zeros(9)])
    a = rates(p, state, np.zeros(15))[6:12]
    assert a[0] * p.mass == pytest.approx(3.7 * -0.4, rel=1e-8)
    assert a[1] * p.mass == pytest.approx(3.7 * 2.1, rel=1e-8)
    wanted = 0.21 * 1.3 + 8 * 3.7 * (20e-6 * 2.1 - -30e-6 * -0.4)
    assert a[5] * p.polar_inertia == pytest.approx(wanted, rel=1e-7)


def test_the_six_coils_are_two_systems_without_cross_talk() -> None:
    """L (1) as corrected: W'W is 2, and no combination of both systems reaches the zero sequences of the stars."""
    w = np.array([coils(np.eye(4)[k], 0.0) for k in range(4)])
    assert w @ w.T == pytest.approx(3 * np.eye(4), abs=1e-12)  # six coils of unit systems: 6/2
    assert w[:, [0, 2, 4]].sum(axis=1) == pytest.approx(0, abs=1e-12)
    assert w[:, [1, 3, 5]].sum(axis=1) == pytest.approx(0, abs=1e-12)


def test_bearing_systems_have_seven_pairs_and_no_nine() -> None:
    """The field of six tooth coils: R has 2, 4, 8 and 10 pairs, B has 1, 5 and 7. The pairing +-b, +-c would put 9 into B."""
    tooth = np.arange(6) * 2 * np.pi / 6

    def content(currents: Array, pairs: int) -> float:
        width = np.pi / 6
        wave = np.array([np.sin(pairs * width / 2) * np.exp(1j * pairs * t) for t in tooth])
        return float(abs(wave @ currents))

    torque, bearing = coils(np.array([1.0, 0, 0, 0]), 0.3), coils(np.array([0, 0, 1.0, 0]), 0.3)
    assert [n for n in range(1, 11) if content(torque, n) > 1e-9] == [2, 4, 8, 10]
    assert [n for n in range(1, 11) if content(bearing, n) > 1e-9] == [1, 5, 7]


def work(plant: Plant, params: PlantParams, seconds: float) -> tuple[float, float]:
    """What goes into the coils less heat, magnetic and mechanical energy over a time; and the mechanical energy, J."""
    r, inductance = np.array(params.coil_r), np.array(params.coil_l)
    power, heat = [], []

    def energy() -> tuple[float, float]:
        q, v = plant.place[:6], plant.place[6:]
        return 0.5 * (inductance * plant.electric[3] ** 2).sum(), stored(params, q) + moved(params, v)

    before = energy()
    for k in range(round(seconds * TICKS_S) + 1):
        if k:
            plant.run(H, 0)
        _, u, _, i = plant.electric
        power.append((u * i).sum())
        heat.append((r * i * i).sum())
    after = energy()
    mechanical = after[1] - before[1]
    return float(np.trapezoid(power) - np.trapezoid(heat)) * H - (after[0] - before[0]) - mechanical, mechanical


def test_energy_is_conserved_over_a_limited_move() -> None:
    params = replace(ideal(), clearance=1.0, clearance_out=1.0)
    rest, mechanical = work(moving(params), params, 0.03)
    assert mechanical > 5e-3
    assert abs(rest) < 1e-5
    without, mechanical = work(moving(replace(params, emf=0.0)), params, 0.03)
    assert abs(without) > 0.5 * mechanical


def test_the_current_step_is_that_of_the_figure() -> None:
    """G1: L prints 0.12 ms and a q that stays 0; the inverter is at its limit while the capacitor charges."""
    rows = current_step()
    assert rise_s(rows) == pytest.approx(0.1203e-3, rel=2e-3)  # the design study's own kernel
    assert abs(column(rows, "i_q_R1")).max() < 1e-12
    assert abs(column(rows, "f_d_R1")).max() == pytest.approx(20, rel=0.03)
    assert rise_s(current_step(amperes=0.3), 0.3) == pytest.approx(0.0901e-3, rel=2e-3)
    weak = replace(ideal(), filter_c=(0.8 * 4.8e-6,) * 15, damper_c=(0.8 * 4.8e-6,) * 15)
    assert rise_s(current_step(weak)) == pytest.approx(0.134e-3, rel=1e-2)


def test_unequal_coils_put_current_into_q() -> None:
    drawn = uneven()
    rows = current_step(replace(ideal(), coil_r=drawn.coil_r, coil_l=drawn.coil_l))
    assert 5e-3 < abs(column(rows, "i_q_R1")).max() < 60e-3


def exchanged() -> PlantParams:
    """Phases b and c of both systems of both rotary actuators exchanged, at the terminals."""
    order = list(range(15))
    for first in (0, 6):
        for one, other in ((1, 5), (2, 4)):
            order[first + one], order[first + other] = first + other, first + one
    return replace(ideal(), terminal=tuple(map(float, order)))


def test_a_step_at_rest_is_blind_to_exchanged_phases_and_flight_is_not() -> None:
    sound, wrong = current_step(), current_step(exchanged())
    assert column(wrong, "i_d_R1") == pytest.approx(column(sound, "i_d_R1"), abs=1e-12)
    rows = flying(exchanged()).run(4e-3)
    lost = abs(rows[:, RADIAL]).max(axis=1)
    assert lost.max() > 100e-6
    at = int(np.argmax(lost > 100e-6))
    assert abs(rows[at, RADIAL[2:]]).max() > 10 * abs(rows[at, RADIAL[:2]]).max()  # in y: the sign of F_y


def test_cogging_is_a_spring_along_z_and_around() -> None:
    """(4 pi/tau) F_c, which (21) and (22) print without its factor, with both signs; 48 T_c around."""
    p = replace(ideal(), gravity=0.0)
    for z, sign in ((p.pair_pitch, 1.0), (p.pair_pitch * 1.25, -1.0)):
        state = np.zeros(72)
        state[4] = z + 1e-6
        a = rates(p, state, np.zeros(15))
        assert a[10] * p.mass / -1e-6 == pytest.approx(sign * 4 * np.pi / p.pair_pitch * 20, rel=1e-4)
        plant = Plant(replace(p, clearance=1.0, clearance_out=1.0))
        plant.put(z=z + 1e-6)
        plant.run(H, 0)
        assert plant.place[10] / H * p.mass / -1e-6 == pytest.approx(sign * 4 * np.pi / p.pair_pitch * 20, rel=1e-3)


def test_reciprocity_wants_the_flux_of_the_force_constant() -> None:
    """Psi_l is 110.7 mWb where L prints 110; Psi of a coil K_R/24 is 8.75 mWb, where L prints 20.7."""
    p = ideal()
    linear = fluxes(p, np.zeros(6))
    assert linear[12] == pytest.approx(0.1107, rel=1e-3)
    assert linear[0] == pytest.approx(8.75e-3, rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_seed_gives_the_same_bytes(seed: int) -> None:
    def rows(reduced: bool) -> bytes:
        plant = Plant(PlantParams(), seed, reduced=reduced)
        plant.put(z=11e-3)
        plant.refer("z", 11e-3)
        plant.switch(currents=True, bearings=True, axial=True, angle=True)
        return np.vstack([plant.run(0.004), plant.run(0.016)]).tobytes()

    for reduced in (False, True):
        once = rows(reduced)
        assert rows(reduced) == once
        plant = Plant(PlantParams(), seed + 1, reduced=reduced)
        assert plant.run(0.02).tobytes() != once


def test_the_measurements_are_those_of_the_machine() -> None:
    assert len(MEASURED) == 52
    plant = moving(uneven())
    plant.run(2e-3, 0)
    before = plant.electric[[0, 1, 3]].ravel()
    told = plant.run(H, 1, whole=True)[0, [WHOLE.index(name) for name in MEASURED[:46]]]
    assert told == pytest.approx([*before, 400.0], abs=1e-12)


def test_the_reduced_machine_has_coil_currents_and_no_half_bridges() -> None:
    rows = flying(reduced=True).run(0.2, whole=True)[-1]
    assert np.isnan(rows[[WHOLE.index("i_f1"), WHOLE.index("u_s15")]]).all()
    coil = rows[[WHOLE.index(f"i_s{k}") for k in range(1, 7)]]
    weight = 1.34 * 9.81 / 2 / 3.7
    assert coil == pytest.approx(coils(np.array([0, 0, 0, weight]), 0.0), abs=1e-3)
