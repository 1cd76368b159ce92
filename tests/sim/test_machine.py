"""The rig file chooses the machine."""

from __future__ import annotations

import pytest

from bench.errors import ConfigError
from bench.rigfile import RigFile, load_rig
from sim_backend.machines.table import MACHINES, machine_of
from sim_backend.truth import draw

TSBS12: RigFile = load_rig("tsbs12")


def naming(machine: str) -> RigFile:
    return TSBS12.model_copy(update={"simulation": {**TSBS12.simulation, "machine": machine}})


def test_a_rig_file_that_names_none_is_a_tsbs() -> None:
    assert machine_of(TSBS12) is MACHINES["tsbs"]
    assert machine_of(naming("tsbs")) is MACHINES["tsbs"]
    assert dict(draw(naming("tsbs"), 7).values) == dict(draw(TSBS12, 7).values)


def test_an_unknown_machine_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"simulation\.machine: found 'tsbs13'; expected one of tsbs"):
        draw(naming("tsbs13"), 0)


@pytest.mark.parametrize("name", MACHINES)
def test_what_a_machine_says_of_itself_fits_together(name: str) -> None:
    machine = MACHINES[name]
    assert machine.name == name
    assert {"drop_fraction", "dead_after_s", "fault_after_s", "drive_fault_after_s", "integrator_factor"} <= (
        machine.defects.keys()
    )
