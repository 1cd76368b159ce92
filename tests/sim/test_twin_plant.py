"""The twin with its law: rigs of any shape are lifted and held, its parameters by name act where they say, its columns are the
rig's channels, and what is planted shows."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from twin_rigs import ONE_AXIS, ROOT, SPINDLE, STAND, THREES, column, levitated, nominal, plant_of, rig, shipped, truth

from bench.rigfile import RigFile
from sim_backend import core
from sim_backend.core import DriveLaw
from sim_backend.machines.twin.plant import TwinPlant

RIGS = {
    "shipped": shipped(),
    "spindle": rig("spindle", SPINDLE),
    "stand": rig("stand", STAND),
    "threes": rig("threes", THREES),
    "one axis": rig("one", ONE_AXIS),
    "slow": rig("slow", SPINDLE, tick=2.5e-4),
    "fast": rig("fast", STAND, tick=4e-5),
}
STAND_RIG, SPINDLE_RIG = RIGS["stand"], RIGS["spindle"]


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("seed", [0, 1])
def test_it_lifts_and_holds(name: str, seed: int) -> None:
    plant = levitated(truth(RIGS[name], seed), 0.4)
    rows = plant.run(round(0.1 / plant.tick_s))
    assert plant.trips == 0
    assert np.abs(rows[:, : plant.params.names.radial_columns]).max() < 5e-6
    assert len(rows) == round(0.1 / plant.tick_s) // plant.period_ticks
    assert not any(column(plant, rows, n).any() for n in plant.channels if n.startswith("status."))


def test_columns_are_the_rigs_channels() -> None:
    plant = plant_of(truth(SPINDLE_RIG))
    coils = [f"amp_{a}_{c}" for a in ("u1", "v1", "u2", "v2", "w") for c in "pn"]
    positions = ["pos_u1", "pos_v1", "pos_u2", "pos_v2", "pos_w"]
    marked = ["ang", "rate", "count", "edge", "pulse_age", "inject", "before", "after"]
    status = [
        f"status.{n}"
        for n in (
            "contact.low",
            "contact.high",
            "contact.end",
            "contact.axial",
            "current_limit",
            "voltage_limit",
            "sensor_range",
        )
    ]
    assert list(plant.channels) == [*positions, *coils, "volt_lower", "volt_upper", *marked, *status]
    inside = ["angle", "speed", "pulses"]  # what it knows of the mark by its own names; the edge is called so here
    assert list(plant.trace_channels) == [*positions, *coils, *marked[:5], *inside, *marked[5:]]
    rows, readings = plant.run(100, 5)
    assert rows.shape == (10, len(plant.channels))
    assert readings.shape == (20, len(plant.trace_channels))


def test_a_rig_without_mark_and_rings_tells_none() -> None:
    plant = plant_of(truth(STAND_RIG))
    assert not {"edge", "pulse_age", "speed", "status.contact.axial"} & {*plant.channels}
    assert (plant.speed, plant.pulse_age_s, plant.turn_s) == (0.0, None, None)


def test_the_same_seed_is_the_same_run() -> None:
    one, other, third = (plant_of(truth(SPINDLE_RIG, seed)).run(500) for seed in (4, 4, 5))
    assert (one == other).all()
    assert (one != third).any()


def test_a_run_in_parts_is_the_same_run() -> None:
    whole, parts = (plant_of(truth(SPINDLE_RIG)) for _ in range(2))
    assert (whole.run(1000) == np.concatenate([parts.run(n) for n in (7, 333, 660)])).all()


@pytest.mark.parametrize("tick", [5e-5, 2e-4])
def test_ticks_are_the_rigs(tick: float) -> None:
    """No telemetry in the map: a row each millisecond."""
    plant = plant_of(truth(rig("ticks", STAND, tick=tick)))
    assert (plant.tick_s, plant.period_ticks) == (tick, round(1e-3 / tick))
    assert len(plant.run(round(0.1 / tick))) == 100


def still(plant: TwinPlant) -> np.ndarray[Any, Any]:
    return plant.run(round(1.5 / plant.tick_s))[-200:].mean(axis=0)


def test_a_set_point_moves_its_own_axis_alone() -> None:
    """Bearings at -150 and 100 mm, probes at -120 and 130: what the probes read when the right bearing alone goes up by 20
    um."""
    plant = levitated(nominal(STAND_RIG))
    before = still(plant)
    plant.set("ref.yr", 20e-6)
    moved = dict(zip(plant.channels, (still(plant) - before).tolist(), strict=True))
    assert moved["pos_yl"] == pytest.approx(20e-6 * 30 / 250, abs=2e-8)
    assert moved["pos_yr"] == pytest.approx(20e-6 * 280 / 250, abs=2e-8)
    assert abs(moved["pos_xl"]) < 1e-8


@pytest.mark.parametrize(
    ("name", "size", "expected"),
    [
        ("ref.y", 20e-6, {"pos_xl": 20e-6, "pos_xr": 20e-6, "pos_yl": 0.0, "pos_yr": 0.0}),
        ("ref.z", 20e-6, {"pos_xl": 0.0, "pos_xr": 0.0, "pos_yl": 20e-6, "pos_yr": 20e-6}),
        ("ref.psi", 1e-4, {"pos_xl": 0.0, "pos_xr": 0.0, "pos_yl": -12e-6, "pos_yr": 13e-6}),
        ("ref.theta", 1e-4, {"pos_xl": 12e-6, "pos_xr": -13e-6, "pos_yl": 0.0, "pos_yr": 0.0}),
    ],
)
def test_set_points_of_the_shaft(name: str, size: float, expected: dict[str, float]) -> None:
    """y is along the first axis of the first bearing, here xl to the left, and z along its second, here yl upwards: a turn
    by psi about the left takes the far end up, one by theta about up takes it to the right."""
    plant = levitated(nominal(STAND_RIG))
    before = still(plant)
    plant.set(name, size)
    moved = dict(zip(plant.channels, (still(plant) - before).tolist(), strict=True))
    for channel, value in expected.items():
        assert moved[channel] == pytest.approx(value, abs=1e-7), channel


def test_set_points_are_followed_at_the_slew() -> None:
    plant = levitated(nominal(STAND_RIG))
    plant.set("slew", 1e-3)
    plant.set("ref.yl", 30e-6)
    half = column(plant, plant.run(150), "pos_yl")[-1]
    assert 3e-6 < half < 24e-6


def test_a_path_is_an_ellipse_along_the_first_bearings_axes() -> None:
    plant = levitated(nominal(SPINDLE_RIG))
    for name, value in (("on", 1), ("y", 20e-6), ("z", 10e-6), ("hz", 2), ("ramp_s", 0.1)):
        plant.set(f"path.{name}", value)
    plant.run(10000)
    rows = plant.run(10000)
    u1, v1 = column(plant, rows, "pos_u1"), -column(plant, rows, "pos_v1")  # v1 is told with sign -1
    assert (np.ptp(u1) / 2, np.ptp(v1) / 2) == pytest.approx((20e-6, 10e-6), rel=0.1)


def test_injection_is_between_before_and_after() -> None:
    plant = levitated(nominal(SPINDLE_RIG))
    for name, value in (("axis", plant.axes.index("v2")), ("amplitude", 0.05), ("hz", 80), ("lines", 3), ("step", 40)):
        plant.set(f"inject.{name}", value)
    readings = plant.run(5000, 1)[1]
    told = dict(zip(plant.trace_channels, readings.T, strict=True))
    assert told["after"] - told["before"] == pytest.approx(told["inject"], abs=1e-12)
    spectrum = np.abs(np.fft.rfft(told["inject"])) * 2 / len(readings)
    lines = np.flatnonzero(spectrum > 0.04) / 0.5
    assert lines.tolist() == [80, 120, 160]


def test_parameters_by_name() -> None:
    plant = plant_of(truth(SPINDLE_RIG))
    plant.set("bias.upper", 1.5)
    plant.set("kp.u2", 7.0)
    assert [plant.get(f"bias.{b}") for b in ("lower", "upper")] == [pytest.approx(0.4 * 5.4), 1.5]
    assert plant.get("kp.u2") == 7.0
    assert plant.get("kp.u1") != 7.0
    for unknown in ("kp", "ref.u9", "bias.left", "inject.phase", "map"):
        with pytest.raises(KeyError):
            plant.set(unknown, 1.0)


def test_landing_and_lifting_again() -> None:
    plant = levitated(truth(SPINDLE_RIG), 0.1)
    plant.mode = core.LAND
    rows = plant.run(12000)
    assert plant.moved
    assert column(plant, rows, "amp_u1_p")[-1] == pytest.approx(0, abs=0.02)
    assert column(plant, rows, "status.contact.axial")[-1] == 1
    plant.mode = core.READY
    plant.run(100)
    plant.mode = core.LIFT
    plant.run(10100)
    plant.mode = core.LEVITATE
    plant.run(2000)
    assert plant.trips == 0


def spun(plant: TwinPlant, speed: float) -> Any:
    s = plant.state()["s"]
    s[11] = speed
    plant.set_state(s)
    plant.drive(DriveLaw(5.0, 100.0, 1e6), speed)
    plant.run(5000)
    return plant.run(10000)


def test_unbalance_and_a_weight_show_at_speed() -> None:
    plant = levitated(nominal(SPINDLE_RIG), 0.1)
    before = np.ptp(column(plant, spun(plant, 300.0), "pos_u2"))
    plant.weights(0, 5e-5, 0.3)
    heavier = np.ptp(column(plant, spun(plant, 300.0), "pos_u2"))
    plant.without_weights(0)
    after = np.ptp(column(plant, spun(plant, 300.0), "pos_u2"))
    assert heavier > 3 * before
    assert after == pytest.approx(before, rel=0.05)


def lost(t: Any) -> bool:
    return bool(levitated(t, 0.5).trips & 1)


@pytest.mark.parametrize(
    "defect", [{"probe_sign__yl": -1.0}, {"exchange_coils__yr": 1.0}, {"exchange_probes__xl__yl": 1.0}]
)
def test_miswired_it_is_lost(defect: dict[str, float]) -> None:
    assert not lost(truth(STAND_RIG))
    assert lost(truth(STAND_RIG, **defect))


def test_exchanged_where_it_is_told_alone() -> None:
    right, wrong = (
        levitated(truth(STAND_RIG, **d)).run(100)[-1] for d in ({}, {"told_coils__yl": 1.0, "told_probes__xl__xr": 1.0})
    )
    names = plant_of(truth(STAND_RIG)).channels
    a, b = (dict(zip(names, row.tolist(), strict=True)) for row in (right, wrong))
    assert (a["amp_yl_p"], a["amp_yl_n"]) == (b["amp_yl_n"], b["amp_yl_p"])
    assert (a["pos_xl"], a["pos_xr"]) == (b["pos_xr"], b["pos_xl"])
    assert (a["pos_yl"], a["amp_yr_p"]) == (b["pos_yl"], b["amp_yr_p"])


def test_pulses_missing_doubled_and_ended() -> None:
    def counted(**defects: float) -> float:
        plant = levitated(nominal(SPINDLE_RIG, **defects), 0.1)
        rows = spun(plant, 200.0)
        return float(np.ptp(column(plant, rows, "count")))

    turns = 200.0 / (2 * math.pi)
    assert counted() == pytest.approx(turns, abs=1)
    assert counted(pulse_missing=4.0) == pytest.approx(turns * 3 / 4, abs=1)
    assert counted(pulse_doubled=1.0) == pytest.approx(2 * turns, abs=2)
    assert counted(pulse_last=3.0) == 0


def test_contact_is_told_or_kept_silent() -> None:
    for defects, told in (({}, 1.0), ({"contact_silent": 1.0}, 0.0)):
        plant = plant_of(truth(SPINDLE_RIG, **defects))
        assert column(plant, plant.run(3000), "status.contact.axial")[-1] == told


def test_runout_is_seen_by_every_probe_of_a_journal_in_turn() -> None:
    """Orders 1 and 2 alone. The speed counts clockwise, so that a spot of the journal comes from v2 at 165 degrees to u2 at
    75: what v2 reads, u2 reads a quarter turn later."""
    t = truth(SPINDLE_RIG, runout_3__u2=0.0, runout_4__u2=0.0)
    turn = np.linspace(0, 2 * math.pi, 73)

    def reads(k: int, angle: np.ndarray[Any, Any]) -> Any:
        c, s = (np.array(x).reshape(4, 16)[:, k] for x in (t.plant.runout_c, t.plant.runout_s))
        return sum(c[n - 1] * np.cos(n * angle) + s[n - 1] * np.sin(n * angle) for n in (1, 2))

    later = t.values["probes.v2.direction"] - t.values["probes.u2.direction"]
    assert later == pytest.approx(math.pi / 2, abs=0.02)
    assert reads(2, turn + later) == pytest.approx(reads(3, turn), abs=1e-12)


def test_a_lift_begins_with_the_current_that_carries_the_weight() -> None:
    t = nominal(STAND_RIG)
    plant, p = plant_of(t), t.plant
    plant.run(3000)
    plant.mode = core.READY
    plant.run(100)
    plant.mode = core.LIFT
    row = plant.run(50, 1)[1][-1]
    bias = plant.get("bias.rechts")
    i = 0.6 * 8.0 * 9.81175 * p.gap[3] ** 2 / (4 * p.beta[3] * bias)
    assert row[plant.trace_channels.index("amp_yr_p")] - bias == pytest.approx(i, rel=0.1)


def test_hum_is_no_motion() -> None:
    plant = levitated(nominal(STAND_RIG, hum=2e-6, hum_hz=50.0, hum_probe=2.0), 0.1)
    assert plant.params.hum[:4] == (0.0, 2e-6, 0.0, 0.0)
    reads = plant.run(2000, 1)[1][:, 1]
    assert np.abs(np.fft.rfft(reads))[10] * 2 / 2000 > 0.5e-6


def test_a_shaft_that_bends_is_held_with_notch_filters() -> None:
    """The shipped stand at 650 and 1240 Hz, its probes beyond a node; without the filters it is lost."""
    text = (ROOT / "rigs/amb5dof.toml").read_text(encoding="utf-8").replace('machine = "amb5dof"', 'machine = "twin"')
    t = truth(RigFile.parse(text, (ROOT / "rigs/amb5dof.dbc").read_text(encoding="utf-8"), "bending.toml"))
    assert levitated(t, 0.3).trips == 0
    bare = dataclasses.replace(t.plant, control=dataclasses.replace(t.plant.control, notch=(0.0,) * 6))
    assert lost(dataclasses.replace(t, plant=bare))
