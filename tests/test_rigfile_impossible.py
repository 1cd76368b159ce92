"""What no machine can be, in a rig file: bodies, angles and gaps; what two axes cannot share; what a message then says."""

from __future__ import annotations

import typing
from pathlib import Path

import pytest
from test_machine_tables import FAR
from test_rigfile import RIGS, TOML, changed, problems, written

from bench.errors import ConfigError
from bench.inputfile import TomlError, parse_toml
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.check_machine import KINDS, LIKELY, TABLES
from bench.rigfile.elements import MachineTables
from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced
from sim_backend.machines.table import machine_of
from sim_backend.unspoken import unspoken

HANDS = 'hand_angle = { value = 0, unit = "deg", half_width = 2, distribution = "rectangular", source = "by eye" }\n'


def number(value: float, unit: str, half_width: float = 0.0) -> str:
    return (
        f'{{ value = {value}, unit = "{unit}", half_width = {half_width}, distribution = "rectangular", source = "d" }}'
    )


def body(mass: str, polar: str, transverse: str, *, ends: bool = True) -> str:
    """The servomotor with a body of its own, 400 mm long."""
    stated = f"mass = {mass}\ntransverse_inertia = {transverse}\n"
    stated += f"ends = [{number(-170, 'mm')}, {number(230, 'mm')}]\n" if ends else ""
    return changed(TOML, (FAR, FAR + stated), ('polar_inertia = "machine/polar_inertia"', f"polar_inertia = {polar}"))


def numbers_of(kind: typing.Any, name: str, seen: frozenset[type] = frozenset()) -> set[str]:
    """Keys below which a number may stand, and which are what such a number is."""
    if kind is Toleranced:
        return {name}
    if isinstance(kind, type) and issubclass(kind, Part):
        fields = {} if kind in seen else kind.model_fields
        return {n for key, f in fields.items() for n in numbers_of(f.annotation, key, seen | {kind})}
    arguments = typing.get_args(kind)
    return {n for one in arguments for n in numbers_of(one, name, seen)}


def test_each_number_of_the_machine_has_a_kind() -> None:
    """One that had none would end a check, and a run, in a traceback."""
    fields = MachineTables.model_fields
    asked = {n for table in TABLES for n in numbers_of(fields[table].annotation, table)}
    assert asked >= {"hand_angle", "by", "ends", "weight_angle", "friction", "direction"}
    assert asked - KINDS.keys() == set()
    elsewhere = {table for table in fields if table not in TABLES and numbers_of(fields[table].annotation, table)}
    assert elsewhere == {"encoders"}  # which check_stages looks at


def test_how_far_a_hand_is_off_may_be_said(tmp_path: Path) -> None:
    path = written(tmp_path, changed(TOML, (FAR, FAR + HANDS)))
    assert check_rig(path)[0] == ()
    shaft = load_rig(path).shaft
    assert shaft is not None
    assert isinstance(shaft.hand_angle, Toleranced)
    found = problems(tmp_path, changed(TOML, (FAR, FAR + HANDS.replace('"deg"', '"mm"'))))
    assert [(k, p.expected) for k, p in found.items()] == [("shaft.hand_angle", "a unit of the kind of rad")]
    found = problems(tmp_path, changed(TOML, (FAR, FAR + 'hand_angle = "machine/nowhere"\n')))
    assert [*found] == ["shaft.hand_angle"]


def test_a_gap_is_as_likely_where_it_is_given_by_reference(tmp_path: Path) -> None:
    """Half a metre under a name that says nothing of a gap; told once, by the first of the bearings that have it."""
    wide = changed(TOML, ("[geometry]\n", f"[geometry]\nlichte_weite = {number(0.5, 'm')}\n")).replace(
        'gap = "geometry/amb_gap"', 'gap = "geometry/lichte_weite"'
    )
    (p,) = problems(tmp_path, wide).values()
    assert p.key == "bearings.inboard.gap"
    assert p.found == "geometry/lichte_weite, 0.5 m"
    assert p.expected == "1e-06 to 0.01 m: look at the unit"
    inline = changed(TOML, ('gap = "geometry/amb_gap"', f"gap = {number(0.5, 'm')}"))
    assert problems(tmp_path, inline)["bearings.inboard.gap"].found == "0.5 m"
    named = problems(tmp_path, changed(TOML, ("amb_gap = { value = 0.5, ", "amb_gap = { value = 500, ")))
    assert [*named] == ["geometry.amb_gap.value"]  # where the number's own place has told it already
    assert LIKELY["gap"] == (1e-6, 1e-2)


@pytest.mark.parametrize(
    ("table", "key", "found", "first"),
    [
        ('axes = { yi = "ref_yi", xi = "ref_yi", yo = "ref_yo", xo = "ref_xo" }\n', "set_points.axes.xi", "ref_yi",
         "set_points.axes.yi"),
        ('shaft = { y = "ref_yi", z = "ref_yi" }\n', "set_points.shaft.z", "ref_yi", "set_points.shaft.y"),
    ],
)  # fmt: skip
def test_no_two_axes_have_one_set_point(tmp_path: Path, table: str, key: str, found: str, first: str) -> None:
    begin = TOML.index("[capabilities.set_points]\n") + len("[capabilities.set_points]\n")
    end = TOML.index("\n[", begin)
    p = problems(tmp_path, TOML[:begin] + table + TOML[end:])[f"capabilities.{key}"]
    assert p.found == found
    assert p.expected == f"a parameter of its own: it is that of {first}"


def test_no_two_loops_and_no_two_motors_have_one_parameter(tmp_path: Path) -> None:
    """Of the motor of a rotary-linear drive; gains, limits and zeros of several loops may be one, as there."""
    toml, dbc = ((RIGS / f"lira.{kind}").read_text(encoding="utf-8") for kind in ("toml", "dbc"))
    (tmp_path / "lira.dbc").write_text(dbc, encoding="utf-8")
    text = changed(
        toml, ('set_point = "ref_x2"', 'set_point = "ref_x1"'), ('added = "step_q_R2"', 'added = "step_q_R1"')
    )
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    told = {p.key: p.expected for p in check_rig(str(tmp_path / "rig.toml"))[0]}
    loops, motors = "loop_injection.loops", "force_currents"
    own = "a parameter of its own: it is that of"
    assert told == {
        f"capabilities.{loops}.x2.set_point": f"{own} {loops}.x1.set_point",
        f"capabilities.{motors}.RA2.added": f"{own} {motors}.RA1.added",
    }


def test_several_places_may_have_one_bias_and_one_gain(tmp_path: Path) -> None:
    """One parameter for what a controller has once: the axes do not move by it."""
    begin = TOML.index("\n[capabilities]\n")
    stated = changed(TOML[begin:], ('outboard = "bias_o"', 'outboard = "bias_i"'))
    for table in ("kp", "ki", "kd"):
        stated = stated.replace(f'"{table}_o"', f'"{table}_i"')
    head = stated.index("[parameters]")
    assert "kp_o" not in stated[:head]
    assert check_rig(written(tmp_path, TOML[:begin] + stated[:head] + TOML[TOML.index("[parameters]") :]))[0] == ()


@pytest.mark.parametrize(
    ("mass", "polar", "transverse", "key", "found", "expected"),
    [
        # a thin disc has 2 I_t about its axis, no body more
        (number(5.6, "kg"), number(0.92, "kg m^2"), number(0.092, "kg m^2"), "shaft.polar_inertia", "0.92 kg m^2",
         "at most 0.184 kg m^2, twice transverse_inertia"),
        # 5.6 kg * (0.4 m)^2 + 0.019 / 2 = 0.9055 kg m^2
        (number(5.6, "kg"), number(0.019, "kg m^2"), number(9.2, "kg m^2"), "shaft.transverse_inertia", "9.2 kg m^2",
         "at most 0.9055 kg m^2, which 5.6 kg within 400 mm can have"),
        # 5.6 g * (0.4 m)^2 + 0.019 / 2 = 0.010396 kg m^2
        (number(5.6, "g"), number(0.019, "kg m^2"), number(0.092, "kg m^2"), "shaft.transverse_inertia", "0.092 kg m^2",
         "at most 0.0104 kg m^2, which 0.0056 kg within 400 mm can have"),
    ],
)  # fmt: skip
def test_no_body_has_such_inertias(
    tmp_path: Path, mass: str, polar: str, transverse: str, key: str, found: str, expected: str
) -> None:
    (p,) = problems(tmp_path, body(mass, polar, transverse)).values()
    assert p.key == key
    assert p.found == found
    assert p.expected.startswith(expected)


def test_what_a_body_may_just_be_is_taken(tmp_path: Path) -> None:
    """A thin disc, by numbers that are rounded; two masses at the ends; a body whose length nobody says."""
    disc = body(number(5.6, "kg"), number(0.1841, "kg m^2", 2e-4), number(0.092, "kg m^2"))
    assert check_rig(written(tmp_path, disc))[0] == ()
    dumbbell = body(number(5.6, "kg"), number(0.019, "kg m^2"), number(0.2335, "kg m^2"))
    assert check_rig(written(tmp_path, dumbbell))[0] == ()
    unsaid = body(number(5.6, "kg"), number(0.019, "kg m^2"), number(9.2, "kg m^2"), ends=False)
    assert check_rig(written(tmp_path, unsaid))[0] == ()


def test_an_angle_is_no_more_than_a_turn(tmp_path: Path) -> None:
    """45 degrees that were written as radians; the same by reference; 360 degrees are a turn."""
    stated = 'direction = { value = 0, unit = "deg", half_width = 0.3'
    (p,) = problems(tmp_path, changed(TOML, (stated, stated.replace('0, unit = "deg"', '45, unit = "rad"')))).values()
    assert p.key == "bearings.inboard.axes.yi.direction"
    assert p.found == "45 rad, which is 2578.31 deg"
    assert p.expected == "one turn at most, -360 to 360 deg: write deg where degrees are meant"
    by = changed(TOML, (FAR, FAR + 'hand_angle = "machine/own_angle"\n'),
                 ("[machine]\n", f"[machine]\nown_angle = {number(-45, 'rad')}\n"))  # fmt: skip
    assert problems(tmp_path, by)["shaft.hand_angle"].found == "machine/own_angle, -45 rad, which is -2578.31 deg"
    for turn in ("360", "-360"):
        whole = changed(TOML, (stated, stated.replace("value = 0", f"value = {turn}")))
        assert check_rig(written(tmp_path, whole))[0] == ()
    tilted = problems(tmp_path, changed(TOML, (FAR, FAR + f"tilt = {number(45, 'rad')}\n")))
    assert [*tilted] == ["shaft.tilt.value"]


def test_a_part_that_is_not_there_is_told_with_each_name_once(tmp_path: Path) -> None:
    at = f"{FAR}centre_of_mass = {number(0, 'mm')}\n"
    toml = changed(TOML, (FAR, at), ('["centre_of_mass", "bearings/inboard"]', '["centre_of_mass", "bearings/inbord"]'))
    p = problems(tmp_path, toml)["spans.geometry/com_to_inboard_amb"]
    assert p.expected.split(", ")[:3] == ["one of origin", "centre_of_mass", "bearings/inboard"]
    assert p.expected.count("centre_of_mass") == 1


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("[bearings.inboard]", "[bearings.arrière]", "arrière"),
        ("[bearings.inboard]", "[bearings.Ärm]", "Ärm"),
        ("[hooks]\nhook = {", "[hooks]\ncôté = {", "côté"),
        ("[hooks]\nhook = {", "[hooks]\nÖse = {", "Öse"),
    ],
)
def test_a_name_that_belongs_in_quotes_is_told_so(tmp_path: Path, old: str, new: str, name: str) -> None:
    path = written(tmp_path, changed(TOML, (old, new)))
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    hint = f'; a name with other letters than A-Z, a-z, 0-9, _ and - is put in quotes: "{name}"'
    assert str(caught.value).endswith(hint)


@pytest.mark.parametrize("text", ["x = né", "x = 5 µm", "[bearings.a b]", 'x = "né', "x = [1, é]"])
def test_nothing_else_that_is_no_toml_is_told_so(text: str) -> None:
    with pytest.raises(TomlError, match="not TOML") as caught:
        parse_toml(text)
    assert "in quotes" not in str(caught.value)


def test_a_position_that_no_probe_reads_is_told_so() -> None:
    """The twin reads positions where `[probes]` has them."""
    path = RIGS.parent / "examples/vertical-spindle/spindle"
    toml, dbc = (path.with_suffix(s).read_text(encoding="utf-8") for s in (".toml", ".dbc"))
    line = next(x for x in toml.splitlines() if x.startswith("UppV = { channel"))
    rig = RigFile.parse(changed(toml, (f"{line}\n", "")), dbc, "spindle.toml")
    channel = line.split('"')[1]
    (p,) = (p for p in unspoken(rig, machine_of(rig)) if p.key == f"channels.{channel}")
    assert p.found == "what the simulated twin has no reading for: no entry of [probes] has this channel"
    assert p.expected.startswith(
        f'[probes] with channel = "{channel}", where it reads the shaft; `{channel} = "READING"`'
    )
