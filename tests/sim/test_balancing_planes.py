"""Who fixes weights on the AMB stand knows its planes by the rig file's names, and by those of before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import RigFile
from sim_backend.machines.amb5dof.truth_balance import left
from sim_backend.truth import draw

RIGS = Path(__file__).resolve().parents[2] / "rigs"
TOML, DBC = ((RIGS / f"amb5dof.{x}").read_text(encoding="utf-8") for x in ("toml", "dbc"))


@pytest.mark.parametrize("names", [("inboard", "outboard"), ("disc", "fan")])
def test_a_plane_goes_by_its_name_and_by_that_of_before(names: tuple[str, str]) -> None:
    begin, end = TOML.index("[balancing]"), TOML.index("[coupling]")
    planes = TOML[begin:end].replace("inboard = {", f"{names[0]} = {{").replace("outboard = {", f"{names[1]} = {{")
    rig = RigFile.parse(TOML[:begin] + planes + TOML[end:], DBC)
    truth = draw(rig, 0)
    events = [{"action": "attach", "plane": plane, "mass_kg": 1e-3, "angle_rad": 0.5} for plane in (*names, "outboard")]
    added = np.diff(np.array(left(rig, truth, [*events, {"action": "detach", "plane": names[1]}])), axis=0)
    assert (np.abs(added) > 1e-6).tolist() == [[True, False], [False, True], [False, True], [False, True]]
