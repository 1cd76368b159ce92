"""A host with a clock of its own, and the link of a simulated machine whose time is another one."""

from __future__ import annotations

from bench.rigfile import load_rig
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("tsbs12")


class HostClock:
    """Clock and link in one, as `Controller` takes them; what comes in, and how far the machine runs, is the subclass's."""

    def __init__(self) -> None:
        self.machine = SimulatedRig(RIG, draw(RIG, 2), 1)
        self._now = self.machine.now_ns()
        self.name, self.stats, self.reopening = self.machine.link.name, self.machine.link.stats, False
        self.send, self.close = self.machine.link.send, self.machine.link.close
        self.renew_lease = self.machine.link.renew_lease

    def now_ns(self) -> int:
        return self._now
