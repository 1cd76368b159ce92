"""The truth of one simulated rig: drawn for a seed from exactly the distributions that the rig file states.

The bench never sees any of it; tests and campaigns read `truth.json`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping

from bench.errors import ConfigError, Problem
from bench.rigfile import RigFile
from bench.rigfile.aliases import by_names
from bench.rigfile.check_machine import POSITIVE
from bench.rigfile.toleranced import Toleranced
from sim_backend.controller.controls import in_force
from sim_backend.draws import draw_one
from sim_backend.machine import Machine, Truth
from sim_backend.machines.table import machine_of
from sim_backend.unspoken import unspoken

BODIES = frozenset(("kg", "kg m^2", "N m^2/A^2", "H", "Ohm", "Hz"))
"""Units of what a machine has more of than none, where its rig file says so."""


def draw(
    rig: RigFile,
    seed: int,
    overrides: Mapping[str, float] | None = None,
    settings: Mapping[str, float] | None = None,
    *,
    visit: int = 0,
    stretch: int = 0,
) -> Truth:
    """Draw a rig. `overrides` set drawn values or defects by name, or the truth of the machine's `targets` directly.
    `settings` are the controller parameters that a procedure will write: the measurands hold for the bias among them. Another
    `visit` is the same machine on another day, another `stretch` a run on it that was stopped and goes on.

    Raises:
        ConfigError: an override names nothing, or is what no machine has; no machine can be made of the rig file.
    """
    machine = machine_of(rig)
    if lacking := tuple(unspoken(rig, machine)):
        raise ConfigError(f"rig {rig.name} cannot be simulated:", lacking)
    tolerances = machine.stated(rig)
    values = {n: draw_one(t, seed, n, visit if n in machine.daily else 0) for n, t in tolerances.items()}
    values |= {k: float(v) for k, v in rig.simulation.items() if isinstance(v, int | float)}
    defects = dict(machine.defects)
    # A drawn value goes before a quantity of the same name.
    own, given = {*values, *defects, *machine.targets}, dict(overrides or {})
    wanted = {k: v for k, v in given.items() if k in own}
    wanted |= by_names(rig.aliases, {k: v for k, v in given.items() if k not in own})
    used = in_force(rig, machine, settings or {})
    targets = {k: wanted.pop(k) for k in machine.targets if k in wanted}
    for name, value in wanted.items():
        table = defects if name in defects else values
        if name not in table:
            known = [*tolerances, *defects, *machine.targets]
            close = difflib.get_close_matches(name, known, 3)
            raise ConfigError(
                f"--truth {name}: no such value; {'did you mean' if close else 'expected one of'} {', '.join(close or known)}"
            )
        table[name] = float(value)
    if wrong := tuple(_impossible(rig, machine, wanted | targets, tolerances)):
        raise ConfigError(f"no machine of rig {rig.name} can be so:", wrong)
    if fixed := {k: float(v) for k, v in wanted.items() if k in rig.simulation and k not in tolerances}:
        # nothing draws these: the machine takes them from its rig file, by which its other numbers were drawn
        machine = machine_of(rig.model_copy(update={"simulation": {**rig.simulation, **fixed}}))
    for name, value in targets.items():
        values[machine.targets[name]] *= value / machine.quantities(machine.params(values, defects), used)[name]
    plant = machine.params(values, defects)
    quantities = machine.quantities(plant, used)
    return Truth(seed, values, defects, plant, quantities, machine, visit, stretch, frozenset(wanted))


def _impossible(
    rig: RigFile, machine: Machine, wanted: Mapping[str, float], tolerances: Mapping[str, Toleranced]
) -> Iterator[Problem]:
    """Values that are told and that nothing can have. What `[simulation]` would refuse is refused here too, in its words."""
    for name, value in wanted.items():
        t = tolerances.get(name)
        if not math.isfinite(value):
            yield Problem("--truth", name, f"{value:g}", "a finite number")
        elif (
            t is not None
            and t.value > 0 >= value
            and (
                t.unit in BODIES
                or (name.startswith("geometry.") and t.unit == "m")
                or name.rpartition(".")[2] in POSITIVE
            )
        ):
            yield Problem("--truth", name, f"{value:g} {t.unit}", "a positive number")
        elif name not in machine.defects and (told := machine.impossible(name, value)):
            yield Problem("--truth", name, *told)


def nominal(rig: RigFile) -> Mapping[str, float]:
    """Overrides that put every drawn value at what the rig file states."""
    return {name: t.value for name, t in machine_of(rig).stated(rig).items()}
