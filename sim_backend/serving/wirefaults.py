"""Injected faults between the served controller and its clients: what they do to frames, bytes and ports."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from bench.link.fault_injection import Fault
from bench.link.frame_faults import FrameFaults
from bench.link.frames import FrameBatch, empty_batch
from sim_backend.serving.peers import joined


class WireFaults:
    """The faults of the CAN bus and of the serial port alike; `corrupt` destroys frames there and flips bits here.

    Args:
        faults: of the link (see `bench.link.fault_injection.divided`); times count from the first frame that a host sends.
        seed: of which frames are hit.
        telemetry: identifiers of telemetry.
    """

    def __init__(self, faults: Sequence[Fault] = (), seed: int = 0, telemetry: Collection[int] = ()) -> None:
        self._can = FrameFaults(faults, seed, telemetry=telemetry)
        self._serial = FrameFaults(faults, seed, telemetry=telemetry, bytewise=True)
        self._any = bool(faults)
        self._held: list[FrameBatch] = []
        self._now = 0

    def heard(self, frames: FrameBatch, now_ns: int) -> FrameBatch:
        """What reaches the controller of what hosts sent; once a slice, also without frames."""
        if not self._any:
            return frames
        self._now = now_ns
        if len(frames):
            self._can.start(now_ns)
            self._serial.start(now_ns)
        if self.unplugged or self.bus_off():
            return empty_batch()
        self._held.append(frames)
        if self._can.active("stall", now_ns):
            return empty_batch()
        frames, self._held = joined(self._held), []
        return frames

    def said(self, batch: FrameBatch, now_ns: int) -> tuple[FrameBatch, FrameBatch]:
        """What comes of what the controller sent: on the CAN bus, and at the serial port."""
        if not self._any:
            return batch, batch
        return self._can.apply(batch, now_ns), self._serial.apply(batch, now_ns)

    def corrupt(self, data: bytes) -> bytes:
        """Packets as the serial line brings them."""
        return self._serial.corrupt_packets(data, self._now) if self._any else data

    @property
    def unplugged(self) -> bool:
        """Whether the endpoints are gone."""
        return self._any and self._can.active("disconnect", self._now)

    def bus_off(self) -> bool:
        """Whether adapters are off the bus."""
        return self._any and self._can.active("bus-off", self._now)
