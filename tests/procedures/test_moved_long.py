"""Drawn numbers of the truth moved by three half widths: caught, harmless, in the budget, or listed on the report.

Of numbers that are there for each bearing, segment, mass or lever those of one or two; `make moved` tries every one.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from benchmarks.moved import identity, moved, numbers, shares

SEED = 5


def wanted(rig: str, prefixes: tuple[str, ...]) -> dict[str, float]:
    return {name: value for name, value in numbers(load_rig(rig)).items() if name.startswith(prefixes)}


@pytest.mark.long
@pytest.mark.timeout(1500)
@pytest.mark.parametrize(
    ("rig", "procedure", "prefixes"),
    [("tsbs12", "amb-calibration",
      ("site", "geometry.amb", "geometry.com_to_out", "geometry.hook", "geometry.lever_left", "masses.M1", "masses.M4",
       "hanger", "mass_density", "i_yi", "amb_gap_i", "tilt", "hyst")),
     ("tsbs12", "torque-constant",
      ("site", "geometry.lever", "masses.M2", "masses.M3", "mass_density", "i_m1", "beta_4", "detent", "gamma",
       "segment_gain_0", "segment_drift_0", "segment_gain_1")),
     ("tsbs12", "spindown", ("polar", "ring", "viscous", "coulomb", "detent", "i_m1", "drive", "tilt")),
     ("amb5dof", "tracking", ("i_yi_n.offset", "i_zi_n.offset"))],  # coils that read alike: the one that carries most is either
)  # fmt: skip
def test_nothing_that_moves_a_result_is_kept_quiet(
    tmp_path: Path, rig: str, procedure: str, prefixes: tuple[str, ...]
) -> None:
    found = list(moved(procedure, rig, SEED, wanted(rig, prefixes), tmp_path))
    assert len(found) >= (2 if rig == "amb5dof" else 8)
    assert [f for f in found if f.end == "FAILS"] == []


def test_drawn_numbers_are_known_by_their_influences() -> None:
    """A name that leads to no influence would make everything fail, or nothing."""
    assert identity("i_yi_p.gain") == "sensors/i_yi_p/gain"
    assert identity("position_gain_yo") == "sensors/pos_yo/gain"
    assert identity("geometry.lever_left") == "geometry/lever_left"
    assert identity("asymmetry_o") == "machine/amb_asymmetry/o"
    assert identity("hanger") == "masses/hanger"
    assert numbers(load_rig("tsbs12"))["i_yi_p.gain"] == pytest.approx(1.009)
    assert numbers(load_rig("tsbs12"))["geometry.lever_left"] == pytest.approx(0.2303)


def test_a_number_that_each_weight_has_by_itself_is_known_by_all_of_its_plane() -> None:
    """Else every weight of a plane off by as much would stand in no budget."""

    def weight(number: int, what: str, plane: str) -> Influence:
        return Influence(f"weight/{number}/{what}", f"mass of the trial weight, {plane}", 1e-6, "kg", "B", "normal")

    one, two, three = weight(1, "kg", "upper"), weight(2, "kg", "lower"), weight(3, "kg", "upper")
    told = Estimate(1.0, "kg m", {one: 2.0, two: 3.0, three: -1.0, weight(1, "angle", "upper"): 5.0})
    assert shares("balancing.upper.weight_mass", told) == [(one, 2.0), (three, -1.0)]
    assert shares("balancing.upper.radius", told) == []
