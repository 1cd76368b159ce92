"""Truth of where the machine's bearings need no current, against the machine itself."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lira_plants import flying

from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import TRACE, ideal
from sim_backend.machines.lira.quantities import RADIAL
from sim_backend.machines.lira.truth_pull import read, stands

PULL, FORCE = (380e3, 365e3), (3.6, 3.8)


def test_the_machine_itself_rests_without_current_where_the_truth_says() -> None:
    """The machine, held at the readings of the truth: the bearings' mean currents vanish. Uneven magnets, a target that
    is not round, levers of their own, encoders that are off, a centre of mass 1.5 mm off the middle."""
    p = replace(
        ideal(PlantParams(pull=PULL, bearing_constant=FORCE, middle=0.0125, sensor_plane=0.0445, zero_ra=(0.04, -0.03))),
        centre=(4e-6, -3e-6, 2e-6, 5e-6), uneven=(6e-6, 4e-6), uneven_phase=(1.0, 2.5), runout=5e-6, runout_phase=0.7,
        position_offset=(1e-6, -2e-6, 3e-6, -4e-6, 0.0, 0.0), position_gain=(1.01, 0.99, 1.005, 0.995, 1.0, 1.0),
    )  # fmt: skip
    plant = flying(p, reduced=True, z=0.011, observer=2.0)
    for name, x in zip(RADIAL, read(p, stands(p, 0.011, 0.0, 1.0), 0.011, 0.0), strict=True):
        plant.refer(name, x)
    rest = plant.run(1.0)[-200:].mean(axis=0)
    currents = [rest[TRACE.index(f"i_{way}_B{k}")] for k in (1, 2) for way in "dq"]
    assert currents == pytest.approx([0.0] * 4, abs=4e-3)  # 40 nm
