"""What is looked at each time a link was read: silence, counters that stand, faults, other hosts, heartbeats that come late."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bench.errors import ClockWrong, ReadingsStand, StateContradicts
from bench.link import Link, clockrate
from bench.link.frames import FrameBatch, payload
from bench.link.health import CHECK
from bench.link.stillness import STILL_S, StuckChannels
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile
from bench.samples import SampleBlock
from bench.wire import sign
from drivers import unheard, waiting
from drivers.condition import Condition
from drivers.hosts import HostFrames

HOST_AGE = "host_age"


class Watch:
    """Of one controller. `now_ns` is the host's time; a poll later than `stall_ns` after the one before is a bench that stood
    still.

    Attributes:
        condition: mode and fault by the newest telemetry.
        hosts: frames of hosts that came in.
        host_age_s: the greatest age of a heartbeat while the machine was on.
        stuck: channels whose readings stood.
        patience_s: how long a controller may say nothing.
        simulated: whether the controller says that it is, by its serial number or the sign of a served one: its clock is that
            of a computer, which may run evenly slow.
    """

    def __init__(
        self,
        rig: RigFile,
        link: Link,
        telemetry: TelemetryDecoder,
        session: int,
        now_ns: Callable[[], int],
        stall_ns: int,
    ) -> None:
        self._rig, self._link, self._telemetry, self._now_ns, self._stall_ns = rig, link, telemetry, now_ns, stall_ns
        self.condition = Condition(rig, telemetry)
        self.hosts = HostFrames(rig, session, lambda: link.stats.heartbeats)
        self.stuck = StuckChannels(rig)
        self.patience_s = waiting.patience_s(rig)
        self.host_age_s = 0.0
        self.simulated = self._simulated = False
        self._last_ns = self._polled_ns = now_ns()
        self._heard = unheard.Heard.of(link)  # what had come when telemetry came last

    def taken(self, batch: FrameBatch) -> FrameBatch:
        """What the link brought, with the frames of hosts marked as sent."""
        for k in np.flatnonzero(batch["id"] == sign.IDENTIFIER):
            self.simulated = self.simulated or sign.simulated(int(batch["id"][k]), payload(batch[k]))
        return self.hosts.marked(batch)

    def begin(self) -> None:
        """The controller is ours from now on, and what it is is known."""
        self._simulated = self.simulated
        self.hosts.forget()
        self._last_ns = self._now_ns()

    def polled(self) -> None:
        """The link is about to be read."""
        now = self._now_ns()
        if now - self._polled_ns > self._stall_ns:  # the bench stood still: the link has had no chance to be heard
            self._last_ns += now - self._polled_ns
        self._polled_ns = now

    def came(self, blocks: Sequence[SampleBlock], recording: bool) -> None:
        """New samples, if any."""
        for block in blocks:
            self.stuck.take(block)
        if blocks:
            self._last_ns, self._heard = self._now_ns(), unheard.Heard.of(self._link)
        self.condition.look(self._polled_ns)
        if recording and self.condition.mode not in ("OFF", "FAULT"):
            ages = [float(b.columns[HOST_AGE].max()) for b in blocks if HOST_AGE in b.columns]
            self.host_age_s = max([self.host_age_s, *ages])

    @property
    def silent_s(self) -> float:
        """How long no telemetry had come when it was looked for last."""
        return max(0, self._polled_ns - self._last_ns) * 1e-9

    def check(self) -> None:
        """Raise unless all is well.

        Raises:
            LinkError: no telemetry for half a second (`drivers.waiting.patience_s`); BytesUnreadable where bytes come.
            AnotherHost: `HostFrames.check`.
            ClockWrong: the clock of a real controller is off by a per cent or more; a simulated one's is told in the end.
            StateContradicts: a simulation says only now that it is one; and as `Condition.check` says.
            DeviceFault, FrozenError: `Condition.check`.
            ReadingsStand: readings had noise, and all have stood for a second.
        """
        patience_s = self.patience_s + (self._rig.link.reconnect_s if self._link.reopening else 0.0)
        if self.silent_s > patience_s and not self._frames_come:
            text = f"no telemetry for {self.silent_s:.2f} s; the link or the controller is lost"
            raise unheard.error(self._link, self._heard, self.silent_s, text)
        self.hosts.check()
        if self.simulated and not self._simulated:
            raise StateContradicts(
                "the controller says that it is a simulated one, and did not when the run began: nobody knows what was measured"
            )
        self.condition.check()
        if not self.simulated and (ppm := self._telemetry.host.rate.certain_ppm) is not None:
            raise ClockWrong(f"{clockrate.described(ppm)}. {CHECK}")
        if self.stuck.all_stand:
            raise ReadingsStand(
                f"all readings with noise have stood for {STILL_S:g} s or more while tick and sequence went on; nobody knows "
                "what the machine does"
            )

    @property
    def _frames_come(self) -> bool:
        """Whether telemetry comes that says nothing new: `Condition.check` waits a while, and calls it by its name."""
        return self._polled_ns - self._telemetry.stillness.newest_ns < self.patience_s * 1e9
