"""The machines that can be simulated; a rig file's simulation table chooses one."""

from __future__ import annotations

from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.machine import Machine
from sim_backend.machines.amb5dof.machine import AMB5DOF
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.machines.twin.machine import TWIN, twin

MACHINES = {machine.name: machine for machine in (TSBS, AMB5DOF)}


def machine_of(rig: RigFile) -> Machine:
    """The machine that `machine` in a rig file's simulation table names; a TSBS where it names none; a twin is made of the
    rig file.

    Raises:
        ConfigError: there is no such machine, or no twin can be made of the rig file.
    """
    name = rig.simulation.get("machine", TSBS.name)
    if name == TWIN:
        return twin(rig)
    if name not in MACHINES:
        raise ConfigError(
            f"rig {rig.name}: simulation.machine: found {name!r}; expected one of {', '.join((*MACHINES, TWIN))}"
        )
    return MACHINES[name]
