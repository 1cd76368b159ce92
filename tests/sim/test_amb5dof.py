"""The AMB stand as the rig file has it: what is drawn, what follows from it, and what its telemetry says."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import check_rig
from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.machine import Truth
from sim_backend.machines.amb5dof import linear, machine
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import CHANNELS, AmbPlant
from sim_backend.machines.table import machine_of
from sim_backend.truth import draw, nominal

OWN = {"watchdog_s", "landing_speed"}  # of the interface, not of the laws
OF_THE_RIG = {"notch1_hz", "notch1_q", "notch2_hz", "notch2_q", "lift_time_s"}  # other than the core's defaults
NOT_OF_THE_PLANT = {"geometry.com_to_inboard_amb", "drive_gain", "drive_limit", "drive_ramp",
                    "geometry.balance_radius"}  # fmt: skip


@cache
def rig() -> RigFile:
    return load_rig("amb5dof")


@cache
def thesis() -> Truth:
    return draw(rig(), 0, nominal(rig()))


def test_the_rig_file_has_no_problems_and_names_its_machine() -> None:
    problems, load = check_rig("amb5dof")
    assert problems == ()
    assert load is not None
    assert load.total < 0.3
    assert machine_of(rig()).name == "amb5dof"


def test_the_nominal_machine_is_that_of_the_thesis() -> None:
    """T Tables 2.1 to 2.3, with the magnetic offset's sign that goes with g_y below zero."""
    p, q = thesis().plant, thesis().quantities
    same = ("mass", "inertia", "polar_inertia", "l_ia", "l_oa", "l_is", "l_os", "l_c", "coupling", "gap", "gap_x", "beta",
            "offset", "clearance", "mode_hz", "amplifier_rate", "u_max", "coil_limit")  # fmt: skip
    for name in same:
        assert getattr(p, name) == pytest.approx(getattr(AmbParams(), name), rel=1e-12), name
    assert (p.gravity_y, p.gravity_z) == pytest.approx((-9.81175 / math.sqrt(2),) * 2)
    assert q["beta_yi"] == pytest.approx(6.95e-7)
    assert q["offset_zo"] == pytest.approx(115e-6)
    assert q["eccentricity"] == pytest.approx(2 * 3e-6 / 0.98)


def test_every_number_of_the_rig_file_is_drawn_once_for_each_axis_and_has_an_effect() -> None:
    truth, again, other = draw(rig(), 3), draw(rig(), 3), draw(rig(), 4)
    assert truth.plant == again.plant
    free = {name for name, t in machine.stated(rig()).items() if t.standard_uncertainty > 0}
    assert {name for name in free if truth.values[name] == other.values[name]} == set()
    assert len({truth.values[f"beta_{axis}"] for axis in machine.RADIAL}) == 4
    assert not set(machine.SHARED) - set(rig().simulation)
    for name in free - NOT_OF_THE_PLANT:
        changed = machine.params({**truth.values, name: truth.values[name] + 1e-6}, truth.defects)
        assert changed != truth.plant, name


def test_offsets_are_those_between_the_magnetic_centre_and_the_sensors_zero() -> None:
    """Both sensor planes read zero where the shaft stands 2 um low inboard and 4 um high outboard."""
    zero = {f"pos_{a}.gain": 1.0 for a in ("yi", "yo")} | {"pos_yi.offset": 2e-6, "pos_yo.offset": -4e-6}
    q = draw(rig(), 0, {**nominal(rig()), **zero}).quantities
    p = thesis().plant
    slope = 6e-6 / (p.l_is + p.l_os)
    assert q["offset_yi"] == pytest.approx(115e-6 - 2e-6 - slope * (p.l_ia - p.l_is), abs=1e-12)
    assert q["offset_yo"] == pytest.approx(115e-6 + 4e-6 - slope * (p.l_os - p.l_oa), abs=1e-12)
    assert q["offset_zi"] == pytest.approx(115e-6, abs=1e-12)


def test_parameters_of_the_rig_file_are_those_of_the_laws() -> None:
    laws = {f.name: f.default for f in dataclasses.fields(AmbControl)}
    stated = {name: p.default for name, p in rig().parameters.items()}
    assert stated.keys() - OWN == laws.keys()
    for name in laws.keys() - OF_THE_RIG:
        assert stated[name] == pytest.approx(laws[name], rel=1e-5), name


@pytest.mark.parametrize("law", linear.LAWS)
def test_the_linearised_loop_is_the_core_near_the_centre(law: str) -> None:
    """Two shafts, one 0.1 um and 1 urad aside: what lies between them over 40 ms, against powers of the matrix."""
    quiet = {"position_noise": 0.0, "current_noise": 0.0, "position_lsb": 0.0, "current_lsb": 0.0, "mode_on": (0.0, 0.0),
             "runout": (0.0,) * 16, "position_gain": (0.99, 1.01, 1.01, 0.99, 1.0)}  # fmt: skip
    p = dataclasses.replace(thesis().plant, **quiet)
    settings = {name: q.default for name, q in rig().parameters.items()}
    paths = []
    for aside in (np.zeros(2), np.array([1e-7, 1e-6])):
        plant = AmbPlant(p, 1, control=AmbControl(law=linear.LAWS.index(law)))
        for name in OF_THE_RIG:
            plant.set(name, settings[name])
        for mode, ticks in ((READY, 100), (LIFT, 12000), (LEVITATE, 30000)):
            plant.mode = mode
            plant.run(ticks)
        s = plant.state()["s"]
        s[[1, 4]] += aside
        plant.set_state(s)
        path = []
        for _ in range(400):
            plant.run(1)
            path.append(plant.state()["s"][[1, 4]])
        paths.append(np.array(path))
    a, x = linear.matrix(p, settings, law), np.zeros(linear.SIZE)
    x[0:2] = 1e-7, 1e-6
    expected = []
    for _ in range(400):
        x = a @ x
        expected.append(x[:2].copy())
    error = np.abs(paths[1] - paths[0] - np.array(expected)).max(axis=0)
    assert (error < 0.01 * np.array([1e-7, 1e-6])).all(), error


def test_damping_is_that_of_the_eigenvalues() -> None:
    """Without filters and lags the flatness laws place k1 and k2 (T 2.16): 61.6 Hz, and damping k2 / (2 sqrt k1)."""
    q = thesis().quantities
    assert [q[f"frequency_{law}"] for law in linear.LAWS] == pytest.approx([70, 67, 66], abs=2)
    fast = dataclasses.replace(thesis().plant, amplifier_rate=1e5)
    settings = {name: p.default for name, p in rig().parameters.items()}
    settings |= {"notch1_hz": 0.0, "notch2_hz": 0.0, "derivative_hz": 1e5, "k0": 0.0}
    for law, k2 in (("ccs", 300), ("cac", 250)):
        hz, damping = linear.slowest(fast, settings, law)
        assert hz == pytest.approx(math.sqrt(1.5e5) / (2 * math.pi), rel=0.05)
        assert damping == pytest.approx(k2 / (2 * math.sqrt(1.5e5)), abs=0.06)  # two ticks of delay are left


def test_telemetry_wraps_and_leaves_room_for_the_watchdogs_bit() -> None:
    at = {"angle": 0, "pulses": 1, "flags": 2}
    values = np.array([[2 * math.pi * 7 + 0.5, 65537.0, 63.0], [-4.0, 3.0, 16.0]])
    machine.spoil(values, at, thesis().defects)
    assert values[:, 0] == pytest.approx([0.5, 2 * math.pi - 4.0])
    assert values[:, 1].tolist() == [1, 3]
    assert values[:, 2].tolist() == [0b1101111, 0b100000]


def test_places_follow_the_signals_and_planted_signs() -> None:
    signals = [s.name for s in rig().messages["Telemetry"].signals[2:]]
    at = {name: k for k, name in enumerate(signals)}
    told, goes = machine.places(thesis().defects, at)
    assert [CHANNELS[k] for k in told] == [signals[k] for k in goes]
    assert set(signals) - {CHANNELS[k] for k in told} == {
        *("supply", "temp_i", "temp_o", "temp_x", "state", "fault", "host_age")
    }
    _, wrong = machine.places({**thesis().defects, "current_sign_o": -1.0}, at)
    exchanged = {signals[a] for a, b in zip(goes, wrong, strict=True) if a != b}
    assert exchanged == {"i_yo_p", "i_yo_n", "i_zo_p", "i_zo_n"}
