"""Steps that the controller's messages cannot hold as asked: refused before anything starts, avoided by default."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bench.rigfile import RigFile, load_rig
from procedures.step.held import grain, held
from procedures.step.plan import Plan
from procedures.step.procedure import check, procedure

STAND = Path(__file__).resolve().parents[2] / "examples/plain-stand"


def coarse(folder: Path, scale: str) -> RigFile:
    """The stand, whose controller takes set points as multiples of another length, in micrometres."""
    text = (STAND / "stand.toml").read_text(encoding="utf-8")
    (folder / "stand.toml").write_text(text, encoding="utf-8")
    for path in STAND.glob("*.dbc"):
        dbc = path.read_bytes().decode("cp1252")
        changed, times = re.subn(r"(SG_ Soll\w+ [^(]*)\([^,]+,0\) \[[^]]*\]", rf"\1({scale},0) [0|0]", dbc)
        assert times == 4
        (folder / path.name).write_bytes(changed.encode("cp1252"))
    return load_rig(str(folder / "stand.toml"))


@pytest.mark.parametrize(
    ("value", "of", "near"),
    [
        (1e-5, 1e-8, 1e-5),
        (1.0005e-5, 1e-8, 1.0e-5),
        (1e-5, 3e-7, 9.9e-6),
        (1e-5, 0.0, 1e-5),
        (1e-5 + 5e-11, 1e-8, 1e-5 + 5e-11),
    ],
)
def test_a_multiple_of_the_grain(value: float, of: float, near: float) -> None:
    assert held(value, of) == pytest.approx(near, rel=1e-12)


def test_a_size_between_two_set_points_is_refused_with_the_nearest() -> None:
    """It had ended 0.05 % beside what was asked for, and the settling time 7 U."""
    rig = load_rig(str(STAND / "stand.toml"))
    assert grain(rig, "SollYVorn") == pytest.approx(1e-8)
    assert list(check(rig, Plan())) == []
    (found,) = check(rig, Plan(axes=("y",), sizes_m=(1.0005e-5, 2e-5)))
    assert found.startswith("sizes_m: found 10.005 um along y")
    assert "expected what its signal holds, as 10 um (steps of 0.01 um)" in found


def test_default_sizes_are_such_that_set_points_hold_them(tmp_path: Path) -> None:
    rig = coarse(tmp_path, "0.3")
    assert list(check(rig, Plan()))
    assert procedure.planned(rig)["sizes_m"] == pytest.approx((9.9e-6, 2.01e-5))
    assert list(check(rig, Plan(**procedure.planned(rig)))) == []
    assert procedure.planned(load_rig(str(STAND / "stand.toml"))) == {}
