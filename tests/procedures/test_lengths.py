"""Lengths of a shaft in two bearings by the machine's tables, whatever the rig file calls the numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.rigfile import RigFile, load_rig
from procedures.amb_rotor.lengths import lengths_by_name
from procedures.bearing_model.inputs import as_printed, fit_inputs
from procedures.synchronous import facts

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RIGS = EXAMPLES.parent / "rigs"
OWN = {
    "com_to_inboard_amb": "arm_near",
    "com_to_outboard_sensor": "look_far",
    "com_to_outboard_balance": "disc_far",
    "com_to_coupling": "arm_spring",
    "coupling_stiffness": "spring_stiffness",
    "amb_gap": "air",
    "amb_span": "apart",
}


def called(folder: Path, names: dict[str, str]) -> RigFile:
    for kind in ("toml", "dbc"):
        text = (RIGS / f"amb5dof.{kind}").read_text()
        for old, new in names.items():
            text = text.replace(old, new)
        (folder / f"own.{kind}").write_text(text.replace("amb5dof.dbc", "own.dbc"))
    return load_rig(str(folder / "own.toml"))


def test_the_stand_s_lengths_are_those_of_its_tables_by_any_name(tmp_path: Path) -> None:
    stand, own = load_rig("amb5dof"), called(tmp_path, OWN)
    assert facts.stated(own)
    assert as_printed(own)
    by_names, by_own = facts.collect_lengths(stand), facts.collect_lengths(own)
    assert {k: (e.value, e.u) for k, e in by_own.items()} == {k: (e.value, e.u) for k, e in by_names.items()}
    assert [i.id for i in by_own["l_ia"].sensitivities] == ["geometry/arm_near"]
    of_fit = fit_inputs(stand, True), fit_inputs(own, True)
    assert {k: e.value for k, e in of_fit[0].items()} == {k: e.value for k, e in of_fit[1].items()}
    assert facts.clearance(own).value == facts.clearance(stand).value == 1e-4


def test_the_numbers_keep_their_identities_and_names() -> None:
    found = facts.collect_lengths(load_rig("amb5dof"))
    ((influence, _),) = found["l_iu"].sensitivities.items()
    assert (influence.id, influence.name) == ("geometry/com_to_inboard_balance", "com to inboard balance")


@pytest.mark.parametrize("path", ["plain-stand/stand.toml", "vertical-spindle/spindle.toml"])
def test_a_place_that_is_a_sum_is_no_single_length(path: str) -> None:
    rig = load_rig(str(EXAMPLES / path))
    assert "l_ia" not in lengths_by_name(rig)
    assert not facts.stated(rig)
