"""What a rig must have for a procedure, whatever the plan: declared as data, held against the rig file before the start."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from bench.errors import ConfigError, Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities import is_bound as can
from bench.rigfile.roles import is_bound, resolved

TURNERS = frozenset(("drive", "rotation", "motion"))
"""Roles of what turns a shaft; a stage may turn by itself, and lacks a drive for what asks for one."""


@dataclass(frozen=True)
class Requires:
    """Names that the rig file must have: roles of its devices, channels (or roles of readings, `bench.rigfile.roles`), sensors
    with certificates, parameters of the controller (with a dot: what none is bound to), lengths and stiffnesses of `geometry`,
    numbers of `machine`, channels that the controller can `capture` in its own memory, `capabilities` by their keys
    (`bench.rigfile.capabilities`), and, with `masses`, certified ones to hang. `lacks` is what else was found missing, a line
    each. `uses` are the keys of capabilities, and "capture", that are merely used: without them less is measured, or as the
    controller is set."""

    roles: tuple[str, ...] = ("levitation",)
    channels: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    geometry: tuple[str, ...] = ()
    machine: tuple[str, ...] = ()
    capture: tuple[str, ...] = ()
    capabilities: tuple[str, ...] = ()
    masses: bool = False
    lacks: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()

    def lacking(self, rig: RigFile) -> tuple[str, ...]:
        """What the rig does not have, one line a table; nothing where it can run the procedure."""
        return tuple(self._lacking(rig))

    def _lacking(self, rig: RigFile) -> Iterator[str]:
        roles = {role for device in rig.devices.values() for role in device.roles}
        if missing := [r for r in self.roles if r not in roles]:
            none = f"devices: found none in the role {' and none in the role '.join(missing)}"
            yield (
                f"nothing turns it; {none}"
                if {"drive", "rotation"} & {*missing} and TURNERS.isdisjoint(roles)
                else none
            )
        needed = resolved(rig, (name for name in self.channels if "." not in name or is_bound(rig, name)))
        if absent := [role.partition(".")[2] for role in self.channels if "." in role and not is_bound(rig, role)]:
            yield f"mark: found no channel for {', '.join(dict.fromkeys(absent))}"
        tables: tuple[tuple[str, tuple[str, ...], Collection[str]], ...] = (
            ("channels", needed, rig.channels),
            ("sensors", self.sensors, rig.sensors),
            ("parameters", tuple(name for name in self.parameters if "." not in name), rig.parameters),
            ("geometry", self.geometry, rig.geometry),
            ("machine", self.machine, rig.machine),
        )
        for table, names, found in tables:
            if missing := [n for n in dict.fromkeys(names) if n not in found]:
                yield f"{table}: found no {', '.join(missing)}"
        unbound = [key for key in dict.fromkeys(self.capabilities) if not can(rig.capabilities, key)]
        if unbound := [*unbound, *(name for name in dict.fromkeys(self.parameters) if "." in name)]:
            yield f"capabilities: found no {', '.join(unbound)}"
        if self.capture and rig.capture is None:
            yield "capture: found none; expected a controller that records at its full rate"
        elif missing := [
            n for n in dict.fromkeys(self.capture) if rig.capture is None or n not in rig.capture.channels
        ]:
            yield f"capture.channels: found no {', '.join(missing)}"
        if self.masses and not rig.masses:
            yield "masses: found none; expected certified masses to hang"
        yield from self.lacks


def lacking(requires: Callable[[RigFile], Requires], rig: RigFile) -> tuple[str, ...]:
    """What a rig does not have of what a procedure `requires`, one line a table of its file; nothing where it can run it."""
    try:
        return requires(rig).lacking(rig)
    except Lacking as error:
        return error.lines
    except ConfigError as error:  # a DBC that cannot be read, which `bench check` names by itself
        return (str(error),)
