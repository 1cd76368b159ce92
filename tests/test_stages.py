"""A rig file of a machine that does not levitate: its axes, and every way in which they lead nowhere."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from test_rigfile import changed

from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import problems_of
from bench.rigfile.protection import of_channels
from bench.rigfile.stage import axes_of, is_stage

RIGS = Path(__file__).resolve().parents[1] / "rigs"
TOML, DBC = (RIGS / "rlsrm.toml").read_text("utf-8"), (RIGS / "rlsrm.dbc").read_text("utf-8")


def said(*changes: tuple[str, str]) -> list[str]:
    return [str(p).removeprefix("rig.toml: ") for p in problems_of(RigFile.parse(changed(TOML, *changes), DBC))]


def test_axes_are_what_the_encoders_say() -> None:
    rig = load_rig("rlsrm")
    assert is_stage(rig)
    assert not is_stage(load_rig("lira"))
    axes = axes_of(rig)
    assert [*axes] == ["x", "angle"]
    assert [(a.measures, a.unit, a.force) for a in axes.values()] == [("stroke", "m", "N"), ("angle", "rad", "N m")]
    assert (axes["x"].low, axes["x"].high) == (-0.0135, 0.0135)
    pitch = axes["angle"].pitch
    assert pitch is not None
    assert pitch.value == pytest.approx(2 * math.pi / 2500, rel=1e-12)
    assert axes_of(load_rig("tsbs12")) == {}


def test_a_pitch_is_that_of_the_counts_of_a_turn() -> None:
    line = next(line for line in TOML.splitlines() if line.startswith("pitch") and "0.144" in line)
    text = changed(TOML, (line + "\n", ""))
    pitch = axes_of(RigFile.parse(text, DBC))["angle"].pitch
    assert pitch is not None
    assert (pitch.value, pitch.half_width) == (pytest.approx(2 * math.pi / 2500), 0)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('reference = "x_ref"', 'reference = "x_rev"',
         "capabilities.positioning.axes.x.reference: found 'x_rev'; expected a channel of this file, such as x_ref"),
        ('asked = "force_asked"', 'asked = "torque_given"',
         "capabilities.positioning.axes.x.asked: found torque_given, in N m; expected a channel in N"),
        ('target = "x_target"', 'target = "kp_x"',
         "capabilities.positioning.axes.x.target: found kp_x, in N/m; expected a parameter in m"),
        ('limit = "limit_x"', 'limit = "limit_y"',
         "capabilities.positioning.axes.x.limit: found 'limit_y'; expected a parameter of this file, such as limit_x"),
        ('kind = "x_wave", off = 0, sine = 1, square = 2', 'kind = "x_wave", off = 0, sine = 2, square = 2',
         "capabilities.positioning.axes.x.wave: found off = 0, sine = 2, square = 2; expected a value of its own for each"),
        ('kind = "x_wave", off = 0, sine = 1, square = 2', 'kind = "x_wave", off = 0, sine = 3',
         "capabilities.positioning.axes.x.wave.sine: found 3; expected 0 to 2, the range of x_wave"),
        ('kind = "x_wave", off = 0, sine = 1, square = 2', 'kind = "x_wave", off = 0',
         "capabilities.positioning.axes.x.wave: found off alone; expected the value of `sine` or of `square`, or no such "
         "table"),
        ("[capabilities.positioning.axes.x]", "[capabilities.positioning.axes.along]",
         "capabilities.positioning.axes.along: found along; expected an encoder of this file, such as angle"),
        ('homed = { channel = "flags"', 'homed = { channel = "flag"',
         "capabilities.positioning.homed: found 'flag'; expected a channel of this file, such as flags"),
        ("phases = { A1 = 0, B1 = 1", "phases = { A1 = 0, B1 = 0",
         "capabilities.phase_test.phases.B1: found 0; expected a value of its own: it is that of A1"),
        ('pitch = { value = 1, unit = "um"', 'pitch = { value = 1, unit = "deg"',
         "encoders.x.pitch: found a number in rad; expected a unit of the kind of m"),
        ('about = "place along by the linear encoder", protect = { low = -14.5e-3, high = 14.5e-3, when = "held" }',
         'about = "place along", unprotected = "somebody forgot"',
         'channels.x.protect: found nothing, though x is moved; expected low and high, in SI; of a stroke with when = "held", '
         "as it is known then"),
    ],
)  # fmt: skip
def test_what_leads_nowhere_is_told_with_its_place(old: str, new: str, problem: str) -> None:
    assert problem in said((old, new))


def test_states_and_commands_are_those_of_a_stage() -> None:
    """Nothing of it lands or levitates; what it cannot do without is its own."""
    rig = RigFile.parse(TOML, DBC.replace('"HOLDING"', '"KEEPING"'))
    found = [str(p) for p in problems_of(rig)]
    assert any("states.KEEPING: found nothing" in line and "HOLDING" in line for line in found)
    rig = RigFile.parse(TOML, DBC.replace('"LET_GO"', '"DROP"'))
    assert any("commands.LET_GO" in str(p) for p in problems_of(rig))


def test_a_stage_of_strokes_alone_has_no_speed_of_rotation_to_watch() -> None:
    """One axis along, in a motor that gives force alone; around, or with a motor that gives torque, the speed is asked for."""
    angle = TOML[TOML.index("[encoders.angle]") : TOML.index("# Weights pull along")]
    speed = next(line for line in TOML.splitlines() if line.startswith("speed = { signal"))
    forces = ('gives = ["torque", "axial force"]', 'gives = ["axial force"]')
    told = "mark.speed: found nothing; expected the channel that tells the speed: the bench watches it while the machine moves"
    assert told not in said((angle, ""), (speed, ""), forces, forces)
    assert told in said((angle, ""), (speed, ""))
    assert told in said((speed, ""), forces, forces)


def test_its_stroke_is_protected_while_it_is_held() -> None:
    limits = {p.name: p for p in of_channels(load_rig("rlsrm"))}
    assert (limits["x"].low, limits["x"].high, limits["x"].held) == (-14.5e-3, 14.5e-3, True)
    assert not limits["v"].held
