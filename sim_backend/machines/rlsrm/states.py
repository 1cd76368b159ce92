"""States of a controller that positions axes (docs/reference/protocol.md): what a command does in each is the core's; here is
who may ask for it, whose silence is watched, and what becomes of a controller that was made safe."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Final

import numpy as np

from sim_backend.controller.ownership import Ownership
from sim_backend.controller.telemetry import Span
from sim_backend.core import Array
from sim_backend.machine import Machine
from sim_backend.machines.rlsrm.device import StagePlant, named

HELD: Final = ("HOLDING", "MOVING", "STOPPING")
RESTING: Final = ("OFF", "READY")
WITHOUT_CURRENT: Final = ("OFF", "FAULT")
ANY: Final = (*RESTING, "HOMING", *HELD, "FAULT")
OBEYED: Final = {
    "IDENTIFY": ANY, "MAKE_SAFE": ANY, "RELEASE": ANY, "CLEAR_FAULT": ("FAULT",), "ENABLE": ("OFF",), "DISABLE": RESTING,
    "HOME": ("READY",), "HOLD": ("READY",), "MOVE": ("HOLDING",), "STOP": ("HOMING", *HELD), "LET_GO": HELD,
}  # fmt: skip
"""In which states each command is."""
CORE: Final = {
    "ENABLE": "ready",
    "DISABLE": "off",
    "HOME": "home",
    "HOLD": "hold",
    "MOVE": "play",
    "STOP": "stop",
    "LET_GO": "let_go",
}


class StageStates:
    """As `sim_backend.controller.states.States`, of a stage."""

    stepwise: Final = False
    """The core sees by itself what its movements come to."""

    def __init__(
        self, plant: StagePlant, _machine: Machine, parameters: Mapping[str, float], owner: Ownership,
        fault_after_s: float = 0.0,
    ) -> None:  # fmt: skip
        self._plant, self._core, self._own, self._owner = plant, plant.core, parameters, owner
        self._planted_s = fault_after_s
        self._leaving = False  # MAKE_SAFE: OFF as soon as it was let go
        self._core.power_on()

    @property
    def state(self) -> str:
        """Of the core."""
        return self._core.state

    @property
    def fault(self) -> str:
        """The latched one."""
        return self._core.fault

    @property
    def watching(self) -> bool:
        """Whether a host that falls silent would be noticed."""
        return self._owner.armed and self.state not in WITHOUT_CURRENT

    @property
    def resting(self) -> bool:
        """Without currents, or nearly."""
        return self.state in RESTING

    @property
    def at_rest(self) -> bool:
        """Whether another host may take it over: what was made safe and is held waits for nobody."""
        return self.state in (*RESTING, "FAULT") or (self.state == "HOLDING" and self._core.heard < 0)

    def begin(self) -> None:
        """Before time passes: when the host was heard last."""
        self._core.set("watchdog_s", self._own["watchdog_s"])
        self._plant.hear(self._owner.heartbeat)

    def progress(self, _rows: Array) -> None:
        """What it does by itself at the present."""
        plant, tick = self._plant, self._plant.tick
        if self._planted_s and self.fault == "NONE" and tick * plant.tick_s > self._planted_s:
            self._core.fail("SENSOR")
        silent = (tick - self._owner.heartbeat) * plant.tick_s > self._own["watchdog_s"]
        if self.state == "READY" and self.watching and silent:
            self._core.fail("HEARTBEAT_LOST")
        if self.fault != "NONE":
            self._owner.armed = False
        if self._leaving and self.state == "READY":
            self._off()

    def spans(self, rows: Array, first_tick: int) -> list[Span]:
        """Rows with the states that they were in."""
        if not len(rows):
            return [Span(rows, first_tick, self.state, self.fault, self._owner.heartbeat, self._owner.armed)]
        changes = np.flatnonzero((rows[1:, -2:] != rows[:-1, -2:]).any(axis=1)) + 1
        parts = pairwise([0, *changes.tolist(), len(rows)])
        return [Span(rows[a:b], first_tick + a * self._plant.period_ticks, *named(rows[a]), self._owner.heartbeat,
                     self._owner.armed) for a, b in parts]  # fmt: skip

    def obey(self, name: str) -> bool:
        """Carry out a command, or refuse it in this state."""
        if self.state not in OBEYED.get(name, ()):
            return False
        match name:
            case "IDENTIFY":
                return True
            case "MAKE_SAFE":
                self._make_safe()
            case "RELEASE" if self.state not in WITHOUT_CURRENT and not (self.state == "HOLDING" and self.at_rest):
                return False
            case "RELEASE":
                self._owner.release()
            case "CLEAR_FAULT":
                self._core.command("clear")
                self._off()
            case _:
                return self._done(name)
        return True

    def _done(self, name: str) -> bool:
        if self._core.command(CORE[name]) != 0:
            return False
        self._leaving = False
        if name == "DISABLE":
            self._owner.armed = False
        elif not self._owner.armed:  # ENABLE; or what was made safe and held is taken up again
            self._owner.arm(self._plant.tick)
        return True

    def _make_safe(self) -> None:
        """Axes brake and are let go, or held; nobody is waited for any more."""
        self._core.command("safe")
        if self.state == "READY":
            self._off()
        elif self.state in HELD:
            self._leaving, self._owner.armed = True, False

    def _off(self) -> None:
        self._core.command("off")
        self._owner.armed, self._leaving = False, False


def states(
    plant: Any, machine: Machine, parameters: Mapping[str, float], owner: Ownership, planted_s: float
) -> StageStates:
    """What `SimulatedController` has in the place of `States`."""
    return StageStates(plant, machine, parameters, owner, planted_s)
