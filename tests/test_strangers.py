"""Rigs as strangers write them by the pages alone: `overhung`, whose centre of mass is beyond both bearings, with three planes
of probes of which one falls, directions from a drain plug and a heartbeat of one bit; `hanging`, which stands, with axes 60
degrees apart of which one has a coordinate's name, one axial coil, seven messages in both byte orders, no state for landing;
`slant` at 30 degrees, whose set points are the shaft's, whose status bits are signals, and whose controller tells no bias.

Of seven more only what is new: `threeplanes` of six probes with masses; `incline`, overhung and 20 degrees up; `gemischt`,
whose second bearing is turned by 45 degrees, on classic CAN with German states in cp1252 and a probe that counts backwards;
`lento`, which sends every 5 ms in mil and has nobody to push; `skewed`, standing, axes 60 degrees apart, clockwise; `suspendu`,
which hangs with its centre of mass below both bearings, in three planes of probes of which one looks 45 degrees past its axes,
with single readings every 4 ms, ticks of 16 bits and French states in latin-1; `solo`, one bearing of four axes, which no
procedure takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench import catalogue
from bench.cli.__main__ import main
from bench.cli.abilities import abilities
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.supports import radial_supports
from bench.uncertainty import interval
from procedures.amb_rotor.conventions import conventions

SHORT = {"slow_s": 6.0, "dwell_s": 1.5, "settle_s": 1.0}
FOLDER = Path(__file__).resolve().parent / "strangers"
OVERHUNG, HANGING, SLANT = (str(FOLDER / f"{name}.toml") for name in ("overhung", "hanging", "slant"))
NEW = ("threeplanes", "incline", "gemischt", "lento", "skewed", "suspendu")
ALL = pytest.mark.parametrize("path", [OVERHUNG, HANGING, SLANT], ids=["overhung", "hanging", "slant"])


@ALL
def test_nothing_is_wrong_with_the_files(path: str) -> None:
    assert check_rig(path)[0] == ()


@ALL
def test_each_procedure_says_what_it_makes_of_the_rig_once(path: str) -> None:
    found = abilities(load_rig(path))
    assert [a.procedure for a in found] == [entry.name for entry in catalogue.PROCEDURES]
    assert not any(a.problems for a in found)
    assert "step" in [a.procedure for a in found if a.able]


@pytest.mark.parametrize("name", [*NEW, "solo"])
def test_nothing_is_wrong_with_more_files(name: str) -> None:
    path = str(FOLDER / f"{name}.toml")
    assert [p.key for p in check_rig(path)[0]] == ["bearings"] * (name == "solo")
    found = abilities(load_rig(path))
    assert not any(a.problems for a in found)
    able = {a.procedure for a in found if a.able}
    if name == "solo":
        assert able == set()
        assert {line for a in found for line in a.lacking} >= {"bearings: found 1 radial; expected two"}
    else:
        assert able >= {"spindown", "step", "tracking", "unbalance", "run-up", "coast-down"}
        assert ("balance" in able) == (name not in ("threeplanes", "suspendu"))  # those have three planes of probes


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NEW)
def test_a_turning_stranger_tells_the_truth(name: str, tmp_path: Path) -> None:
    """Vectors, orbits and D_max beside what the shaft of the twin does; nothing is found wrong with it."""
    run = simulated_run("unbalance", str(FOLDER / f"{name}.toml"), 1, SHORT, tmp_path / "run.mcap")
    found = [f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    assert found == []
    truth = truth_of_motion(run)
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    off = [(e.value - truth[key]) / interval(e).U for key, e in told.items() if key in truth]
    assert len(off) >= 20
    assert sum(x * x for x in off) / len(off) < 1
    assert max(map(abs, off)) < 2


WRONG_TURNS = (
    ("axes.A135 = { direction = { value = 135,", "axes.A135 = { direction = { value = 49,", "49°, along A45"),
    ('wegB90", at = { value = 355', 'wegB90", at = { value = 555', "555 mm, beyond the shaft"),
    ('at = { value = 330, unit = "mm"', 'at = { value = 90.4, unit = "mm"', "90.4 mm, where A is"),
    ('mass = { value = 5, unit = "kg"', 'mass = { value = 5, unit = "N"', "shaft/mass in N"),
    ('bias = { A = "bias_A"', 'bias = { A = "biass_A"', "expected a parameter of this file, such as bias_A"),
    ('B0 = "sp_B0"', 'B1 = "sp_B0"', "expected an axis of this file: A45, A135, B0, B90"),
    ("max_current_A = 8\n", "", "envelope.max_current_A: found nothing"),
    ('wegB0 = { signal = "', 'wegB0x = { signal = "', "probes.B0.channel: found wegB0; expected a channel of this rig"),
    ("clearance = { value = 0.2,", "clearance = { value = 0.7,", "or the journal strikes the AMB first"),
    ('"schwebt frei" = "LEVITATED"', '"schwebt" = "LEVITATED"', "found a state that the controller does not have"),
    ('"Go.order" = 1 }', '"Go.order" = 2 }', "a controller could not tell which is meant"),
    ('runout = { value = 0, unit = "um"', 'runout = { value = 0, unit = "grad"', "write deg or gon"),
    ('signal = "Set.sp_A45"', 'signal = "Set.sp_A46"', "message Set has no signal 'sp_A46'"),
    (
        'sp_B90 = { signal = "Set.sp_B90", unit = "m"',
        'sp_B90 = { signal = "Set.sp_B90", unit = "rad"',
        "sp_B90, in rad",
    ),
    ('gap = { value = 0.5, unit = "mm"', 'gap = { value = 0.5, unit = "m"', "look at the unit"),
    ("sign = -1", "sign = 2", "probes.A135.sign: found 2"),
)


def changed(folder: Path, *turns: tuple[str, str, str]) -> str:
    text = (FOLDER / "gemischt.toml").read_text(encoding="utf-8")
    for old, new, _ in turns:
        assert old in text, old
        text = text.replace(old, new, 1)
    (folder / "gemischt.toml").write_text(text, encoding="utf-8")
    (folder / "gemischt.dbc").write_bytes((FOLDER / "gemischt.dbc").read_bytes())
    return str(folder / "gemischt.toml")


def test_every_wrong_turn_is_told_at_once(tmp_path: Path) -> None:
    """One that breaks the types, such as a unit that means two things, hides none of the others."""
    told = "\n".join(map(str, check_rig(changed(tmp_path, *WRONG_TURNS))[0]))
    assert [said for _, _, said in WRONG_TURNS if said not in told] == []


def test_a_part_that_nobody_can_place_hides_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a procedure makes of it is said where procedures are listed."""
    lost = ('{ of = "bearings/A/A45", plus_deg = 0 }', '{ of = "bearings/A/Q45", plus_deg = 0 }', "")
    twice = ('i_B0_p", "i_B0_n"', 'i_B0_p", "i_B90_n"', "")
    assert main(("check", changed(tmp_path, lost, twice))) == 2
    err = capsys.readouterr().err
    assert "probes.A45.direction.of: found bearings/A/Q45; expected what has a direction" in err
    assert "found i_B90_n; expected a channel of its own" in err


def test_directions_of_the_overhung_rotor_count_from_up() -> None:
    """Up is at 155 degrees from the drain plug: an axis at 175 stands 20 degrees from up."""
    angles = [round(a.direction * 57.29577951308232, 6) for s in radial_supports(load_rig(OVERHUNG)) for a in s.axes]
    assert angles == [20, 110, 20, 110]


def test_an_axis_may_be_called_as_a_coordinate_is() -> None:
    """A step along y moves what looks 60 degrees from it by half; x is an axis here, and no set point is along the shaft."""
    machine = conventions(load_rig(HANGING))
    moved = machine.point("y", 1.0)
    assert moved == pytest.approx({"sp_top_u": 1, "sp_top_v": 0.5, "sp_low_w": 1, "sp_low_x": 0.5})
    assert set(machine.point("z", 1.0)) == {"sp_top_v", "sp_low_x"}
    assert not machine.can_point("x")


@ALL
@pytest.mark.parametrize("axis", ["y", pytest.param("z", marks=pytest.mark.long)])
def test_steps_find_nothing_wrong_with_a_sound_rig(path: str, axis: str, tmp_path: Path) -> None:
    """Where the centre of mass is beyond both bearings, the farther one brakes before the shaft has gone its way; where axes
    are not at right angles, one that is moved along is seen by the other."""
    run = simulated_run("step", path, 1, {"axes": [axis]}, tmp_path / "step.mcap")
    found = {f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}
    assert found <= {"not-settled", "telemetry-too-slow"}  # at 500 samples a second
    assert any(isinstance(m, Measured) for m in run.results) or "telemetry-too-slow" in found


@pytest.mark.long
def test_without_a_bias_forces_are_found_and_slopes_are_not_told(tmp_path: Path) -> None:
    run = simulated_run("bearing-model", SLANT, 1, {}, tmp_path / "places.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    found = {m.quantity.name for m in run.results if isinstance(m, Measured)}
    assert {"beta", "offset"} <= found
    assert not {"K_i", "K_x"} & found
