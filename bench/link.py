"""The link protocol: what every transport to a controller offers, real or in-process."""

from __future__ import annotations

from typing import Protocol

from bench.frames import FrameBatch


class Link(Protocol):
    """A transport that carries frames in both directions. Only this differs between a real and a simulated rig."""

    @property
    def name(self) -> str:
        """The link's name in the rig file; its frames are recorded under `/raw/<name>`."""
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
        """Release the transport. Calling it twice is harmless."""
        ...
