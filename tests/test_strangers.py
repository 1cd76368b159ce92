"""Rigs as strangers write them by the pages alone: `overhung`, whose centre of mass is beyond both bearings, with three planes
of probes of which one falls, directions from a drain plug and a heartbeat of one bit; `hanging`, which stands, with axes 60
degrees apart of which one has a coordinate's name, one axial coil, seven messages in both byte orders, no state for landing;
`slant` at 30 degrees, whose set points are the shaft's, whose status bits are signals, and whose controller tells no bias."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench import catalogue
from bench.cli.abilities import abilities
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.supports import radial_supports
from procedures.amb_rotor.conventions import conventions

FOLDER = Path(__file__).resolve().parent / "strangers"
OVERHUNG, HANGING, SLANT = (str(FOLDER / f"{name}.toml") for name in ("overhung", "hanging", "slant"))
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
