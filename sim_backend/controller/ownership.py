"""Which host the simulated controller obeys, and whether that host is alive (docs/reference/protocol.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sim_backend.core import TICK_S

TAKEOVER_S = 1.0
NAME_PARTS = tuple(f"name{k}" for k in range(9))


@dataclass
class Ownership:
    """The owner's session (0: nobody), its claim, and the tick of its last heartbeat that counted."""

    session: int = 0
    since: int = 0
    name: Mapping[str, float] = field(default_factory=dict)
    heartbeat: int = 0
    counter: int = -1
    armed: bool = False
    tick_s: float = TICK_S
    obeyed: dict[str, tuple[Mapping[str, float], str]] = field(default_factory=dict)
    """The owner's last request of a kind, and the status that it was answered with: one that comes again is not executed."""

    def repeated(self, message: str, values: Mapping[str, float]) -> str:
        """The status of the owner's last request of that kind, if this one is the same, token and all; else nothing."""
        last, status = self.obeyed.get(message, ({}, ""))
        return status if last == values else ""

    def answered(self, message: str, values: Mapping[str, float], status: str) -> None:
        """Keep what a request of the owner was answered with."""
        self.obeyed[message] = values, status

    def takes(self, session: int, tick: int, resting: bool) -> bool:
        """Whether a session may command. A free controller is taken by the first that asks; one whose owner has been
        silent for a second is free again while its rotor rests."""
        gone = resting and (tick - self.heartbeat) * self.tick_s > TAKEOVER_S
        if not session or (self.session not in (0, session) and not gone):
            return False
        if self.session != session:
            self.release()
            self.session, self.heartbeat = session, tick
        return True

    def claim(self, values: Mapping[str, float], tick: int, resting: bool) -> dict[str, float]:
        """Answer a Claim: the values of Owner."""
        if self.takes(int(values["session"]), tick, resting):
            self.since = int(values["since"])
            self.name = {part: values[part] for part in NAME_PARTS}
        return {"session": self.session, "since": self.since, **self.name}

    def beat(self, session: int | None, counter: int, tick: int) -> None:
        """Take the owner's heartbeat, or, where heartbeats have no session, that of the one host that there is; one whose
        counter stands still shows no life, and nobody becomes owner by one."""
        mine = session is None or (self.session != 0 and session == self.session)
        if mine and counter != self.counter:
            self.heartbeat, self.counter = tick, counter

    def arm(self, tick: int) -> None:
        """The watchdog watches from here on; the command that leaves OFF is itself a sign of life."""
        self.armed, self.heartbeat = True, tick

    def may_write(self, session8: int) -> bool:
        """Whether a parameter write with this low byte of a session comes from the owner."""
        return bool(self.session) and self.session & 0xFF == session8

    def release(self) -> None:
        """Nobody owns the controller."""
        self.session, self.since, self.name, self.counter, self.armed, self.obeyed = 0, 0, {}, -1, False, {}
