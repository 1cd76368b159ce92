"""A levitated machine behind a link that changes what comes and keeps what goes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.cli.safety import making_safe
from bench.cli.stage_safety import making_stage_safe
from bench.findings import Finding
from bench.link import Link, LinkStats
from bench.link.codec import Decoder, encode
from bench.link.frames import FrameBatch, payload
from bench.link.session import Session
from bench.rigfile import RigFile, load_rig
from bench.run.job import WatchedClock
from bench.run.supervisor import Supervisor
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

TSBS, AMB = load_rig("tsbs12"), load_rig("amb5dof")
Change = Callable[[FrameBatch], FrameBatch]


def unchanged(batch: FrameBatch) -> FrameBatch:
    return batch


class Hostile:
    """A link that changes what comes, keeps the commands that go, and can hush the heartbeats' lease for a look."""

    def __init__(self, rig: RigFile, link: Link) -> None:
        self._link, self.name, self.reopening = link, link.name, False
        self._command = Decoder(rig.messages["Command"])
        self._names = rig.messages["Command"].signal("code").choices
        self.change: Change = unchanged
        self.commands: list[str] = []
        self.leases = 0

    @property
    def stats(self) -> LinkStats:
        return self._link.stats

    def send(self, batch: FrameBatch) -> None:
        for one in batch[batch["id"] == self._command.message.identifier]:
            self.commands.append(self._names[int(self._command.decode_one(payload(one))["code"])])
        self._link.send(batch)

    def receive(self) -> FrameBatch:
        return self.change(self._link.receive())

    def renew_lease(self) -> None:
        self.leases += 1
        self._link.renew_lease()

    def close(self) -> None:
        self._link.close()


class Bench:
    """A simulated machine that is levitated, and who makes it safe."""

    def __init__(self, rig: RigFile = TSBS, **truth: float) -> None:
        self.rig = rig
        self.machine = SimulatedRig(rig, draw(rig, 2, truth), 1)
        self.link = Hostile(rig, self.machine.link)
        self.supervisor = Supervisor()
        self.base = WatchedClock(self.machine, self.link.renew_lease, self.supervisor.check)
        self.controller = Controller(rig, self.link, self.base, Session(1, 1_767_225_600, "test"))
        self.controller.connect()
        self.controller.enable()
        self.hold()

    def hold(self) -> None:
        """Lift it, or hold the axes of what does not levitate."""
        c = self.controller
        if c.stage is None:
            c.levitate()
        else:
            c.stage.home()
            c.stage.hold()

    def made_safe(self, change: Change, before_s: float = 1.5) -> tuple[tuple[Finding, ...], float]:
        """After so long of changed telemetry: findings, and how long it took by the bench's time."""
        self.controller.guarded = False
        self.link.change = change
        self.controller.clock.sleep(before_s)
        self.link.commands.clear()
        begin = self.machine.now_ns()
        if self.controller.stage is None:
            steps, aftermath = making_safe(self.controller, self.base)
        else:
            steps, aftermath = making_stage_safe(self.controller, self.base)
        found = self.supervisor.make_safe(steps, self.machine.now_ns) + aftermath()
        return found, (self.machine.now_ns() - begin) * 1e-9

    @property
    def state(self) -> str:
        return self.machine.device.state

    @property
    def said(self) -> list[str]:
        return [name for name in self.link.commands if name != "IDENTIFY"]


class Telemetry:
    """Telemetry that says what it is told: signals `fixed` to a value, those `frozen` as they were, everything else too
    where it is `stuck`, and messages that are `lost`."""

    def __init__(self, rig: RigFile, fixed: dict[str, float] | None = None, frozen: tuple[str, ...] = ("seq", "tick"),
                 lost: tuple[str, ...] = (), stuck: bool = True) -> None:  # fmt: skip
        m = self._message = rig.messages["Telemetry"]
        place = {s.name: slice(s.start // 8, (s.start + s.length) // 8) for s in m.signals}
        told = np.frombuffer(encode(m, fixed or {}), np.uint8)
        self._told = {name: (place[name], told[place[name]]) for name in fixed or {}}
        running = {"seq", "tick", "host_age"} - {*frozen}
        self._kept = [place[n] for n in place if n not in running and (stuck or n in frozen)]
        self._lost = [rig.messages[name].identifier for name in lost]
        self._first: FrameBatch | None = None

    def __call__(self, batch: FrameBatch) -> FrameBatch:
        batch = batch[~np.isin(batch["id"], self._lost)].copy()
        ours = batch["id"] == self._message.identifier
        data = batch["data"][ours]
        if len(data) and self._first is None:
            self._first = data[0].copy()
        for place in self._kept if self._first is not None else []:
            data[:, place] = self._first[place]
        for place, told in self._told.values():
            data[:, place] = told
        batch["data"][ours] = data
        return batch
