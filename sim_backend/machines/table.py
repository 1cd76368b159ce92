"""The machines that can be simulated, ours and those of installed packages; a rig file's simulation table chooses one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib import import_module
from typing import Any, cast

from bench import extensions
from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.machine import Machine

OF_TSBS = "slope_i"  # that no simulated TSBS can be without
TSBS, TWIN = "tsbs", "twin"
MACHINES = {TSBS: "tsbs.machine.TSBS", "tsbs6": "tsbs.six.TSBS6", "amb5dof": "amb5dof.machine.AMB5DOF",
            "amb1dof": "amb1dof.machine.AMB1DOF", "lira": "lira.machine.LIRA", "rlsrm": "rlsrm.machine.RLSRM"}  # fmt: skip
"""Of ours by name, its module in this folder and its name there: a process loads the machine that it simulates alone."""


def machine_of(rig: RigFile) -> Machine:
    """The machine that `machine` in a rig file's simulation table names; where it names none, and where there is no such table,
    a twin, which is made of the rig file. A table without a name that has the numbers of a TSBS is of before there were twins.

    Raises:
        ConfigError: there is no such machine, its name is taken twice, a package's cannot be loaded, or no twin can be made of
            the rig file.
    """
    name = rig.simulation.get("machine", TSBS if OF_TSBS in rig.simulation else TWIN)
    point = extensions.found(extensions.MACHINES, str(name), _owner(name))
    if point is not None:
        return _of_package(point)
    if name == TWIN:
        return _twin(rig)
    if name not in MACHINES:
        known = (*MACHINES, TWIN, *extensions.names(extensions.MACHINES, dict.fromkeys((*MACHINES, TWIN), "")))
        raise ConfigError(f"rig {rig.name}: simulation.machine: found {name!r}; expected one of {', '.join(known)}")
    return _ours(name)


def _owner(name: object) -> str:
    """The module that holds a machine of ours; "" where it is none."""
    return "sim_backend.machines.table" if name in MACHINES or name == TWIN else ""


@cache
def _ours(name: str) -> Machine:
    module, _, attribute = MACHINES[name].rpartition(".")
    return cast(Machine, getattr(import_module(f"sim_backend.machines.{module}"), attribute))


@cache
def _of_package(point: extensions.Point) -> Machine:
    """A package's machine; what its functions raise before it runs is an error that says whose it is."""
    machine, whose = extensions.load(point, Machine), f"machine {point.name!r} of {point.owner}"
    if machine.name != point.name:
        raise ConfigError(f"{whose}: found the name {machine.name!r} in it; expected that of its entry point. "
                          "Next: tell who wrote the package")  # fmt: skip
    names = ("stated", "params", "quantities", "make")
    calls: dict[str, Any] = {name: extensions.guarded(getattr(machine, name), whose) for name in names}
    return replace(machine, **calls)


def _twin(rig: RigFile) -> Machine:
    from sim_backend.machines.twin.machine import twin

    try:
        return twin(rig)
    except ConfigError as error:
        if rig.simulation:
            raise
        raise ConfigError(f"{error}. Without [simulation] a rig is simulated by what its file says of it; a run on the rig "
                          "itself is --backend live") from error  # fmt: skip
