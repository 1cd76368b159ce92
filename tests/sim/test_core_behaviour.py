"""What the simulated machine does: determinism, lift, settling, contact, saturation, trips, defects."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sim_plants import centred, levitated, quiet

from sim_backend.core import LAND, LEVITATE, LIFT, OFF, READY
from sim_backend.machines.tsbs import plant as tsbs_core
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, Plant

COLUMN = {name: k for k, name in enumerate(CHANNELS)}
SATURATED, CONTACT = 1, 4 + 8


def scripted(seed: int, chunks: tuple[int, ...] = (1000, 12000, 5000)) -> bytes:
    """Rest, lift and hold; the telemetry as bytes. Chunks are how the time is cut; their sum is the same."""
    plant, rows, modes = Plant(PlantParams(), seed), [], {0: READY, 1000: LIFT, 13000: LEVITATE}
    for at, ticks in zip(np.cumsum((0, *chunks[:-1])), chunks, strict=True):
        if int(at) in modes:
            plant.mode = modes[int(at)]
        rows.append(plant.run(ticks))
    return np.concatenate(rows).tobytes()


def test_same_seed_same_bytes_however_the_time_is_cut() -> None:
    whole = scripted(3)
    assert scripted(3) == whole
    assert scripted(3, (337, 663, 4001, 7999, 1, 9, 4990)) == whole
    assert scripted(4) != whole


def test_noise_is_where_a_sensor_is() -> None:
    rows = levitated(PlantParams()).run(3000)
    spread = rows.std(axis=0)
    assert 1e-8 < spread[COLUMN["pos_yi"]] < 2e-7
    assert 1e-3 < spread[COLUMN["i_z_p"]] < 5e-2
    still = levitated(centred(detent=0.0)).run(3000)
    assert still.std(axis=0)[COLUMN["pos_yi"]] < 1e-11


def test_lift_leaves_the_rings_and_landing_returns() -> None:
    plant = Plant(PlantParams(), 1)
    plant.mode = READY
    assert int(plant.run(2000)[-1, COLUMN["flags"]]) & CONTACT == CONTACT
    plant.mode = LIFT
    plant.run(12000)
    assert plant.moved
    plant.mode = LEVITATE
    held = plant.run(3000)
    assert not held[:, COLUMN["flags"]].any()
    assert np.abs(held[-1000:, :4]).max() < 1e-6
    plant.mode = LAND
    plant.run(12000)
    assert plant.moved
    plant.mode = READY
    down = plant.run(3000)[-1]
    assert int(down[COLUMN["flags"]]) & CONTACT == CONTACT
    assert np.abs(down[7:17]).max() < 0.02
    assert plant.trips == 0


@pytest.mark.parametrize("beta", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("alpha_x", [0.85, 1.0, 1.15])
def test_loads_are_held_and_settled(beta: float, alpha_x: float) -> None:
    """0.6 s after 3 kg are handed over within 0.5 s the mean position over 0.4 s is within 0.02 um of zero."""
    nominal = PlantParams()
    p = dataclasses.replace(
        nominal, beta=(beta * nominal.beta[0], beta * nominal.beta[1]), alpha_x=alpha_x * nominal.alpha_x
    )
    plant = levitated(p)
    for mass in (0.25, 3.25, 0.25):
        plant.load(mass, 9.81 * mass, 0.5)
        assert np.abs(plant.run(5000)[:, :4]).max() < 2e-5
        plant.run(6000)
        rows = plant.run(4000)
        assert np.abs(rows[:, :4].mean(axis=0)).max() < 2e-8
        assert not rows[:, COLUMN["flags"]].any()


def test_rotor_points_and_spins() -> None:
    plant = levitated(PlantParams(), control=ControlParams(angle_slew=5.0))
    plant.set("angle_ref", 2.0)
    plant.run(15000)
    assert np.abs(plant.run(2000)[:, COLUMN["angle"]] - 2.0).max() < 2e-2
    plant.set("speed_ref", 30.0)
    plant.run(30000)
    assert plant.run(1000)[:, COLUMN["speed"]].mean() == pytest.approx(30.0, abs=0.1)
    assert plant.trips == 0


def test_motor_forces_ramp_and_show_in_the_bearings() -> None:
    """T (6.13a) with i_y up: the bearings carry less, in all alpha_d i_y. Without hysteresis, which takes up to 0.3 N."""
    plant = levitated(quiet(alpha_x=0.0, hysteresis=0.0))
    plant.run(10000)
    before = plant.run(1000)[-1]
    plant.set("i_y", 1.0)
    plant.run(30000)
    change = plant.run(1000)[-1] - before
    control = np.array([change[9] - change[10], change[13] - change[14]]) / 2
    assert control @ np.array([73.2, 74.4]) == pytest.approx(-12.1, rel=0.02)
    assert change[COLUMN["i_m1"]] == pytest.approx(1.0, abs=0.01)
    assert change[COLUMN["i_m3"]] == pytest.approx(-1.0, abs=0.01)


def test_saturated_amplifier_is_flagged_and_limits_the_current() -> None:
    limit = list(PlantParams().coil_limit)
    limit[6] = 4.0  # i_yo_p: enough to hold a light rotor, not the weight
    plant = Plant(dataclasses.replace(PlantParams(), coil_limit=tuple(limit), gravity=2.0), 1)
    plant.set_state(np.zeros(14))
    plant.mode = LEVITATE
    plant.run(5000)
    assert not plant.run(1000)[:, COLUMN["flags"]].any()
    plant.load(3.25, 31.9, 0.5)
    rows = plant.run(20000)
    assert rows[:, COLUMN["i_yo_p"]].max() < 4.05
    saturated = rows[rows[:, COLUMN["flags"]].astype(int) & SATURATED != 0]
    assert saturated[:, COLUMN["i_yo_p"]].max() > 3.99
    assert saturated[0, COLUMN["pos_yo"]] > -1e-4  # flagged well before the rotor is lost
    assert plant.trips == 1


@pytest.mark.parametrize(
    ("change", "bit"), [({"trip_current": 4.0}, 2), ({"trip_speed": 10.0}, 4)], ids=["overcurrent", "overspeed"]
)
def test_trips_latch_and_stop_the_run_at_a_telemetry_boundary(change: dict[str, float], bit: int) -> None:
    plant = levitated(PlantParams())
    tripping = Plant(dataclasses.replace(PlantParams(), **change), 1)
    tripping.mode = READY
    tripping.run(1000)
    assert tripping.trips == 0
    tripping.mode = LIFT
    tripping.set("speed_ref", 30.0)
    rows = tripping.run(30000)
    assert tripping.trips & bit
    assert tripping.tick < 31000
    assert tripping.tick % 10 == 0
    assert len(rows) == (tripping.tick - 1000) // 10
    tripping.clear_trips()
    assert tripping.trips == 0
    assert plant.trips == 0


def test_levitation_lost_trips_and_switches_the_amplifiers_off() -> None:
    plant = levitated(PlantParams())
    start = plant.tick
    plant.load(120.0, 1180.0, 0.1)
    plant.run(30000)
    assert plant.trips & 1
    assert plant.tick - start < 5000
    assert plant.mode == OFF
    plant.clear_trips()
    plant.load(0.0, 0.0, 0.0)
    row = plant.run(5000)[-1]
    assert np.abs(row[7:17]).max() < 0.02
    assert plant.trips == 0


def test_wrong_sensor_sign_drives_the_rotor_onto_the_rings() -> None:
    """The rotor is put to the centre by hand; with one sign wrong the law cannot keep it there."""
    plant = Plant(dataclasses.replace(PlantParams(), position_sign=(1.0, 1.0, 1.0, -1.0, 1.0)), 1)
    plant.set_state(np.zeros(14))
    plant.mode = LEVITATE
    rows = plant.run(5000)
    touching = rows[:, COLUMN["flags"]].astype(int) & CONTACT != 0
    assert touching[:200].any()
    assert touching[-200:].any()


def test_stuck_sensor_reads_its_value() -> None:
    plant = Plant(quiet(stuck=(0.0, 0.0, 0.0, 1.0, 0.0), stuck_value=7e-6), 1)
    rows = plant.run(100)
    assert rows[:, COLUMN["pos_yo"]] == pytest.approx(7e-6, rel=1e-12)
    assert (rows[:, COLUMN["pos_yi"]] < -2e-4).all()


def test_exchanged_axes_swap_the_readings_of_one_plane() -> None:
    right, wrong = (Plant(quiet(exchange_axes=(0.0, swap)), 1).run(50)[-1] for swap in (0.0, 1.0))
    np.testing.assert_array_equal(wrong[:5], right[[0, 1, 3, 2, 4]])


def test_inner_loop_closes_on_its_own_sensor() -> None:
    """At zero reference a coil whose sensor has an offset of -0.1 A and a gain of 0.9 carries 0.111 A and reads 0."""
    offset, gain = [0.0] * 10, [1.0] * 10
    offset[2], gain[2] = -0.1, 0.9
    plant = Plant(quiet(current_offset=tuple(offset), current_gain=tuple(gain)), 1)
    plant.mode = READY
    row = plant.run(200)[-1]
    assert row[COLUMN["i_yi_p"]] == pytest.approx(0, abs=1e-6)
    assert plant.state()["coil"][2] == pytest.approx(0.1 / 0.9, rel=1e-6)


def test_drift_goes_with_time() -> None:
    drift = [0.0] * 10
    drift[0] = 0.5
    row = Plant(quiet(current_drift=tuple(drift)), 1).run(1000)[-1]  # amplifiers off: the reading is the drift alone
    assert row[COLUMN["i_xi_p"]] == pytest.approx(0.5 * (1000 - 5.5) * 1e-4, rel=1e-9)


def test_quantisation_and_encoder_counts() -> None:
    p = dataclasses.replace(quiet(), position_lsb=1e-6, encoder_counts=4096.0)
    plant = Plant(p, 1)
    row = plant.run(10)[-1]
    assert row[:4] / 1e-6 == pytest.approx(np.round(row[:4] / 1e-6), abs=0.11)
    assert row[COLUMN["angle"]] * 4096 / (2 * np.pi) == pytest.approx(0, abs=1e-9)


def test_unknown_parameter_is_refused() -> None:
    plant = Plant()
    with pytest.raises(KeyError):
        plant.set("kp_q", 1.0)
    with pytest.raises(KeyError):
        plant.get("kp_q")
    plant.set("kp_i", 3e4)
    assert plant.get("kp_i") == 3e4


def test_integrator_waits_at_the_limit_and_leaves_it_at_once() -> None:
    """The law alone: an error that pushes further into the current limit is not integrated, one that leads out is."""
    control, state = tsbs_core._ffi.new("tsbs_control *"), tsbs_core._ffi.new("tsbs_law_state *")
    reading, out = tsbs_core._ffi.new("tsbs_reading *"), tsbs_core._ffi.new("tsbs_reference *")
    tsbs_core.fill(control, vars(ControlParams(kd_i=0.0)))
    state.mode = LEVITATE
    for y, change in ((-1e-3, 0.0), (1e-5, -1e-5 * control.ki_i * 1e-4)):
        before = state.integral[0] = 20.0
        reading.position = [y, 0.0, y, 0.0, 0.0]
        tsbs_core._lib.tsbs_law(control, state, reading, out)
        assert out.coil[0] == control.current_limit
        assert state.integral[0] - before == pytest.approx(change, abs=1e-12)
