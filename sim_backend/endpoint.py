"""The in-process end of a link, its clock and the operator: no threads, no wall clock. Sleeping advances the machine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bench.errors import LinkError
from bench.link import LinkStats
from bench.link.codec import encode
from bench.link.fault_injection import CUTS, Fault, divided, of_a_line
from bench.link.frame_faults import FrameFaults, lost
from bench.link.frames import ERROR, FD, SENT, FrameBatch, batch_of, by_time, empty_batch, joined, packed
from bench.link.payloads import put
from bench.rigfile import RigFile
from bench.rigfile.messages import load_messages
from sim_backend.controller.controller import SimulatedController
from sim_backend.machine import Truth

EPOCH_NS = 1_767_225_600 * 10**9  # 2026-01-01T00:00:00Z
HEARTBEAT_S = 0.02  # where the DBC states no period
LEASE_NS = 1_000_000_000


class SimulatedRig:
    """A simulated rig in this process. It is the rig's clock, its link (`link`) and its operator's line (`request`).

    Args:
        rig: the rig file.
        truth: which machine it is.
        session: of its heartbeat.
        faults: of its controller and of its link (`bench.link.fault_injection`); the truth's noise says which frames they hit.
        substeps: integration steps of the plant in a tick.
        start_ns: when it is switched on.
    """

    def __init__(
        self,
        rig: RigFile,
        truth: Truth,
        session: int = 1,
        faults: Sequence[Fault] = (),
        substeps: int = 2,
        start_ns: int = EPOCH_NS,
    ) -> None:
        on_link, in_device = divided(faults, simulated=True)
        if truth.machine.controller is not None:
            on_link, in_device = of_a_line(on_link, in_device)
        self.device = (truth.machine.controller or SimulatedController)(rig, truth, in_device, substeps)
        self.truth = truth
        self._now = start_ns
        self.link = InProcessLink(rig, self, session, on_link)
        self._operator = truth.machine.operator(rig, self.device.plant, truth)

    def now_ns(self) -> int:
        """The present, UNIX ns of the virtual clock."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the machine. Frames queued on the link are applied at their due tick."""
        ticks = round(seconds * 1e9 / self.device.tick_ns)
        if ticks:
            self.link.exchange(self.device, ticks, self._now)
            self._now += ticks * self.device.tick_ns

    def request(self, line: str) -> str:
        """The operator's line: `hang M2`, `hang -`, `ask TEXT`."""
        return self._operator.request(line)


class InProcessLink:
    """A `bench.link.Link` whose other end is in this process."""

    def __init__(self, rig: RigFile, clock: SimulatedRig, session: int, faults: Sequence[Fault] = ()) -> None:
        self._clock = clock
        self._heartbeat = message = load_messages(rig.dbc_text, classic=rig.link.classic)[rig.binding.heartbeat]
        owned = {"session": session} if any(s.name == "session" for s in message.signals) else {}
        self._beat = np.frombuffer(encode(message, owned), np.uint8)[None]
        self._count_at = message.signal(rig.binding.heartbeat_counter)
        self._period_ns = round((message.period_s or HEARTBEAT_S) * 1e9)
        self._flags = SENT | (FD if message.fd else 0)
        self._queued: list[FrameBatch] = []
        self._arrived: list[FrameBatch] = []
        self._lease_until = 0
        self._next_beat = self._begun = clock.now_ns()
        self._counter = 0
        self._dead_after = clock.truth.defects["dead_after_s"]
        self.name = rig.devices["controller"].link
        self._reconnect_s = rig.link.reconnect_s
        self._counts = LinkStats()
        self._inward = FrameFaults(faults, clock.truth.noise)
        self._outward = FrameFaults([f for f in faults if f.kind in ("stall", *CUTS)], clock.truth.noise)

    @property
    def stats(self) -> LinkStats:
        """Counts since the start."""
        return self._inward.counted(self._counts, self._clock.now_ns())

    @property
    def _dead(self) -> bool:
        return bool(self._dead_after) and self._clock.now_ns() - self._begun > self._dead_after * 1e9

    @property
    def reopening(self) -> bool:
        """Whether a disconnect is at work that the link would mend."""
        return bool(self._reconnect_s) and self._inward.active("disconnect", self._clock.now_ns())

    def send(self, batch: FrameBatch) -> None:
        """Queue frames for the next slice, due now.

        Raises:
            LinkError: the link is dead (a planted defect), or cut by a fault.
        """
        if self._dead:
            raise LinkError(f"link {self.name}: lost; nothing can be sent")
        now = self._clock.now_ns()
        if (cut := self._inward.cut(now)) is not None:
            raise lost(self.name, cut)
        batch = batch.copy()
        batch["t_ns"] = now
        self._queued.append(batch)
        self._counts.sent += len(batch)

    def receive(self) -> FrameBatch:
        """Everything that arrived since the last call; nothing when the link is dead.

        Raises:
            LinkError: cut by a fault; what arrived before comes first.
        """
        batch = empty_batch() if self._dead else joined(self._arrived)
        batch, later, cut = self._inward.up_to_cut(batch, self._clock.now_ns(), self._reconnect_s)
        self._arrived = [later]
        if cut is not None:
            raise lost(self.name, cut)
        self._counts.received += len(batch)
        self._counts.error_frames += int(np.count_nonzero(batch["flags"] & ERROR))
        return batch

    def renew_lease(self) -> None:
        """Heartbeats go on for one more second of bench time."""
        self._lease_until = self._clock.now_ns() + LEASE_NS

    def close(self) -> None:
        """Stop heartbeats."""
        self._lease_until = 0

    def exchange(self, device: SimulatedController, ticks: int, now_ns: int) -> None:
        """One slice: queued frames and heartbeats to the device, what it sends back."""
        end = now_ns + ticks * device.tick_ns
        beats = self._beats(now_ns, end)
        self._counts.heartbeats += len(beats)
        self._counts.sent += len(beats)
        incoming = beats
        if self._queued:
            incoming = by_time(joined([*self._queued, beats]))
        self._queued = []
        if len(incoming):
            self._inward.start(int(incoming["t_ns"][0]))
            self._outward.start(int(incoming["t_ns"][0]))
        heard = self._outward.apply(incoming, end - 1)
        self._arrived.append(self._inward.apply(device.advance(ticks, heard, now_ns), end))

    def _beats(self, begin_ns: int, end_ns: int) -> FrameBatch:
        """The heartbeats of a slice, while the lease lasts."""
        due = range(self._next_beat, end_ns, self._period_ns)
        self._next_beat += len(due) * self._period_ns
        times = [t for t in due if begin_ns <= t <= self._lease_until and not self._dead]
        if not times:
            return empty_batch()
        payloads = np.tile(self._beat, (len(times), 1))
        put(payloads, self._count_at, np.arange(len(times), dtype=np.uint64) + np.uint64(self._counter + 1))
        self._counter += len(times)
        identifier, flags = self._heartbeat.identifier, self._flags
        return batch_of(
            packed(identifier, payload.tobytes(), t_ns=t, flags=flags)
            for t, payload in zip(times, payloads, strict=True)
        )
