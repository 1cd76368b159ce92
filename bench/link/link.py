"""The link protocol: what every transport to a controller offers, real or in-process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from bench.link.frames import FrameBatch


@dataclass
class LinkStats:
    """What was counted between the wire and the buffer. All but the first two are zero on a clean link."""

    received: int = 0  # frames
    sent: int = 0  # frames, heartbeats included
    crc_errors: int = 0  # packets whose CRC fails
    malformed: int = 0  # packets or lines that cannot be taken apart, and frames of an impossible length
    packets_lost: int = 0  # by the packets' own sequence numbers
    error_frames: int = 0  # destroyed frames that the interface reports
    refused: int = 0  # frames or commands that the interface refuses to send
    adapter_overruns: int = 0  # times that the adapter told of frames it lost itself
    overflows: int = 0  # frames dropped because nobody took them from the buffer
    bus_off: int = 0
    reconnects: int = 0
    heartbeats: int = 0
    longest_heartbeat_gap_ns: int = 0
    octets: int = 0  # bytes that came, where the link is a stream of bytes, without an adapter's own answers


class Link(Protocol):
    """A transport that carries frames in both directions. Only this differs between a real and a simulated rig."""

    @property
    def name(self) -> str:
        """The link's name in the rig file; its frames are recorded under `/raw/<name>`."""
        ...

    @property
    def stats(self) -> LinkStats:
        """Counts since the link was opened."""
        ...

    @property
    def reopening(self) -> bool:
        """Whether the transport is lost and being opened again."""
        ...

    def send(self, batch: FrameBatch) -> None:
        """Queue frames for sending, in order.

        Raises:
            LinkError: the link is lost or its queue stays full.
        """
        ...

    def receive(self) -> FrameBatch:
        """Everything that arrived since the last call; never waits.

        Raises:
            LinkError: the link is lost.
        """
        ...

    def renew_lease(self) -> None:
        """Let the heartbeat run on for one more second. Without it the controller's watchdog lands the rotor."""
        ...

    def close(self) -> None:
        """Stop the heartbeat and release the transport. Calling it twice is harmless."""
        ...
