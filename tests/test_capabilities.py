"""What a controller can be asked to do, as the rig file binds it: where it leads, and every way in which it leads nowhere."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_machine_tables import RIGS
from test_rigfile import changed, of_schema_1

from bench.rigfile import RigFile
from bench.rigfile.capabilities import is_bound, parameters_named
from bench.rigfile.check_capabilities import problems_of

SCHEMA_1 = {name: of_schema_1(toml) for name, (toml, _) in RIGS.items()}


def said(toml: str, dbc: str) -> list[str]:
    return [str(p) for p in problems_of(RigFile.parse(toml, dbc))]


@pytest.mark.parametrize("name", RIGS)
def test_the_shipped_rigs_bind_what_they_can(name: str) -> None:
    rig = RigFile.parse(*RIGS[name])
    assert said(*RIGS[name]) == []
    bound = dict(parameters_named(rig.capabilities))
    assert {"watchdog", "landing_speed", "lift_time"} <= bound.keys()
    assert set(bound.values()) <= rig.parameters.keys()


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ('slew = "slew"', 'slew = "slow"', "set_points.slew: found 'slow'",
         "a parameter of this file, such as slew"),
        ('shaft = { x = "ref_x"', 'shaft = { x = "ref_psi"', "set_points.shaft.x: found ref_psi, in rad",
         "a parameter in m"),
        ("PID = { law = 0 }", "PID = {}", "settings.law.PID: found no values",
         "the parameters that choose it, with their values"),
        ("CAC = { law = 2 }", "CAC = { law = 3 }", "settings.law.CAC.law: found 3", "0 to 2, the range of law"),
        ("axes = { yi = 0, zi = 1", "axes = { yi = 0, zj = 1", "injection.axes.zj: found zj",
         "an axis of this file: yi, zi, yo, zo, x"),
        ("axes = { yi = 0, zi = 1", "axes = { yi = 0, zi = 0", "injection.axes.zi: found 0",
         "a value of its own: it is that of yi"),
        ('bias = { inboard = "bias"', 'bias = { near = "bias"', "bias.near: found near",
         "a bearing of this file: inboard, outboard, axial"),
        ('inboard = { channel = "flags", mask = 4 }', 'inboard = { channel = "flag", mask = 4 }',
         "status.contact.inboard.channel: found 'flag'", "a channel of this file, such as flags"),
        ('inboard = { channel = "flags", mask = 4 }', 'inboard = { channel = "supply" }',
         "status.contact.inboard.channel: found supply, in V", "a channel of bits, in 1"),
        ('inboard = { channel = "flags", mask = 4 }', 'inner = { channel = "flags", mask = 4 }',
         "status.contact.inner: found inner", "a ring of this file: inboard, outboard, axial"),
        ('current_limit = { channel = "flags", mask = 1 }', 'current_limit = { channel = "flags", mask = 4 }',
         "status.current_limit: found flags, mask 4", "a bit of its own: it is that of status.contact.inboard"),
    ],
)  # fmt: skip
def test_what_leads_nowhere_is_told_with_its_place(old: str, new: str, key: str, expected: str) -> None:
    toml, dbc = RIGS["amb5dof"]
    assert said(changed(toml, (old, new)), dbc) == [f"rig.toml: capabilities.{key}; expected {expected}"]


def test_what_is_bound_is_told_by_key() -> None:
    stand, motor = (RigFile.parse(*RIGS[name]).capabilities for name in ("amb5dof", "tsbs12"))
    for key in ("set_points", "set_points.slew", "injection", "injection.lines", "path", "settings.law", "model.rate"):
        assert is_bound(stand, key)
    for key in ("angle", "motor.share", "bias", "gains.kp", "set_points.axes"):
        assert is_bound(motor, key)
    assert not any(
        is_bound(motor, key) for key in ("injection", "injection.lines", "settings.law", "model.rate", "path")
    )


def test_every_problem_is_told_at_once() -> None:
    toml, dbc = RIGS["amb5dof"]
    wrong = changed(toml, ('slew = "slew"', 'slew = "slow"'), ("CAC = { law = 2 }", "CAC = { law = 3 }"))
    assert len(said(wrong, dbc)) == 2


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_file_of_schema_1_gets_what_its_names_meant(name: str) -> None:
    _, dbc = RIGS[name]
    now, before = RigFile.parse(*RIGS[name]), RigFile.parse(SCHEMA_1[name], dbc)
    assert before.capabilities == now.capabilities
    bare = changed(SCHEMA_1[name], ("landing_speed =", "low_speed ="))
    assert RigFile.parse(bare, dbc).capabilities.landing_speed == ""


def test_a_plain_controller_of_schema_1_can_do_what_its_parameters_say() -> None:
    example = Path(__file__).resolve().parents[1] / "examples/own-controller"
    rig = RigFile.parse((example / "plainamb.toml").read_text(), (example / "plainamb.dbc").read_text())
    assert rig.capabilities.bias == {"inboard": "bias_i", "outboard": "bias_o", "axial": "bias_z"}
    assert rig.capabilities.angle is not None
    assert rig.capabilities.angle.ref == "angle_ref"
    assert not rig.capabilities.set_points.axes


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('axis = "inject_axis"\n', 'axis = "inject_axe"\n', "loop_injection.axis"),
        ('wave = "wave"\n', 'wave = "waves"\n', "loop_injection.wave"),
        ("places = { sensor = 0,", "places = { sensor = 7,", "loop_injection.places.sensor"),
        ("x2 = { value = 1,", "x2 = { value = 0,", "loop_injection.loops.x2.value"),
        ('z = { value = 4, channel = "z"', 'z = { value = 4, channel = "zz"', "loop_injection.loops.z.channel"),
        (
            'limit = "sat.r", inertia = "machine/polar_inertia"',
            'limit = "sat.r", inertia = "machine/polar"',
            "loop_injection.loops.gamma.inertia",
        ),
        ('limit = "sat.z"', 'limit = "sat.zz"', "loop_injection.loops.z.limit"),
        (
            '{ channel = "limited", mask = 16 }',
            '{ channel = "limit", mask = 16 }',
            "loop_injection.loops.z.limited.channel",
        ),
        ('held = "held"\n', 'held = "helt"\n', "hold.held"),
        ('mass = "machine/mass"\nlimit', 'mass = "machine/mas"\nlimit', "hold.mass"),
        ('x = { value = 0, positions = ["x1"', 'x = { value = 3, positions = ["x1"', "hold.axes.x.value"),
        ('currents = ["i_q_B1", "i_q_B2"], stiff', 'currents = ["y1", "i_q_B2"], stiff', "hold.axes.y.currents"),
    ],
)
def test_loops_and_holds_that_lead_nowhere(old: str, new: str, key: str) -> None:
    toml, dbc = (Path("rigs") / "lira.toml").read_text(), (Path("rigs") / "lira.dbc").read_text()
    assert toml.count(old) == 1
    found = [p.key for p in problems_of(RigFile.parse(toml.replace(old, new), dbc))]
    assert f"capabilities.{key}" in found
