"""The machine in the rig file: places and directions by hand, contradictions one by one, drafts, schema 1."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from test_rigfile import DBC, TOML, changed, of_schema_1, problems, written

from bench.cli.loading import load_procedure
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_machine import problems_of
from bench.rigfile.elements import MachineTables
from bench.rigfile.places import PlaceError, Places

ROOT = Path(__file__).resolve().parent
DRAFTS = sorted((ROOT / "drafts").glob("*.toml"))
RIGS = {name: ((ROOT.parent / f"rigs/{name}.toml").read_text(encoding="utf-8"),
               (ROOT.parent / f"rigs/{name}.dbc").read_text(encoding="utf-8")) for name in ("tsbs12", "amb5dof")}  # fmt: skip


@pytest.mark.parametrize("draft", DRAFTS, ids=lambda path: path.stem)
def test_machines_to_come_can_be_described(draft: Path) -> None:
    """One axis, a frame turned by 45 degrees, an upright shaft with three motors, one that does not levitate."""
    rig = RigFile.parse(draft.read_text(encoding="utf-8"), "", str(draft))
    assert [str(p) for p in problems_of(rig)] == []
    assert Places(rig).parts


def test_there_are_four_drafts() -> None:
    assert [path.stem for path in DRAFTS] == ["amb1dof", "lira", "rlsrm", "tsbs6"]


def test_places_and_directions_of_the_servomotor() -> None:
    """T Table 6.1 by hand: the outboard AMB 10 mm from the centre of mass, the span of 125 mm, the hook 150 mm on."""
    places = Places(load_rig("tsbs12"))
    at = {part: round(1e3 * places.place(part).value, 6) for part in places.parts}
    assert at == {
        "bearings/inboard": -115, "bearings/outboard": 10, "probes/yi": -161, "probes/xi": -161, "probes/yo": 52,
        "probes/xo": 52, "hooks/hook": 160, "motors/motor": 122,
    }  # fmt: skip
    turned = {part: round(math.degrees(places.direction(part).value), 9) for part in places.directed}
    assert turned == {f"{table}/{a}": d for a, d in (("yi", 0), ("xi", -90), ("yo", 0), ("xo", -90))
                      for table in ("probes", "bearings/inboard" if a[1] == "i" else "bearings/outboard")}  # fmt: skip


def test_directions_count_from_up_wherever_the_file_has_its_zero() -> None:
    """The same machine, described from a zero that is 30 degrees clockwise of up: yi at 30 degrees there."""
    stated = 'direction = { value = 0, unit = "deg", half_width = 0.3'
    up = f'zero_at = "the terminal box"\nup = {QUARTER.replace("90", "30")}'
    toml = changed(TOML, (stated, stated.replace("value = 0", "value = 30")), (FAR, f"{FAR}{up}"))
    here, there = Places(RigFile.parse(TOML, DBC)), Places(RigFile.parse(toml, DBC))
    assert {p: there.direction(p).value for p in there.directed} == {p: here.direction(p).value for p in here.directed}


def test_a_certified_span_stands_before_two_places() -> None:
    """Two places that each have their own error would give the span a larger uncertainty than its certificate."""
    places = Places(load_rig("tsbs12"))
    span = places.distance("bearings/inboard", "bearings/outboard")
    assert [(t.identity, t.factor) for t in span.terms] == [("geometry/amb_span", 1.0)]
    back = places.distance("bearings/outboard", "motors/motor")
    assert [(t.identity, t.factor) for t in back.terms] == [("geometry/motor_to_outboard_amb", 1.0)]
    assert places.distance("motors/motor", "bearings/outboard").value == pytest.approx(-0.112)


def test_what_two_places_share_cancels() -> None:
    places = Places(load_rig("tsbs12"))
    hook = places.distance("bearings/outboard", "hooks/hook")
    assert [(t.identity, t.factor) for t in hook.terms] == [("geometry/hook_to_outboard", 1.0)]
    assert places.distance("hooks/hook", "hooks/hook").terms == ()
    far = places.distance("bearings/inboard", "hooks/hook")
    assert {(t.identity, t.factor) for t in far.terms} == {
        ("geometry/amb_span", 1.0),
        ("geometry/hook_to_outboard", 1.0),
    }


def test_the_two_radial_axes_of_the_stand_stand_upright_together() -> None:
    """T 2.2: y and z at 45 degrees to the vertical, both upwards, z a right angle on from y about x: if one leans, both do."""
    places = Places(load_rig("amb5dof"))
    y, z = places.direction("bearings/inboard/yi"), places.direction("bearings/inboard/zi")
    assert (math.degrees(y.value), math.degrees(z.value)) == pytest.approx((-45, 45))
    assert (z - y).terms == ()
    assert (z - y).exact == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("name", RIGS)
def test_schema_1_says_the_same(name: str) -> None:
    """Every number has the identity that it had, and the tables that the migration writes are those of the shipped file."""
    toml, dbc = RIGS[name]
    new, old = RigFile.parse(toml, dbc), RigFile.parse(of_schema_1(toml), dbc)
    known = Places(new).known
    assert {identity: known[identity] for identity in Places(old).known if identity in known} == dict(
        Places(old).known
    ) or (
        name == "tsbs12"  # whose direction of y schema 1 did not state
    )
    for table in ("geometry", "machine", "sensors", "masses"):
        assert getattr(new, table) == getattr(old, table)
    told = [t for t in MachineTables.model_fields if getattr(new, t) != getattr(old, t)]
    assert told == (["bearings", "motors"] if name == "tsbs12" else [])
    unsaid: dict[str, object] = {"asked": {}}  # what the law asks for: schema 1 has no word for it
    assert {m: one.model_copy(update=unsaid) for m, one in new.motors.items()} == dict(old.motors)
    for part in Places(new).parts:
        assert Places(new).place(part) == Places(old).place(part)
    for part in Places(new).directed:
        assert Places(new).direction(part).value == pytest.approx(Places(old).direction(part).value)


FAR = 'far_end = "outboard"\n'
QUARTER = '{ value = 90, unit = "deg", half_width = 0, distribution = "rectangular", source = "drawing" }\n'
UPRIGHT = f"tilt = {QUARTER}"
UP = 'axes.yo = { direction = { of = "bearings/inboard/yi", plus_deg = 0 }'


@pytest.mark.parametrize(
    ("old", "new", "key", "found", "expected"),
    [
        ('at = "geometry/com_to_outboard_amb"', 'at = "geometry/com_to_outbord_amb"', "bearings.outboard.at",
         "geometry/com_to_outbord_amb", "such as geometry/com_to_outboard_amb"),
        ('at = "geometry/com_to_outboard_amb"', 'at = { from = "bearings/inboard", by = "geometry/amb_span" }',
         "bearings.inboard.at.from", "bearings/inboard from bearings/outboard", "does not count from itself"),
        ('at = "geometry/com_to_outboard_amb"', 'at = { from = "bearings/outbord", by = "geometry/amb_span" }',
         "bearings.outboard.at.from", "bearings/outbord", "one of origin, centre_of_mass, bearings/inboard"),
        ('at = "geometry/com_to_outboard_amb"', 'at = "machine/polar_inertia"', "bearings.outboard.at", "kg m^2",
         "a unit of the kind of m"),
        ('gap = "geometry/amb_gap"', 'gap = "-geometry/amb_gap"', "bearings.inboard.gap", "", "a positive number"),
        ('at = { from = "bearings/outboard", by = "-geometry/amb_span" }', 'at = "geometry/com_to_outboard_amb"',
         "bearings.outboard.at", "10 mm, where inboard is", "a place of its own"),
        ('{ of = "bearings/inboard/yi", plus_deg = -90 }', '{ of = "bearings/inboard/yi", plus_deg = 175 }',
         "bearings.inboard.axes.xi.direction", "175°, along yi", "10° or more from parallel"),
        (UP, UP.replace("inboard/yi", "outboard/xo"), "bearings.outboard.axes.yo.direction.of",
         "bearings/outboard/yo of bearings/outboard/xo of bearings/outboard/yo", "not told by itself"),
        (UP, UP.replace("bearings/inboard/yi", "bearings/inboard/ui"), "bearings.outboard.axes.yo.direction.of",
         "bearings/inboard/ui", "one of bearings/inboard/yi"),
        ('axes.z = { coils', 'axes.z = { direction = { of = "probes/yi", plus_deg = 0 }, coils',
         "bearings.axial.axes.z.direction", "a direction", "along the shaft"),
        (UP + ",", "axes.yo = {", "bearings.outboard.axes.yo.direction", "nothing", "the angle around the shaft"),
        ('coils = ["i_yo_p", "i_yo_n"]', 'coils = ["i_yo_p", "i_y_n"]', "bearings.outboard.axes.yo.coils", "i_y_n",
         "a channel of this rig"),
        ('coils = ["i_yo_p", "i_yo_n"]', 'coils = ["i_yo_p", "i_yi_n"]', "bearings.outboard.axes.yo.coils", "i_yi_n",
         "a channel of its own: it is that of bearings.inboard.axes.yi.coils"),
        ('channel = "pos_z"', 'channel = "angle"', "probes.z.channel", "angle in rad", "of the kind of m"),
        ('"geometry/motor_to_outboard_amb" = ["motors/motor",', '"geometry/motor_to_outboard_amb" = ["motors/moter",',
         "spans.geometry/motor_to_outboard_amb", "motors/moter", "motors/motor"),
        (FAR, FAR + 'ends = [{ value = -150, unit = "mm", half_width = 1, distribution = "rectangular", source = "drawing" }, '
         '{ value = 200, unit = "mm", half_width = 1, distribution = "rectangular", source = "drawing" }]\n',
         "probes.yi.at", "-161 mm, beyond the shaft", "-150 to 200 mm"),
        ('source = "stand-in: set by a level"', 'certificate = "A-7", source = "level"',
         "bearings.inboard.axes.yi.direction.certificate", "A-7", "one of [certificates]: (none)"),
        ("[hooks]\n", '[certificates.A-7]\nnumber = "A-7"\ndate = "2026-02-01"\ndue = "2026-01-31"\n\n[hooks]\n',
         "certificates.A-7.due", "2026-01-31", "no day before its date"),
        ("[hooks]\n", '[certificates.A-7]\nnumber = "A-7"\ndate = "2026-02-30"\n\n[hooks]\n', "certificates.A-7.date",
         "2026-02-30", "a day"),
        ("left = { length =", "left = { lenght =", "levers.left.lenght", "geometry/lever_left", "no such key"),
        ("plus_deg = -90 }, coils = [\"i_xi_p\"", "plus_deg = 900 }, coils = [\"i_xi_p\"",
         "bearings.inboard.axes.xi.direction.plus_deg", "900", "less than or equal to 360"),
        (FAR, FAR + 'zero_at = "the terminal box"\n', "shaft.zero_at", "'the terminal box' on a shaft that does not stand",
         "which direction, counted from there, is up"),
        (FAR, FAR + f"{UPRIGHT}up = {QUARTER}", "shaft.up", "on a shaft that stands", "`zero_at` says"),
        (FAR, FAR + 'up = "geometry/amb_span"\n', "shaft.up", "geometry/amb_span in m", "the kind of rad"),
        (FAR, FAR + 'up = "geometry/am_span"\n', "shaft.up", "geometry/am_span", "such as geometry/amb_span"),
    ],
)  # fmt: skip
def test_a_contradiction_is_named_with_its_place(
    tmp_path: Path, old: str, new: str, key: str, found: str, expected: str
) -> None:
    told = problems(tmp_path, changed(TOML, (old, new)))
    assert key in told, told
    assert found in told[key].found
    assert expected in told[key].expected


def test_contradictions_are_told_all_at_once(tmp_path: Path) -> None:
    toml = changed(
        TOML,
        ('at = "geometry/com_to_outboard_amb"', 'at = "geometry/nowhere"'),
        ("axes.z = { coils", 'axes.z = { direction = { of = "probes/yi", plus_deg = 0 }, coils'),
        ('channel = "pos_z"', 'channel = "angle"'),
        ('{ of = "bearings/inboard/yi", plus_deg = -90 }', '{ of = "bearings/inboard/yi", plus_deg = 175 }'),
    )
    assert set(problems(tmp_path, toml)) == {
        "bearings.outboard.at", "bearings.axial.axes.z.direction", "probes.z.channel", "mark.angle",
        "bearings.inboard.axes.xi.direction",
    }  # fmt: skip


def test_a_part_that_is_not_there_is_refused_by_name() -> None:
    places = Places(load_rig("tsbs12"))
    with pytest.raises(PlaceError, match="hooks/hok: found hooks/hok; expected a part with a place: one of origin"):
        places.place("hooks/hok")
    with pytest.raises(PlaceError, match="expected what has a direction: one of bearings/inboard/yi"):
        places.direction("hooks/hook")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('{ value = 0, unit = "deg", half_width = 0.3', '{ value = 30, unit = "deg", half_width = 0.3',
         "bearings: found axes yi at 30°, xi at -60°, yo at 30°, xo at -60°; expected them at 0° and -90°"),
        ('xi = { channel = "pos_xi", ', 'xi = { sign = -1, channel = "pos_xi", ', "probes.xi.sign: found -1"),
        (FAR, FAR + "sense = -1\n", "shaft.sense: found -1"),
        (FAR, FAR + 'tilt = { value = 90, unit = "deg", half_width = 1, distribution = "rectangular", source = "level" }\n',
         "shaft.tilt: found a shaft that does not lie"),
        ('at = "-geometry/com_to_inboard_sensor"', 'at = "-geometry/com_to_inboard_amb"',
         "geometry.com_to_inboard_sensor: found 161 mm, but probes/yi stands 115 mm to the inboard side"),
    ],
)  # fmt: skip
def test_what_procedures_do_not_take_yet_is_refused_before_a_run(tmp_path: Path, old: str, new: str, said: str) -> None:
    """A rig file may say it; a procedure that would take it for something else does not run."""
    rig = load_rig(written(tmp_path, changed(TOML, (old, new))))
    for name in ("torque-constant", "spindown", "force-map"):
        (told,) = load_procedure(name).lacking(rig)
        assert told.startswith(said)
    assert load_procedure("amb-calibration").lacking(load_rig("tsbs12")) == ()


def test_a_mark_may_call_its_channels_as_it_likes(tmp_path: Path) -> None:
    renamed = changed(TOML, ('angle = "angle"', 'angle = "gamma"'), ("\nangle = { signal", "\ngamma = { signal"))
    assert load_procedure("spindown").lacking(load_rig(written(tmp_path, renamed))) == ()
    without = changed(TOML, ('angle = "angle"\n', ""))
    told = load_procedure("spindown").lacking(load_rig(written(tmp_path, without)))
    assert told == ("mark: found no channel for angle",)


def test_what_one_procedure_does_not_take_is_refused_by_it_alone(tmp_path: Path) -> None:
    """A hook that pulls to the side without a pulley: another procedure does not read it. A scale the other way is taken."""
    hook = 'hook = { pull = { of = "bearings/inboard/yi", plus_deg = 90 }, '
    pulled = load_rig(written(tmp_path, changed(TOML, ("hook = { ", hook))))
    assert load_procedure("amb-calibration").lacking(pulled)[0].startswith("hooks.hook.pulley: found none")
    assert load_procedure("spindown").lacking(pulled) == ()
    toml, dbc = RIGS["amb5dof"]
    turned = RigFile.parse(changed(toml, ("[balancing]\ninboard = { ", "[balancing]\ninboard = { sense = -1, ")), dbc)
    assert load_procedure("balance").lacking(turned) == ()


def test_a_number_inline_has_its_place_or_its_id_for_identity(tmp_path: Path) -> None:
    stated = '{ value = 10, unit = "mm", half_width = 0.5, distribution = "rectangular", source = "drawing"'
    toml = changed(TOML, ('at = "geometry/com_to_outboard_amb"', f"at = {stated} }}"))
    inline = Places(load_rig(written(tmp_path, toml))).place("bearings/outboard")
    assert [t.identity for t in inline.terms] == ["bearings/outboard/at"]
    toml = changed(TOML, ('at = "geometry/com_to_outboard_amb"', f'at = {stated}, id = "outboard/plane" }}'))
    named = Places(load_rig(written(tmp_path, toml))).place("bearings/inboard")
    assert [t.identity for t in named.terms] == ["outboard/plane", "geometry/amb_span"]
    assert RigFile.parse(TOML, DBC).schema_ == 2
