"""Where the two probes of a plane stand at two places along the shaft, each direction has arms of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.rigfile import load_rig
from procedures.step.position import shares

STAND = Path(__file__).resolve().parents[2] / "examples/plain-stand"


def test_each_direction_goes_by_its_own_probes(tmp_path: Path) -> None:
    """The centre of mass is at 0; the front probes stand at 98 and at 118 mm, the rear ones at -122 mm. Made with the arms of
    the others a step along z had an overshoot 1 % too small, and settled .6 ms too early, 5 U."""
    lines = (STAND / "stand.toml").read_text(encoding="utf-8").splitlines()
    moved = [x.replace("value = 98", "value = 118") if x.startswith("x_vorn = { channel") else x for x in lines]
    (tmp_path / "stand.toml").write_text("\n".join(moved), encoding="utf-8")
    (tmp_path / "stand.dbc").write_bytes((STAND / "stand.dbc").read_bytes())
    rig = load_rig(str(tmp_path / "stand.toml"))
    assert shares(rig, "y") == pytest.approx({"LageYHinten": 98 / 220, "LageYVorn": 122 / 220}, abs=1e-3)
    assert shares(rig, "z") == pytest.approx({"LageXHinten": 118 / 240, "LageXVorn": 122 / 240}, abs=1e-3)
