"""The live rig: devices in roles, one clock, and what looks after them while a procedure sleeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.clock import Clock
from bench.procedure.roles import Capture, Drive, Levitation, Motion, Operator, Rotation, Supply, Thermal
from bench.rigfile import RigFile

if TYPE_CHECKING:  # every procedure imports this module, and a listing of them needs no link
    from bench.link.health import Health
    from bench.link.telemetry import Counters


@dataclass
class Rig:
    """What `acquire` gets. `close` releases the links; `counters` are the telemetry's; `health` is the whole link's."""

    file: RigFile
    clock: Clock
    levitation: Levitation
    rotation: Rotation
    operator: Operator
    counters: Counters
    health: Callable[[], Health]
    close: Callable[[], None]
    drive: Drive | None = None
    supply: Supply | None = None
    thermal: Thermal | None = None
    capture: Capture | None = None
    motion: Motion | None = None  # of a machine that does not levitate
