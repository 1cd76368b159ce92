"""The rig file chooses the machine."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_rigfile import DBC, TOML, of_schema_1

from bench.errors import ConfigError
from bench.rigfile import RigFile, load_rig
from sim_backend.machines.table import MACHINES, machine_of
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.machines.twin.machine import TWIN
from sim_backend.truth import draw

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STAND = EXAMPLES / "plain-stand/stand.toml"
TSBS12: RigFile = load_rig("tsbs12")


def naming(machine: str) -> RigFile:
    return TSBS12.model_copy(update={"simulation": {**TSBS12.simulation, "machine": machine}})


def test_a_rig_file_that_names_none_has_a_twin() -> None:
    stand = load_rig(str(STAND))
    unnamed = {key: value for key, value in stand.simulation.items() if key != "machine"}
    assert machine_of(TSBS12) is TSBS
    assert machine_of(stand.model_copy(update={"simulation": unnamed})).name == TWIN
    bare = draw(stand.model_copy(update={"simulation": {"readings": stand.simulation["readings"]}}), 7)
    assert bare.machine.name == TWIN
    assert bare.values["beta.y_vorn"] != draw(stand, 7).values["beta.y_vorn"]  # by rule, not by [simulation]


@pytest.mark.parametrize("schema", [1, 2])
def test_a_file_with_the_numbers_of_a_tsbs_is_the_tsbs_that_it_was(schema: int) -> None:
    toml = TOML.replace('machine = "tsbs"\n', "")
    file = RigFile.parse(toml if schema == 2 else of_schema_1(toml), DBC)
    assert "machine" not in file.simulation
    assert machine_of(file) is TSBS


def test_what_no_twin_can_be_made_of_is_told_what_it_lacks() -> None:
    with pytest.raises(ConfigError, match=r"shaft\.mass.*--backend live"):
        draw(load_rig(str(EXAMPLES / "own-controller/plainamb.toml")), 0)


def test_an_unknown_machine_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"simulation\.machine: found 'tsbs13'; expected one of tsbs"):
        draw(naming("tsbs13"), 0)


@pytest.mark.parametrize("name", MACHINES)
def test_what_a_machine_says_of_itself_fits_together(name: str) -> None:
    machine = machine_of(naming(name))
    assert machine.name == name
    assert {"drop_fraction", "dead_after_s", "fault_after_s", "drive_fault_after_s", "integrator_factor"} <= (
        machine.defects.keys()
    )
