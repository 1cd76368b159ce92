"""What a rig file cannot say is refused by its name: files as a user would write them, each of a rig that is sound."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.rigfile import load_rig
from bench.rigfile.beyond import beyond
from bench.rigfile.check import check_rig

ROOT = Path(__file__).resolve().parents[1]
STRANGERS, RIGS = ROOT / "tests/strangers", ROOT / "rigs"
SOUND = [*sorted(RIGS.glob("*.toml")), *(p for p in sorted(ROOT.glob("examples/*/*.toml")) if p.name != "pyproject.toml"),
         *(p for p in sorted(STRANGERS.glob("*.toml")) if p.stem != "solo")]  # fmt: skip


def written(folder: Path, name: str, *turns: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> str:
    """A copy of a stranger with some lines otherwise."""
    text, frames = ((STRANGERS / f"{name}.{kind}").read_bytes().decode("latin-1") for kind in ("toml", "dbc"))
    for old, new in turns:
        assert old in text, old
        text = text.replace(old, new)
    assert dbc[0] in frames
    (folder / f"{name}.toml").write_bytes(text.encode("latin-1"))
    (folder / f"{name}.dbc").write_bytes(frames.replace(*dbc).encode("latin-1"))
    return str(folder / f"{name}.toml")


def told(path: str) -> list[str]:
    return [str(p).partition(".toml: ")[2] for p in check_rig(path)[0]]


@pytest.mark.parametrize("path", SOUND, ids=lambda p: p.stem)
def test_what_can_be_measured_is_not_refused(path: Path) -> None:
    assert [*beyond(load_rig(str(path)))] == []


def test_a_shaft_on_one_radial_bearing() -> None:
    """It is read, so that its controller can be listened to; the check refuses it by name."""
    path = str(STRANGERS / "solo.toml")
    assert load_rig(path).name == "solo"
    (problem,) = told(path)
    assert problem.startswith("bearings: found one radial bearing, only; expected two: a shaft whose other end runs in")


def third(name: str, at: int) -> str:
    number = 'unit = "{}", half_width = 0.3, distribution = "rectangular", source = "drawing"'
    place, way = (number.format(u) for u in ("mm", "deg"))
    axes = "".join(f"axes.{name}{k} = {{ direction = {{ value = {k}, {way} }} }}\n" for k in (0, 90))
    return f'[bearings.{name}]\nkind = "radial"\nat = {{ value = {at}, {place} }}\n{axes}\n'


def test_a_shaft_in_three_radial_bearings(tmp_path: Path) -> None:
    path = written(tmp_path, "gemischt", ("[probes]", third("mid", 200) + "[probes]"))
    assert told(path) == ["bearings: found 3 radial bearings, A, B, mid; expected two: no shaft in more is measured"]


def test_a_bearing_of_three_axes(tmp_path: Path) -> None:
    way = '{ value = 90, unit = "deg", half_width = 0.3, distribution = "rectangular", source = "drawing" }'
    path = written(tmp_path, "gemischt", ("[bearings.B]", f"axes.A90 = {{ direction = {way} }}\n[bearings.B]"))
    assert told(path) == ["bearings.A.axes: found 3, A45, A135, A90; expected two axes: a bearing of three poles, or one that "
                          "pulls one way, is not measured"]  # fmt: skip


def test_a_control_current_in_one_channel(tmp_path: Path) -> None:
    rig = load_rig(str(STRANGERS / "gemischt.toml"))
    plus, minus = rig.bearings["A"].axes["A45"].coils
    path = written(tmp_path, "gemischt", (f'coils = ["{plus}", "{minus}"]', f'coils = ["{plus}"]'))
    (problem,) = told(path)
    assert problem.startswith(
        f"bearings.A.axes.A45.coils: found {plus} alone; expected two channels, the current of the coil"
    )
    assert problem.endswith("a control current, one channel with a sign, is not taken")


@pytest.mark.parametrize(("stated", "refused"), [("[0|0]", False), ("[-0.05|5000]", False), ("[-5000|5000]", True)])
def test_a_control_current_of_an_axial_bearing(stated: str, refused: bool, tmp_path: Path) -> None:
    """One coil that pulls against the weight is taken; what its DBC lets go as far below zero as above is no coil's."""
    frames = ("i_ax : 40|16@1- (0.5,0) [0|0]", f"i_ax : 40|16@1- (0.5,0) {stated}")
    found = told(written(tmp_path, "hanging", dbc=frames))
    assert [text.partition(": found ")[0] for text in found] == ["bearings.hook.axes.up.coils"] * refused
    assert all("which its DBC lets go below zero" in text for text in found)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('roles = ["levitation"]', 'roles = ["levitation", "rotation"]', "devices.controller.roles: found rotation"),
        ("STOP = {", 'SPIN = { "Order.order" = "Snurra" }\nSTOP = {', "devices.controller.binding.commands.SPIN"),
    ],
)
def test_a_motor_of_which_only_a_speed_can_be_set(old: str, new: str, key: str, tmp_path: Path) -> None:
    (problem,) = told(written(tmp_path, "skivrotor", (old, new)))
    assert problem.startswith(key)
    assert "a motor that takes a speed alone is not turned" in problem
    assert problem.endswith("turn the shaft by a device in the role drive")


def test_a_motor_of_which_only_a_speed_can_be_set_bound_as_an_angle(tmp_path: Path) -> None:
    speed = '[capabilities.angle]\nspeed = "varvborvarde"\n\n[capabilities.set_points]'
    (problem,) = told(written(tmp_path, "skivrotor", ("[capabilities.set_points]", speed)))
    assert problem.startswith(
        "capabilities.angle.ref: found nothing; expected the parameter of the angle that the motor holds"
    )
    assert problem.endswith("turn the shaft by a device in the role drive")


def test_rolling_counters_of_three_bits(tmp_path: Path) -> None:
    rig = load_rig(str(STRANGERS / "gemischt.toml"))
    assert len(rig.binding.telemetry) > 1
    text = (STRANGERS / "gemischt.dbc").read_bytes().decode("latin-1")
    line = next(
        x for x in text.split(f" {rig.binding.telemetry[1]}:")[1].splitlines() if f"SG_ {rig.binding.counter} " in x
    )
    length = line.partition("|")[2].partition("@")[0]
    found = told(written(tmp_path, "gemischt", dbc=(line, line.replace(f"|{length}@", "|3@"))))
    assert any("of 3 bits; expected at least 4 bits" in problem for problem in found), found
