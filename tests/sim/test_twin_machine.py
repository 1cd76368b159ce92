"""What is drawn for a rig's twin and by which rules, what is refused, its true quantities, and who works on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from twin_rigs import (
    HUNG,
    ONE_AXIS,
    ROOT,
    SPINDLE,
    STAND,
    THREES,
    TOP,
    bearing,
    levitated,
    nominal,
    number,
    plant_of,
    probe,
    rig,
    shipped,
    thrust,
    truth,
)

from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.controller.controls import controls
from sim_backend.machines.table import machine_of
from sim_backend.machines.twin.machine import twin
from sim_backend.machines.twin.operator import Fitter
from sim_backend.truth import draw

SPINDLE_RIG, STAND_RIG = rig("spindle", SPINDLE), rig("stand", STAND)


def test_the_rig_file_chooses_it() -> None:
    r = shipped()
    machine = machine_of(r)
    assert machine.name == "twin"
    assert machine is twin(r)  # one of a rig file, and made once
    t = draw(r, 3)
    assert t.plant.names.axes == ("yi", "zi", "yo", "zo", "x")
    assert t.quantities["beta@yo"] == t.values["beta.yo"]


def test_numbers_keep_their_identity() -> None:
    r = shipped()
    stated = machine_of(r).stated(r)
    assert stated["geometry.amb_span"] is r.geometry["amb_span"]
    assert stated["site.gravity"] is r.site.gravity
    assert stated["pos_zo.offset"] is r.sensors["pos_zo"].offset
    assert stated["i_x_n.gain"] is r.sensors["i_x_n"].gain
    assert stated["beta.x"] is r.simulation["beta_x"]
    assert stated["beta.zi"] is r.simulation["beta"]
    assert "sensors.i_yi_p.gain" not in stated


def test_what_is_set_for_all_axes_is_not_the_axial_ones_offset() -> None:
    p = nominal(shipped()).plant
    assert p.offset[:4] == pytest.approx((1.15e-4,) * 4)
    assert p.offset_x == 0.0
    assert p.control.hold[4] == pytest.approx(0.0, abs=1e-9)


def test_places_follow_from_what_is_drawn() -> None:
    """The inboard AMB of the shipped stand is told from the outboard one by the certified span."""
    r = shipped()
    one, other = (truth(r, geometry__amb_span=span).plant for span in (0.178, 0.180))
    s = [np.array(p.axis).reshape(8, 16)[2:4, :2] for p in (one, other)]
    assert np.hypot(*s[1]) - np.hypot(*s[0]) == pytest.approx([2e-3, 2e-3])


def test_what_is_left_open_follows_the_rules() -> None:
    """8 kg at 150 and 100 mm: the lever rule gives 0.6 of the weight to the right bearing; 6 times that at 5.4 A and 0.4 mm."""
    stated = twin(STAND_RIG).stated(STAND_RIG)
    weight = 8.0 * 9.81175
    assert stated["beta.yr"].value == pytest.approx(6 * 0.6 * weight * (0.4e-3 / 5.4) ** 2)
    assert stated["inductance.yr"].value == pytest.approx(2 * stated["beta.yr"].value / 0.4e-3)
    length, radius = 0.28, math.sqrt(8.0 / (math.pi * 7850 * 0.28))  # from the left bearing to the right probes
    assert stated["transverse_inertia"].value == pytest.approx(8.0 * (3 * radius**2 + length**2) / 12)
    assert stated["polar_inertia"].value == pytest.approx(8.0 * radius**2 / 2)
    assert stated["unbalance.links"].value == pytest.approx(0.75 * 8.0 * 2.5e-3 / 2000 / 2)
    assert stated["position_range"].value == pytest.approx(2.5 * 0.4 * 0.4e-3)  # no axial bearing
    assert stated["current_noise"].value == pytest.approx(5.4 / 1500)


def test_gains_by_the_rule() -> None:
    """One axis of 2 kg, one coil: i = sqrt(m g/beta) g, K_i = 2 m g/i, K_x = 2 m g/gap."""
    p = nominal(rig("one", ONE_AXIS)).plant
    weight, c = 2.0 * 9.81175, p.control
    i = 5e-4 * math.sqrt(weight / p.beta[0])
    assert c.bias[0] == pytest.approx(i)
    w = 0.25 / (1.5e-4 + 1 / (2 * math.pi * 1000) + 1 / (2 * math.pi * 2000))
    room = math.sqrt((2 * i * 2 * weight / i / 2e-4 - 2 * weight / 5e-4) / 2.0)
    w = min(w, room)
    assert c.kp[0] == pytest.approx((2.0 * w**2 + 2 * weight / 5e-4) / (2 * weight / i))
    assert c.kd[0] == pytest.approx(2 * 0.6 * 2.0 * w / (2 * weight / i))


def test_simulation_sets_one_axis_or_all() -> None:
    table = (
        '[simulation]\nbeta = 5e-6\nbeta_yr = 9e-6\nbias = 2.0\nmagnetic_offset = { value = 10, unit = "um", u = 1, '
    )
    table += 'distribution = "normal", source = "test" }\n[simulation.kp]\nxl = 12345.0\n'
    r = rig("set", (*STAND, table))
    t = nominal(r)
    assert t.plant.beta[:4] == (5e-6, 5e-6, 5e-6, 9e-6)
    assert t.plant.offset[:4] == pytest.approx((1e-5,) * 4)
    assert t.plant.control.bias == (2.0,) * 4
    assert t.plant.control.kp[0] == 12345.0
    drawn = truth(r, 5).plant.offset[:4]
    assert len({*drawn}) == 4


def test_what_a_map_of_probes_sees_is_what_the_bearings_hold() -> None:
    """Five probes in three planes, six axes in two, at any angle: the map is a left inverse."""
    p = nominal(rig("threes", THREES)).plant
    axes = np.array(p.axis).reshape(8, 16)[:4].T[:6]
    probes = np.array(p.probe).reshape(8, 16)[:4].T[:5]
    table = np.array(p.control.map).reshape(16, 16)[:5, :6].T
    assert table @ probes == pytest.approx(axes, abs=1e-9)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ((STAND[0], *STAND[2:]), "shaft.mass: found nothing"),
        (STAND[:4] + STAND[5:6], "probes: found none that see"),
        ((*STAND[:2], bearing("a", -50, {"p": 0}), bearing("b", 50, {"q": 0}), *STAND[4:]), "hold 2 of the four"),
        (('[shaft]\nfar_end = "f"\ntilt = ' + number(90, "deg"), *ONE_AXIS[1:]), "axes.y.coils: found one"),
        ((*STAND[:3], bearing("rechts", 100, {"xr": 90, "yl": 0}), *STAND[4:]), "the name of an axis of links too"),
        ((*STAND, "[simulation]\nbias = 0.2"), "with a bias of 0.2 A"),
        ((*STAND, '[motors.m]\nkind = "x"\ngives = ["torque", "radial force"]'), "motors: found one that gives force"),
        ((*STAND, *(probe(f"n{k}", k, 0) for k in range(13))), "probes: found 17; expected at most 16"),
    ],
)  # fmt: skip
def test_what_no_twin_can_be_made_of_is_refused_by_name(parts: tuple[str, ...], told: str) -> None:
    r = rig("refused", parts)
    with pytest.raises(ConfigError, match=told.replace(".", r"\.")):
        twin(r).params({n: t.value for n, t in twin(r).stated(r).items()}, twin(r).defects)


def test_an_axis_is_injected_into_by_the_plants_own_number() -> None:
    """The axial bearing stands first in the file, and last in the plant."""
    units = {"Inject": "1", "A": "A", "F": "Hz"}
    table = [
        f'{n} = {{ index = {k}, unit = "{u}", default = 0, low = 0, high = 9 }}'
        for k, (n, u) in enumerate(units.items())
    ]
    injection = 'axis = "Inject"\namplitude = "A"\nhz = "F"\noff = 0\naxes = { w = 1, yr = 2 }'
    bound = "\n".join(["[parameters]", *table, "[capabilities.injection]", injection])
    r = rig("first", (STAND[0], STAND[1], thrust(), *STAND[2:], probe("w"), bound))
    names = plant_of(truth(r)).axes
    (chosen,) = controls(r, twin(r))["Inject"]
    assert (names[int(chosen.of(1))], names[int(chosen.of(2))], chosen.of(0)) == ("w", "yr", -1.0)


def test_true_quantities() -> None:
    q = nominal(SPINDLE_RIG).quantities
    p = nominal(SPINDLE_RIG).plant
    b = 0.4 * 5.4
    assert q["K_i@u1"] == pytest.approx(4 * p.beta[0] * b / 5e-4**2)
    assert q["K_x@w"] == pytest.approx(4 * p.beta_x * b**2 / 6e-4**3)
    assert {"offset@v2", "unbalance@disc", "unbalance_phase@nut", "eccentricity"} <= {*q}


def test_offsets_are_where_the_probes_read_zero() -> None:
    """By the plant itself: held where the probes read zero, the true shaft is so far from the magnetic centres."""
    t = nominal(STAND_RIG, magnetic_offset__yl=3e-5, pos_yl__offset=1e-5, pos_xr__gain=1.02, pos_xr__offset=-4e-6)
    plant = levitated(t, 3.0)
    s = plant.state()["s"][1:5]
    rows = np.array(t.plant.axis).reshape(8, 16)[:4].T[:4]
    found = rows @ s + np.array(t.plant.offset[:4])
    assert found == pytest.approx([t.quantities[f"offset@{a}"] for a in t.plant.names.axes], abs=2e-8)
    assert t.quantities["offset@yl"] == pytest.approx(3e-5 - 1e-5 * 280 / 250)


HOOKED: RigFile = rig("hooked", (*STAND, *HUNG), hung=2.0, top=TOP)


def at_work(r: RigFile, **changes: float) -> tuple[Fitter, object]:
    t = nominal(r, **changes)
    plant = plant_of(t)
    return Fitter(r, plant, t), plant


def hung(line: str) -> list[float]:
    fitter, plant = at_work(HOOKED)
    assert fitter.request(line).startswith("ok")
    plant.run(5000)  # type: ignore[attr-defined]
    return list(plant._s.load)  # type: ignore[attr-defined]


def test_masses_hang_down_or_pull_over_a_pulley() -> None:
    """0.6 kg with its hanger, in air; the side pull at 50 mm leaves 98 % of it at 61.5 degrees."""
    newtons = 0.6 * (1 - 1.2 / 8000) / (1 - 1.2 / 8000) * 9.81175 * (1 - 1.11 / 8000)
    down = hung("hang M1")
    assert down[:5] == pytest.approx([0, -newtons, 0, 0, 0], abs=1e-9)
    side, angle = hung("hang side M1"), math.radians(61.5)
    fy, fz = (0.98 * newtons * f(angle) for f in (math.cos, math.sin))
    assert side[:5] == pytest.approx([0, fy, fz, -0.05 * fz, 0.05 * fy], rel=1e-9)
    assert hung("hang -")[1] == pytest.approx(-newtons / 6)


def test_masses_whose_names_have_spaces() -> None:
    """As a laboratory calls its weights; the shorter name is not taken for the longer one."""
    other = '[masses]\n"0.5 kg" = ' + number(0.5, "kg") + '\n"0.5 kg red" = ' + number(0.7, "kg")
    r = rig("spaced", (*STAND, other, *HUNG[1:]), hung=2.0, top=TOP)
    fitter, plant = at_work(r)
    loads = []
    for line in ("hang 0.5 kg", "hang 0.5 kg red", "hang side 0.5 kg", "hang side -"):
        assert fitter.request(line).startswith("ok"), line
        plant.run(5000)  # type: ignore[attr-defined]
        loads.append(math.hypot(*plant._s.load[1:3]))  # type: ignore[attr-defined]
    assert np.array(loads) / loads[0] == pytest.approx([1, 0.8 / 0.6, 0.98, 0.98 * 0.1 / 0.6])
    assert fitter.request("hang 0.5 lb") == "error cannot 'hang 0.5 lb'"


def test_weights_are_fixed_on_the_planes_own_scale() -> None:
    """The disc's scale begins 20 degrees on from the mark and runs backwards: 30 degrees on it are 20 - 30 from the mark in the
    direction of rotation, which here is clockwise (docs/reference/angles.md)."""
    fitter, plant = at_work(SPINDLE_RIG)
    assert fitter.request(f"attach disc 1e-3 {math.radians(30)!r}").startswith("ok")
    s = plant._s  # type: ignore[attr-defined]
    assert math.degrees(math.atan2(s.weight_s[0], s.weight_c[0])) == pytest.approx(-10)
    assert math.hypot(s.weight_c[0], s.weight_s[0]) == pytest.approx(1e-3 * 0.03)
    fitter.request("detach disc")
    assert s.weight_c[0] == s.weight_s[0] == 0
    assert fitter.request("attach rim 1e-3 0").startswith("error cannot")


def test_the_shaft_is_turned_by_hand() -> None:
    """To 90 degrees after the mark, which the spindle tells at 40 degrees, clockwise from above."""
    fitter, plant = at_work(SPINDLE_RIG)
    assert fitter.request("turn 90").startswith("ok")
    at = math.degrees(plant.state()["s"][5])  # type: ignore[attr-defined]
    assert at == pytest.approx(90 - 40, abs=1.0)
    plant._s.s[11] = 5.0  # type: ignore[attr-defined]
    assert fitter.request("turn 0").startswith("error cannot")


@pytest.mark.parametrize(
    ("defects", "planes"),
    [({"weight_astray": 1.0}, [1]), ({"weight_lost": 1.0}, []), ({"weight_heavy": 1.0, "weight_heavy_by": 0.5}, [0])],
)
def test_weights_that_go_wrong(defects: dict[str, float], planes: list[int]) -> None:
    fitter, plant = at_work(SPINDLE_RIG, **defects)
    fitter.request("attach disc 1e-3 0")
    s = plant._s  # type: ignore[attr-defined]
    assert [k for k in range(4) if s.weight_c[k] or s.weight_s[k]] == planes
    if "weight_heavy" in defects:
        assert math.hypot(s.weight_c[0], s.weight_s[0]) == pytest.approx(1.5e-3 * 0.03)


def test_temperatures_are_those_that_the_rig_has() -> None:
    assert machine_of(shipped()).windings == {"temp_i": 0.0, "temp_o": 0.0, "temp_x": 0.0}
    assert twin(STAND_RIG).windings == {}


def test_the_core_has_the_places_that_are_told() -> None:
    """Constants that stand in two languages."""
    header = (ROOT / "sim_backend/machines/twin/twin.h").read_text(encoding="utf-8")
    for name in (
        "AT_CURRENT = 16",
        "AT_VOLTAGE = 48",
        "AT_PEAK = 80",
        "AT_ANGLE = 96",
        "AT_CONTACT_AXIAL = 112",
        "AT_NOTHING = 116",
    ):
        assert name in header
