"""Mistakes in a rig file or its DBC: each is named by its key with what was found and expected, alone and several at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_rigfile import DBC, TOML, changed, of_schema_1, problems, written

from bench.errors import ConfigError
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.possible import normal_gravity


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ('serial = "SIM-0001"', 'serial = "SIM-0001"\ncolour = "red"', "uut.colour", "no such key"),
        ('name = "tsbs12"', 'name = "tsbs12"\ncolour = "red"', "colour", "no such key"),
        ('serial = "SIM-0001"', "", "uut.serial", "a value"),
        ("latitude_deg = 53.527", "latitude_deg = 153.527", "site.latitude_deg", "less than or equal to 90"),
        ('unit = "A", default = 3, low = 0', 'unit = "Amp", default = 3, low = 0', "parameters.bias_i.unit", "known unit"),
        ('signal = "Telemetry.speed", unit = "rad/s"', 'signal = "Telemetry.speed", unit = "rpn"', "channels.speed.unit",
         "known unit"),
        ('signal = "Telemetry.speed", unit = "rad/s"', 'signal = "Telemetry.speed", unit = "A"', "channels.speed.unit",
         "the kind of rad/s"),
        (', source = "certificate SIM-L-102"', "", "geometry.amb_span.source", "a value"),
        ('source = "certificate SIM-L-102"', 'source = ""', "geometry.amb_span.source", "at least 1 character"),
        ('125.0, unit = "mm", u = 0.05', '125.0, unit = "mm"', "geometry.amb_span", "either u"),
        ('u = 0.05, distribution = "normal", source = "certificate SIM-L-102"',
         'u = 0.05, distribution = "rectangular", source = "x"', "geometry.amb_span", "goes with half_width"),
        ('half_width = 0.02, distribution = "rectangular", source = "groove',
         'half_width = 0, distribution = "normal", source = "groove', "hook_seat", "goes with u"),
        ('125.0, unit = "mm"', '125.0, unit = "furlong"', "geometry.amb_span.unit", "a known unit: one of 1, %"),
        ('125.0, unit = "mm"', '125.0, unit = "kg"', "geometry.amb_span.unit", "the kind of m"),
        ("125.0, unit", "nan, unit", "geometry.amb_span.value", "finite number"),
        ("amb_span =", "amb_spam =", "bearings.inboard.at.by", "a number, such as geometry/amb_spam"),
        ("amb_span =", "amb_spam =", "geometry.amb_spam", "did you mean amb_span?"),
        ("value = 125.0", "value = 140.0", "geometry.com_to_inboard_amb.value", "130 mm from centre_of_mass to"),
        ("com_to_motor = { value = 122", "com_to_motor = { value = -122", "geometry.com_to_motor.value", "a positive"),
        ("clearance = { value = 0.25", "clearance = { value = 0.6", "geometry.clearance.value", "less than geometry/amb_gap"),
        ("M4 = { value = 3.0", "M4 = { value = 30.0", "masses.M4.value", "at most envelope.max_hung_kg"),
        ("M4 = { value = 3.0", "M4 = { value = -3.0", "masses.M4.value", "a positive mass"),
        ("default = 3, low = 0, high = 5", "default = 6, low = 0, high = 5", "parameters.bias_i.default", "0 to 5"),
        ("default = 3, low = 0, high = 5", "default = 3, low = 5, high = 0", "parameters.bias_i", "low <= high"),
        ("bias_o = { index = 2", "bias_o = { index = 1", "parameters.bias_o.index", "an index of its own (bias_i)"),
        ('"Telemetry.pos_xi"', '"Telemetry.pos_xj"', "channels.pos_xi.signal", "such as Telemetry."),
        ("[devices.controller]", "[devices.controler]", "devices", "[devices.controller]"),
        ('link = "controller"', 'link = "can1"', "devices.controller.link", "one of controller"),
        ("data_bitrate = 5_000_000", "", "BO_ Telemetry", "at most 8, or data_bitrate in [links.controller]"),
        ("bitrate = 1_000_000", "bitrate = 0", "links.controller.bitrate", "greater than 0"),
        ("max_hung_kg = 3.5", "", "envelope.max_hung_kg", "a value"),
        ("ring_inertia =", "wheel_inertia =", "machine.wheel_inertia", "one of pole_pairs, polar_inertia"),
        ('value = 0.02, unit = "kg m^2"', 'value = 0.02, unit = "kg"', "machine.ring_inertia.unit", "the kind of kg m^2"),
        ("lever_left = { value = 230", "lever_left = { value = -230", "geometry.lever_left.value", "a positive number"),
        ("lever_left =", "lever_lift =", "geometry.lever_lift", "did you mean lever_left?"),
        ("[machine]", "[calibration]\ninterval = 3\n[machine]", "calibration.interval", "no such key"),
        ("[hooks]\n", '[hooks]\n"à gauche" = { at = "geometry/hook_to_outboard" }\n', "hooks.à gauche",
         "a name: a letter, then letters"),
    ],
)  # fmt: skip
def test_one_mistake_is_named_with_its_key(tmp_path: Path, old: str, new: str, key: str, expected: str) -> None:
    found = problems(tmp_path, changed(TOML, (old, new)))
    assert key in found, found
    assert expected in found[key].expected
    assert str(tmp_path) in found[key].file or found[key].file == "tsbs12.dbc"


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        (
            " SG_ pos_xi : 48|16@1-",
            " SG_ pos_xj : 48|16@1-",
            "channels.pos_xi.signal",
            "a signal of tsbs12.dbc, such as Telemetry.",
        ),
        (
            '[-0.00065536|0.00065534] "m" Host',
            '[-0.00065536|0.00065534] "thou" Host',
            "Telemetry.pos_xi",
            "a known unit",
        ),
        ('[-163.84|163.835] "rad/s" Host', '[-163.84|163.835] "A" Host', "channels.speed.unit", "the kind of A"),
        ("BO_ 16 Heartbeat:", "BO_ 16 Heartbeet:", "devices.controller.binding.heartbeat", "a message"),
        ("ParamGet: 4 Host", "ParamGet: 9 Host", "ParamGet", "a CAN FD length"),
        (" SG_ tick : 16|32", " SG_ tick : 15|32", "(file)", "a usable DBC"),
        ("BO_ 256 Telemetry: 64", "BO_ 256 Telemetry: 48", "(file)", "a usable DBC"),
        (
            'BA_ "GenMsgCycleTime" BO_ 16 20;',
            'BA_ "GenMsgCycleTime" BO_ 16 0;\nBA_ "GenMsgCycleTime" BO_ 35 0;',
            "",
            "",
        ),
    ],
)
def test_a_mistake_in_the_dbc_is_named(tmp_path: Path, old: str, new: str, key: str, expected: str) -> None:
    if not key:  # a control: a change that is no mistake is no problem
        assert check_rig(written(tmp_path, dbc=changed(DBC, (old, new))))[0] == ()
        return
    found = problems(tmp_path, dbc=changed(DBC, (old, new)))
    assert key in found, found
    assert expected in found[key].expected


def test_a_signal_that_is_two_channels_is_named_with_both(tmp_path: Path) -> None:
    """Two sensors that agree to the last bit would be one."""
    found = problems(tmp_path, changed(TOML, ('"Telemetry.i_z_n"', '"Telemetry.i_xi_p"')))
    assert list(found) == ["channels.i_z_n.signal"]
    (p,) = found.values()
    assert p.found == "Telemetry.i_xi_p, which channels.i_xi_p is bound to"
    assert p.expected == "a signal of its own for i_z_n, or one of the two"


def test_an_overfilled_bus_is_refused_with_its_load(tmp_path: Path) -> None:
    slow = changed(
        TOML, ("slcan:socket://127.0.0.1:28501", "can:socketcan:can0"), ("bitrate = 1_000_000", "bitrate = 125_000"),
        ("data_bitrate = 5_000_000", "data_bitrate = 1e6"),
    )  # fmt: skip
    found = problems(tmp_path, slow)
    # 34 bits at 125 kbit/s and 680 at 1 Mbit/s: 272 us + 680 us = 952 us a ms
    assert list(found) == ["links.controller"]
    assert "at most 90%; Telemetry takes 95%" in found["links.controller"].expected
    assert found["links.controller"].found.startswith("a bus load of ")


def test_several_mistakes_of_all_kinds_are_listed_at_once(tmp_path: Path) -> None:
    toml = changed(
        TOML,
        ('serial = "SIM-0001"', 'serial = "SIM-0001"\ncolour = "red"'),
        (', source = "certificate SIM-M-203"', ""),
        ('150.0, unit = "mm"', '150.0, unit = "furlong"'),
        ("clearance = { value = 0.25", "clearance = { value = 0.6"),
        ("M4 = { value = 3.0", "M4 = { value = 30.0"),
        ("default = 3, low = 0, high = 5", "default = 6, low = 0, high = 5"),
        ("bitrate = 1_000_000", "bitrate = 30_000"),
    )
    dbc = changed(DBC, (" SG_ pos_xi : 48|16@1-", " SG_ pos_xj : 48|16@1-"))
    found = problems(tmp_path, toml, dbc)
    assert set(found) == {
        "uut.colour", "masses.M3.source", "geometry.hook_to_outboard.unit", "geometry.clearance.value", "masses.M4.value",
        "parameters.bias_i.default", "links.controller", "links.controller.bitrate", "channels.pos_xi.signal",
    }  # fmt: skip


def test_loading_names_every_problem_in_its_message(tmp_path: Path) -> None:
    toml = changed(TOML, ('serial = "SIM-0001"', ""), ("max_hung_kg = 3.5", ""))
    with pytest.raises(ConfigError) as caught:
        load_rig(written(tmp_path, toml))
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert "uut.serial: found nothing; expected a value" in lines[1]
    assert "envelope.max_hung_kg: found nothing; expected a value" in lines[2]


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ("amb_span =", "amb_spam =", "geometry.amb_span", "AMB plane to AMB plane, with its certificate"),
        ("amb_span =", "amb_spam =", "geometry.amb_spam", "did you mean amb_span?"),
        ("value = 125.0", "value = 140.0", "geometry.amb_span.value", "within 1 mm of"),
        ("clearance = { value = 0.25", "clearance = { value = 0.6", "geometry.clearance.value", "less than amb_gap"),
    ],
)
def test_a_mistake_in_a_file_of_schema_1_has_its_old_name(
    tmp_path: Path, old: str, new: str, key: str, expected: str
) -> None:
    found = problems(tmp_path, changed(of_schema_1(TOML), (old, new)))
    assert expected in found[key].expected


def test_what_is_missing_hides_nothing_else(tmp_path: Path) -> None:
    """Tables and entries that cannot be left out are stood in for, so that one pass names every problem."""
    toml = changed(
        TOML,
        ("max_temperature_K", "max_temp_K"),
        ("model = ", "modell = "),
        ('roles = ["levitation", "rotation"]', ""),
        ("gravity = {", "gravty = {"),
        ("clearance = { value = 0.25", "clearance = { value = 0.6"),
        ("default = 3, low = 0, high = 5", "default = 6, low = 0, high = 5"),
    )
    dbc = changed(DBC, (" SG_ pos_xi : 48|16@1-", " SG_ pos_xj : 48|16@1-"))
    assert set(problems(tmp_path, toml, dbc)) == {
        "envelope.max_temp_K", "envelope.max_temperature_K", "uut.model", "uut.modell", "devices.controller.roles",
        "site.gravty", "site.gravity", "geometry.clearance.value", "parameters.bias_i.default", "channels.pos_xi.signal",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "key", "found", "expected"),
    [
        ("gravity = { value = 9.81175", "gravity = { value = 9.5", "site.gravity.value", "9.5", "9.81175"),
        ("gravity = { value = 9.81175", "gravity = { value = 0", "site.gravity.value", "0", "9.81175"),
        ("gravity = { value = 9.81175", "gravity = { value = -9.81175", "site.gravity.value", "-9.81", "9.81175"),
        ("latitude_deg = 53.527", "latitude_deg = -10", "site.gravity.value", "9.81175", "latitude -10"),
        ("elevation_m = 668", "elevation_m = 66800", "site.elevation_m", "66800", "9000"),
        ("air_density = { value = 1.11", "air_density = { value = 7950", "site.air_density.value", "7950", "1.5"),
        ("mass_density = { value = 7950", "mass_density = { value = 1.1", "mass_density.value", "1.1", "not of the air"),
        ("i_yi_p = { gain = { value = 1,", "i_yi_p = { gain = { value = 0,", "sensors.i_yi_p.gain.value", "0", "5%"),
        ("i_yi_p = { gain = { value = 1,", "i_yi_p = { gain = { value = 1.06,", "sensors.i_yi_p.gain.value", "1.06", "1 wit"),
        ("lever_left = { value = 230", "lever_left = { value = 0.023", "geometry.lever_left.value", "2.3e-05", "0.0001"),
        ("lever_left = { value = 230", "lever_left = { value = 23000", "geometry.lever_left.value", "23 m", "unit right"),
        ("amb_gap = { value = 0.5, ", "amb_gap = { value = 500, ", "geometry.amb_gap.value", "0.5 m", "unit right"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(tmp_path: Path, old: str, new: str, key: str, found: str, expected: str) -> None:
    """Gravity against place and elevation, gains and densities against what there is: nothing else is wrong then."""
    p = problems(tmp_path, changed(TOML, (old, new)))
    assert list(p) == [key]
    assert found in p[key].found
    assert expected in p[key].expected


def test_gravity_is_the_formula_of_the_rig_file() -> None:
    """Equator and pole at sea level by hand: 9.780327 and 9.780327 * 1.0053024; the free-air term is 0.3086 mGal a metre."""
    assert normal_gravity(0, 0) == pytest.approx(9.780327, rel=1e-9)
    assert normal_gravity(-90, 0) == pytest.approx(9.8321862, rel=1e-7)
    assert normal_gravity(53.527, 668) == pytest.approx(9.81175, abs=5e-6)


def test_a_sensor_that_its_certificate_corrects_is_right(tmp_path: Path) -> None:
    path = written(tmp_path, changed(TOML, ("i_yi_p = { gain = { value = 1,", "i_yi_p = { gain = { value = 1.012,")))
    assert check_rig(path)[0] == ()
