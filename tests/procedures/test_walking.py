"""Positions of bearing-model on rigs other than the stand of the thesis: where the shaft has room, and how it gets there."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.bearing_model.fitting import check
from procedures.bearing_model.grid import find_room, most
from procedures.bearing_model.plan import Plan
from procedures.bearing_model.walking import way

TESTS = Path(__file__).resolve().parents[1]
INCLINE = TESTS / "strangers/incline.toml"
STAND = TESTS.parent / "examples/plain-stand/stand.toml"


def changed(folder: Path, *turns: tuple[str, str]) -> str:
    text = INCLINE.read_text(encoding="utf-8")
    for old, new in turns:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "incline.toml").write_text(text, encoding="utf-8")
    (folder / "incline.dbc").write_bytes(INCLINE.with_suffix(".dbc").read_bytes())
    return str(folder / "incline.toml")


def test_a_far_place_is_reached_in_jumps_that_have_room_to_swing() -> None:
    """From one tilt of 300 µrad to the other the probe at 295 mm goes by 177 µm to 88.5 µm: 182 - 88.5 µm are left, so that
    1.5 jumps fit where there are three of them."""
    rig = load_rig(str(INCLINE))
    ways = list(way(rig, {"psi": 3e-4, "theta": 0.0}, {"psi": -3e-4, "theta": 0.0}))
    assert [at["psi"] for at in ways] == pytest.approx([1e-4, -1e-4, -3e-4])
    assert list(way(rig, {"y": 0.0, "z": 0.0}, {"y": 22.5e-6, "z": 0.0})) == [{"y": 22.5e-6, "z": 0.0}]


def test_the_stand_of_the_thesis_jumps() -> None:
    rig = load_rig("amb5dof")
    assert list(way(rig, {"y": 0.0, "z": 0.0}, {"y": 7e-5, "z": 0.0})) == [{"y": 7e-5, "z": 0.0}]


def test_a_limit_of_the_probes_own_bounds_the_grid(tmp_path: Path) -> None:
    """In place of the kind's 190 µm: what it leaves, and a sentence for a plan that goes beyond."""
    own = 'yv = { signal = "A.yv", unit = "m"'
    rig = load_rig(changed(tmp_path, (own, f"{own}, protect = {{ low = -6e-5, high = 8e-5 }}")))
    assert find_room(rig) == pytest.approx(55e-6)
    assert most(rig) == pytest.approx(49e-6)
    (said,) = [line for line in check(rig, Plan(radius_m=6e-5, tilt_rad=1e-4)) if "radius" in line]
    assert "found 60.0 µm; the limits of the probes (envelope, protect) and a margin leave 55.0 µm" in said
    (said,) = check(rig, Plan(tilt_rad=3e-4))
    assert said == (
        "tilt_rad: found 300 µrad; set points, the limits of the probes (envelope, protect) and a margin leave 186 µrad"
    )


def test_set_points_that_go_less_far_to_one_side_bound_the_grid(tmp_path: Path) -> None:
    side = 'sp_v = { signal = "Set.sp_v", unit = "m", default = 0, low = -1e-4'
    rig = load_rig(changed(tmp_path, (side, side.replace("-1e-4", "-5e-5"))))
    assert most(rig) == pytest.approx(45e-6)
    assert any("sp_v goes to 50 µm" in line for line in check(rig, Plan(radius_m=6e-5)))


def test_an_overhung_shaft_is_not_thrown_past_its_probes_limits(tmp_path: Path) -> None:
    """One jump to a tilt or to the first place went 1.2 jumps past it: ABORTED by the interlock."""
    none_is_wrong(simulated_run("bearing-model", str(INCLINE), 0, {}, tmp_path / "places.mcap"))


def test_a_loop_that_goes_farther_past_than_most_is_sent_in_smaller_jumps(tmp_path: Path) -> None:
    """So slow a controller hardly outdoes the magnets' negative stiffness: its jumps go over three times as far past as they
    are long. With a bound of 1.5 it threw the shaft out on the way to the first place (ABORTED)."""
    slow = STAND.read_text(encoding="utf-8").replace("supply_V = 24.0\n", "supply_V = 24.0\nbandwidth = 30\n")
    assert "bandwidth" in slow
    (tmp_path / STAND.name).write_text(slow, encoding="utf-8")
    for dbc in STAND.parent.glob("*.dbc"):
        (tmp_path / dbc.name).write_bytes(dbc.read_bytes())
    none_is_wrong(simulated_run("bearing-model", str(tmp_path / STAND.name), 1, {}, tmp_path / "places.mcap"))


def none_is_wrong(run: Simulated) -> None:
    """No finding, and all values are where the truth is."""
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    truth = {**run.truth, **truth_of_motion(run)}
    found = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    off = [(e.value - truth[key]) / interval(e).U for key, e in found.items() if key in truth]
    assert len(off) >= 10
    assert max(map(abs, off)) < 2
