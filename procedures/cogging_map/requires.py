"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from collections.abc import Iterator

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.sweeps import loops
from procedures.position_loops.injection import ability
from procedures.position_loops.motors import motors, periods_of

DEFAULTS = Plan.model_validate({})


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    can, driving = rig.capabilities.loop_injection, rig.capabilities.force_currents
    wanted = ("loop_injection", "force_currents", "motion")
    if can is None or not driving or rig.capabilities.motion is None:
        return Requires(capabilities=wanted)
    of = {name: one for name, one in driving.items() if one.cogging}
    shown = tuple(dict.fromkeys(can.loops[one.loop].channel for one in of.values()))
    return Requires(
        channels=(*shown, *(one.current for one in of.values()), STATE),
        sensors=tuple(c for name in of for c in rig.motors[name].currents),
        machine=periods_of(rig, "machine", of),
        geometry=periods_of(rig, "geometry", of),
        capabilities=wanted,
        lacks=tuple(_lacks(rig)),
    )


def _lacks(rig: RigFile) -> Iterator[str]:
    if not loops(rig, DEFAULTS):
        yield "capabilities.force_currents: found no cogging of a motor whose loop a set point moves"
    for loop in loops(rig, DEFAULTS):
        if not ability(rig).loops[loop].inertia:
            yield f"capabilities.loop_injection.loops.{loop}: found no inertia"
        some = motors(rig, loop)
        for name, one in some.items():
            if one.constant is None:
                yield f"capabilities.force_currents.{name}.constant: found none"
        if len({(one.cogging, one.period) for one in some.values()}) > 1:
            yield f"capabilities.force_currents: found motors of {loop} with another period of cogging each"
