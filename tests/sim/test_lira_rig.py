"""The simulated rig `lira`: its draws, its true quantities, its planted defects, its mission."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from lira_mission import Host, fly
from lira_plants import RADIAL, flying

from bench.errors import ConfigError
from bench.rigfile import RigFile, load_rig
from sim_backend.endpoint import SimulatedRig
from sim_backend.machine import Truth
from sim_backend.machines.lira.defects import DEFECTS
from sim_backend.machines.lira.machine import LIRA, Built
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import TRACE, Plant, ideal
from sim_backend.truth import draw, nominal

AXES = ("x1", "x2", "y1", "y2", "z", "gamma")
HALVES = range(1, 16)
MOVES = {
    "site.gravity": "gravity", "geometry.bearing_plane": "bearing_plane", "geometry.sensor_plane": "sensor_plane",
    "geometry.clearance": "clearance", "machine.mass": "mass", "machine.polar_inertia": "polar_inertia",
    "machine.transverse_inertia": "transverse_inertia", "machine.pull_1": "pull", "machine.pull_2": "pull",
    "force_constant": "force_constant", "torque_constant_1": "torque_constant", "torque_constant_2": "torque_constant",
    "bearing_constant_1": "bearing_constant", "bearing_constant_2": "bearing_constant", "middle": "middle",
    "pair_pitch": "pair_pitch", "cogging_force": "cogging_force", "cogging_force_2": "cogging_force_2",
    "cogging_torque": "cogging_torque", "coil_resistance_rot": "coil_r", "coil_resistance_lin": "coil_r",
    "machine.inductance_rot": "coil_l", "machine.inductance_lin": "coil_l", "filter_capacitance": "filter_c damper_c",
    "supply": "supply", "discharge": "discharge_s", "zero_ra1": "zero_ra", "zero_ra2": "zero_ra", "zero_la": "zero_la",
    "magnet_runout_1": "uneven", "magnet_runout_2": "uneven", "magnet_phase_1": "uneven_phase",
    "magnet_phase_2": "uneven_phase", "target_runout": "runout", "target_phase": "runout_phase", "eccentric_x": "eccentric",
    "eccentric_y": "eccentric", "filter_delay": "filter_lag", "adc_late": "late", "ring_friction": "ring_friction",
    **{f"magnet_centre_{name}": "centre" for name in AXES[:4]},
    **{f"{name}.gain": "position_gain" for name in AXES[:5]}, **{f"{name}.offset": "position_offset" for name in AXES[:5]},
    **{f"{sensor}{k}.{what}": field for k in HALVES for sensor, what, field in (
        ("i_f", "gain", "bridge_gain"), ("i_f", "offset", "bridge_offset"), ("i_s", "gain", "coil_gain"),
        ("i_s", "offset", "coil_offset"), ("u_s", "gain", "voltage_gain"))},
    **{f"{name}_{k}": field for k in HALVES for name, field in (
        ("coil_resistance_spread", "coil_r"), ("coil_inductance_spread", "coil_l"), ("filter_inductance", "filter_l"),
        ("damper_resistance", "damper_r"), ("capacitor_derating_filter", "filter_c"),
        ("capacitor_derating_damper", "damper_c"))},
    "site.air_density": "", "machine.pole_pairs": "", "machine.pair_pitch": "", "rest_angle": "",
    **{f"u_s{k}.offset": "" for k in HALVES},
    "machine.ring_inertia": "", "machine.ring_mass": "", "machine.ring_eccentricity": "",
    "geometry.hook_far": "", "geometry.hook_near": "", "masses.M1": "", "masses.M2": "", "mass_density": "",
}  # fmt: skip
"""What moves which field of the plant: the air bears nothing, poles are counted, of the pitch it is the simulation's
own number that counts, voltages have no offset, and masses, where they hang, and the ring are
what its operator goes by."""


@cache
def rig() -> RigFile:
    return load_rig("lira")


@cache
def drawn(seed: int) -> Truth:
    return draw(rig(), seed)


def built(**truth: float) -> Built:
    found = draw(rig(), 0, {**nominal(rig()), **truth}).plant
    assert isinstance(found, Built)
    return found


def changed(one: PlantParams, other: PlantParams) -> str:
    return " ".join(f.name for f in fields(PlantParams) if getattr(one, f.name) != getattr(other, f.name))


def test_the_nominal_machine_is_that_of_the_paper() -> None:
    """But for the site's gravity, and for capacitors that have less than their nameplate, as L VI-A says."""
    found = built().plant
    paper = PlantParams()
    assert set(changed(found, paper).split()) <= {
        "gravity",
        "filter_c",
        "damper_c",
        "filter_l",
        "filter_lag",
    }  # rounded
    assert found.gravity == 9.81175
    assert found.filter_c == found.damper_c == pytest.approx((0.875 * 4.8e-6,) * 15)
    assert (found.filter_l, found.filter_lag) == (pytest.approx(paper.filter_l), pytest.approx(10e-6))
    q = draw(rig(), 0, nominal(rig())).quantities
    printed = {"K_L@LA": 83.5, "K_R@RA1": 0.21, "K_R@RA2": 0.21, "K_B@RA1": 3.7, "K_pull@RA2": 375e3, "lambda": 748.1,
               "m": 1.34, "J": 1.45e-3, "F_c": 20, "T_c": 0.0376, "Psi@LA": 110.7e-3, "Psi@RA1": 8.75e-3, "R@RA1": 1.8,
               "L@LA": 31e-3, "zero@RA1": 0, "zero_current@y2": 0}  # fmt: skip
    for name, value in printed.items():
        assert q[name] == pytest.approx(value, rel=5e-4, abs=1e-12), name


@pytest.mark.parametrize("number", sorted(MOVES))
def test_each_number_moves_what_it_is_of(number: str) -> None:
    base, value = built(), nominal(rig())[number]
    moved = built(**{number: value * 1.01 + 1e-6})
    assert set(changed(base.plant, moved.plant).split()) == set(MOVES[number].split())
    assert (base.rest_angle != moved.rest_angle) == (number == "rest_angle")


def test_every_number_is_accounted_for() -> None:
    assert LIRA.stated(rig()).keys() == MOVES.keys()


def test_coils_and_half_bridges_have_their_own() -> None:
    one = built(coil_resistance_spread_14=0.02, coil_inductance_spread_3=-0.01, filter_inductance_5=88e-6).plant
    assert [k for k, r in enumerate(one.coil_r) if r not in (1.8, 6.3)] == [13]
    assert one.coil_r[13] == pytest.approx(6.3 * 1.02)
    assert one.coil_l[2] == pytest.approx(2.4e-3 * 0.99)
    assert (one.filter_l[4], one.filter_l[5]) == (88e-6, pytest.approx(80e-6))
    p = drawn(3).plant.plant
    for field in ("coil_r", "coil_l", "filter_l", "filter_c", "damper_c", "damper_r", "coil_gain", "bridge_offset"):
        assert len(set(getattr(p, field))) == 15, field


def test_the_same_seed_is_the_same_machine() -> None:
    again, other, later = draw(rig(), 3), draw(rig(), 4), draw(rig(), 3, visit=1)
    assert again.facts == drawn(3).facts
    assert all(other.values[n] != again.values[n] for n, t in LIRA.stated(rig()).items() if t.standard_uncertainty)
    assert {n for n in again.values if later.values[n] != again.values[n]} == LIRA.daily


def test_draws_keep_within_what_is_stated() -> None:
    many = [drawn(seed).plant.plant for seed in range(40)]
    for field, low, high in (("filter_c", 3.6e-6, 4.8e-6), ("coil_gain", 0.995, 1.005), ("filter_lag", 0, 20e-6),
                             ("late", -30e-9, 30e-9), ("zero_ra", -math.radians(2.6), math.radians(2.6))):  # fmt: skip
        found = np.array([getattr(p, field) for p in many])
        assert low <= found.min() < low + 0.1 * (high - low)
        assert high >= found.max() > high - 0.1 * (high - low)
    uneven = np.array([p.uneven for p in many])
    assert uneven.min() >= 0
    assert math.sqrt((uneven**2).mean()) == pytest.approx(7.5e-6, rel=0.25)


def test_truth_can_be_asked_for() -> None:
    """Quantities that are a number of the machine, and the model that runs."""
    found = draw(rig(), 1, {"K_R@RA2": 0.2, "reduced": 1})
    assert (found.plant.plant.torque_constant[1], found.plant.reduced) == (pytest.approx(0.2), True)
    assert not drawn(1).plant.reduced


@pytest.mark.parametrize("seed", range(3))
def test_at_the_zero_current_points_the_bearings_carry_the_weight_alone(seed: int) -> None:
    """Held there at z_mid, with sensors that keep their gains and zeros but no noise, and nothing that turns with the mover."""
    found = drawn(seed)
    p = found.plant.plant
    still = replace(ideal(p), position_gain=p.position_gain, position_offset=p.position_offset, uneven=(0.0, 0.0), runout=0.0,
                    eccentric=(0.0, 0.0), zero_ra=(0.0, 0.0))  # fmt: skip
    plant = flying(still, reduced=True, z=p.middle, observer=2.0)
    for name in ("x1", "x2", "y1", "y2"):
        plant.refer(name, found.quantities[f"zero_current@{name}"])
    rest = plant.run(1.0)[-100:].mean(axis=0)
    across, up = ([rest[TRACE.index(f"i_{way}_B{k}")] for k in (1, 2)] for way in "dq")
    assert across == pytest.approx([0.0, 0.0], abs=2e-3)  # 20 nm of the pull
    lifted = sum(k * i for k, i in zip(p.bearing_constant, up, strict=True))
    assert lifted == pytest.approx(p.mass * p.gravity, rel=1e-3)
    assert max(abs(x) for x in rest[RADIAL]) > 1e-6  # and not in the rings' middle


def test_lambda_is_how_the_mover_leaves_the_middle() -> None:
    """Both planes let go at once from the middle of their pull, 10 nm off, currents off: cosh(lambda t)."""
    p = drawn(2).plant.plant
    alone = replace(ideal(p), clearance=1.0, clearance_out=1.0, gravity=0.0, centre=(0.0,) * 4, uneven=(0.0, 0.0),
                    pull=(sum(p.pull) / 2,) * 2, cogging_force=0.0, cogging_force_2=0.0, middle=0.0)  # fmt: skip
    plant = Plant(alone, reduced=True)
    plant.put(x=1e-8)
    x = plant.run(5e-3)[:, RADIAL[0]]
    rate = np.arccosh((x[2:] + x[:-2]) / (2 * x[1:-1])) * 35e3  # of cosh, from row to row
    assert rate[10:] == pytest.approx(drawn(2).quantities["lambda"], rel=1e-4)


def test_what_the_engine_plants_is_there() -> None:
    assert {
        "drop_fraction",
        "dead_after_s",
        "fault_after_s",
        "drive_fault_after_s",
        "integrator_factor",
    } <= DEFECTS.keys()
    assert changed(LIRA.params(drawn(2).values, DEFECTS).plant, drawn(2).plant.plant) == ""


@pytest.mark.parametrize(
    ("planted", "field"),
    [({"coil_reversed": 4.0}, "turned"), ({"exchange_phases": 1.0}, "terminal"), ({"exchange_actuators": 1.0}, "terminal"),
     ({"zero_off_ra": 0.2}, "zero_ra"), ({"zero_off_la": 0.2}, "zero_la"), ({"adc_late_s": 1e-7}, "late"),
     ({"position_sign_x1": -1.0}, "position_gain"), ({"position_sign_y1": -1.0}, "position_gain"),
     ({"cables_exchanged": 203.0}, "terminal"), ({"actuator_reversed": 2.0}, "turned"), ({"coil_dead": 5.0}, "coil_r"),
     ({"weak_coil": 4.0, "weak_coil_gives": 0.5}, "strength")],
)  # fmt: skip
def test_defects_reach_the_plant(planted: dict[str, float], field: str) -> None:
    assert changed(built().plant, built(**planted).plant) == field


def test_wiring_by_hand() -> None:
    """b and c of both systems: coils 2 and 6, 3 and 5; a coil that is reversed is so wherever it is connected."""
    assert built(exchange_phases=1).plant.terminal[:8] == (0, 5, 4, 3, 2, 1, 6, 7)
    assert built(exchange_phases=3).plant.terminal == (0, 5, 4, 3, 2, 1, 6, 11, 10, 9, 8, 7, 12, 13, 14)
    both = built(exchange_actuators=1, coil_reversed=8).plant
    assert both.terminal == (6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5, 12, 13, 14)
    assert both.turned.index(1.0) == 1
    assert sum(built(coil_reversed=15).plant.turned) == 1
    assert built(cables_exchanged=209).plant.terminal[:9] == (0, 8, 2, 3, 4, 5, 6, 7, 1)
    assert [k + 1 for k, t in enumerate(built(actuator_reversed=3).plant.turned) if t] == [13, 14, 15]
    assert built(coil_dead=14).plant.coil_r[13] == 5000.0
    assert (
        built(weak_coil=2, weak_coil_gives=0.3, exchange_phases=1).plant.strength[5] == 0.3
    )  # wherever it is connected


@pytest.mark.parametrize(
    "planted",
    [
        "coil_reversed",
        "exchange_phases",
        "exchange_actuators",
        "cables_exchanged",
        "coil_dead",
        "weak_coil",
        "adc_late_s",
    ],
)
def test_the_reduced_model_says_what_it_does_not_have(planted: str) -> None:
    with pytest.raises(ConfigError, match=f"simulation.reduced: found 1 with {planted}; expected 0"):
        built(reduced=1, **{planted: 1.0})


def test_one_zero_is_that_of_the_first_actuator() -> None:
    def flown(**control: float) -> np.ndarray:
        return flying(built().plant, reduced=True, zero_ra1=0.2, observer=2.0, **control).run(5e-3)

    shared, same, own = flown(one_zero=1, zero_ra2=-0.3), flown(zero_ra2=0.2), flown(zero_ra2=-0.3)
    assert np.array_equal(shared, same)
    assert not np.array_equal(shared, own)
    assert built(one_zero=1).control == ControlParams(one_zero=1.0)


def test_without_the_pull_the_first_observer_loses_the_mover() -> None:
    """And the second one holds it: `no_pull` is what the firmware's observers do not know."""
    p = built(no_pull=1)
    assert (p.control.observer_pull, built().control.observer_pull) == (0.0, 1.0)
    for observer, lost in ((1.0, True), (2.0, False)):
        plant = flying(p.plant, reduced=True, observer=observer, observer_pull=p.control.observer_pull)
        assert bool(abs(plant.run(0.05)[:, RADIAL]).max() < 100e-6) != lost  # without rings it is soon no number


@pytest.mark.parametrize("planted", [{"coil_reversed": 3.0}, {"exchange_phases": 2.0}, {"exchange_actuators": 1.0},
                                     {"zero_off_ra": math.radians(80)}, {"position_sign_y1": -1.0}])  # fmt: skip
def test_with_wrong_wiring_the_mission_ends(planted: dict[str, float]) -> None:
    assert fly(built().plant, observer=2).ended == "landed"
    assert fly(built(**planted).plant, observer=2).ended != "landed"


@pytest.mark.parametrize("seed", range(4))
def test_what_is_made_is_lifted_from_its_rings(seed: int) -> None:
    """As a controller does it: currents on, turned to 0, bearings on, crawl, gate."""
    truth = draw(rig(), seed, {"reduced": 1})
    host = Host(truth.machine.make(truth.plant, truth.noise, 1))
    host.wait(0.3)
    assert [host.plant.command(name) for name in ("idle", "on")] == [0, 0]
    host.plant.go("angle", 0.0, 2.0, 20.0)
    host.wait(0.5)
    assert host.plant.command("lift") == 0
    assert host.until("LEVITATED", 4.0)


def test_the_mover_rests_in_its_rings_at_first() -> None:
    """As it was left: at its angle, on the ring below, in which it reads less than what refuses a lift."""
    truth = drawn(6)
    plant = truth.machine.make(truth.plant, truth.noise, 1)
    rows = plant.run(0.5)
    assert plant.state == "OFF"
    assert rows[-1, 11] == pytest.approx(truth.values["rest_angle"], abs=0.05)
    assert np.hypot(plant.place[0], plant.place[1]) == pytest.approx(truth.values["geometry.clearance"], abs=3e-6)


@pytest.mark.parametrize(("observer", "landed"), [(1.0, 39), (2.0, 40)])
def test_drawn_machines_fly_the_mission(observer: float, landed: int) -> None:
    """The first observer loses one of a hundred: seed 29, whose uneven magnets are among the largest."""
    ends = [fly(drawn(seed).plant.plant, seed, reduced=True, observer=observer).ended for seed in range(40)]
    assert ends.count("landed") == landed


def test_who_works_on_it_says_yes() -> None:
    line = LIRA.operator(rig(), None, drawn(1))
    assert line.request("ask is the ring off?") == "yes"
    assert line.request("hang M1").startswith("error")


def test_a_controller_of_its_own_is_what_a_simulated_rig_gets() -> None:
    """In the place of the one that speaks the protocol's bytes."""
    asked: list[object] = []

    def own(*args: object) -> SimpleNamespace:
        asked.extend(args)
        return SimpleNamespace(plant=None)

    truth = replace(drawn(1), machine=replace(LIRA, controller=own))
    assert SimulatedRig(rig(), truth, substeps=3).device.plant is None
    assert asked == [rig(), truth, [], 3]
