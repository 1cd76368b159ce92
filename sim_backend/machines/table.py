"""The machines that can be simulated; a rig file's simulation table chooses one."""

from __future__ import annotations

from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.machine import Machine
from sim_backend.machines.amb1dof.machine import AMB1DOF
from sim_backend.machines.amb5dof.machine import AMB5DOF
from sim_backend.machines.lira.machine import LIRA
from sim_backend.machines.rlsrm.machine import RLSRM
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.machines.tsbs.six import TSBS6
from sim_backend.machines.twin.machine import TWIN, twin

OF_TSBS = "slope_i"  # that no simulated TSBS can be without
MACHINES = {machine.name: machine for machine in (TSBS, TSBS6, AMB5DOF, AMB1DOF, LIRA, RLSRM)}


def machine_of(rig: RigFile) -> Machine:
    """The machine that `machine` in a rig file's simulation table names; where it names none, and where there is no such table,
    a twin, which is made of the rig file. A table without a name that has the numbers of a TSBS is of before there were twins.

    Raises:
        ConfigError: there is no such machine, or no twin can be made of the rig file.
    """
    name = rig.simulation.get("machine", TSBS.name if OF_TSBS in rig.simulation else TWIN)
    if name == TWIN:
        return _twin(rig)
    if name not in MACHINES:
        raise ConfigError(
            f"rig {rig.name}: simulation.machine: found {name!r}; expected one of {', '.join((*MACHINES, TWIN))}"
        )
    return MACHINES[name]


def _twin(rig: RigFile) -> Machine:
    try:
        return twin(rig)
    except ConfigError as error:
        if rig.simulation:
            raise
        raise ConfigError(f"{error}. Without [simulation] a rig is simulated by what its file says of it; a run on the rig "
                          "itself is --backend live") from error  # fmt: skip
