"""A link with faults: wraps any other link, so that a bench can be shown what buses do."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from bench.clock import Clock
from bench.errors import ConfigError
from bench.link import Link, LinkStats
from bench.link.fault_injection import CUTS, DEVICE_ONLY, Fault
from bench.link.frame_faults import FrameFaults, lost
from bench.link.frames import ERROR, FrameBatch, empty_batch


class FaultyLink:
    """A `bench.link.Link` around another one.

    Faults count from the first frame that the host sends through it. Heartbeats do not come through here: while nothing
    passes their lease is not renewed and `hush` is called, so that they end too (at the next call of this link; without
    a `hush`, when the lease ends).

    Args:
        link: the sound link.
        faults: none of `bench.link.fault_injection.DEVICE_ONLY`.
        seed: of which frames are hit.
        clock: the link's own time; frames carry it.
        telemetry: identifiers that `mute` lets pass.
        hush: ends the heartbeat at once; `renew_lease` must bring it back.
        reconnect_s: a disconnect that is shorter is mended by the link itself.

    Raises:
        ConfigError: a fault that only a controller can have.
    """

    def __init__(
        self, link: Link, faults: Sequence[Fault], seed: int, clock: Clock, *, telemetry: Collection[int] = (),
        hush: Callable[[], None] = lambda: None, reconnect_s: float = 0.0,
    ) -> None:  # fmt: skip
        if inside := [str(f) for f in faults if f.kind in DEVICE_ONLY]:
            raise ConfigError(f"--fault {', '.join(inside)}: happens inside the controller, not on its link")
        self._link, self._clock, self._hush, self._reconnect_s = link, clock, hush, reconnect_s
        self._frames = FrameFaults(faults, seed, telemetry=telemetry)
        self._waiting: list[FrameBatch] = []  # sent by the host during a stall
        self._later = empty_batch()  # arrived after a cut that the host has yet to be told of
        self._blocked = False
        self._received = self._error_frames = 0

    @property
    def name(self) -> str:
        """The wrapped link's name."""
        return self._link.name

    @property
    def stats(self) -> LinkStats:
        """The wrapped link's counts, with what the faults made of them."""
        counted = self._frames.counted(self._link.stats, self._clock.now_ns())
        return replace(counted, received=self._received, error_frames=counted.error_frames + self._error_frames)

    @property
    def reopening(self) -> bool:
        """The wrapped link's, or a disconnect that it would mend."""
        return self._link.reopening or (
            bool(self._reconnect_s) and self._frames.active("disconnect", self._clock.now_ns())
        )

    def send(self, batch: FrameBatch) -> None:
        """Pass frames on, or keep them while the link is stalled.

        Raises:
            LinkError: the link is lost.
        """
        now = self._clock.now_ns()
        self._frames.start(now)
        self._look(now)
        if (cut := self._frames.cut(now)) is not None:
            raise lost(self.name, cut)
        if self._frames.active("stall", now):
            self._waiting.append(batch.copy())
        else:
            self._link.send(batch)

    def receive(self) -> FrameBatch:
        """What arrived since the last call, as the faults left it.

        Raises:
            LinkError: the link is lost.
        """
        now = self._clock.now_ns()
        self._look(now)
        arrived = self._link.receive()
        damaged = int((arrived["flags"] & ERROR != 0).sum())
        passed = self._frames.apply(arrived, now)
        self._error_frames += max(int((passed["flags"] & ERROR != 0).sum()) - damaged, 0)
        batch = np.concatenate([self._later, passed])
        batch, self._later, cut = self._frames.up_to_cut(batch, now, self._reconnect_s)
        if cut is not None:
            raise lost(self.name, cut)
        self._received += len(batch)
        return batch

    def renew_lease(self) -> None:
        """Let the heartbeat run on, unless nothing passes."""
        now = self._clock.now_ns()
        self._look(now)
        if not self._blocked:
            self._link.renew_lease()

    def close(self) -> None:
        """Close the wrapped link; what still waits is lost."""
        self._waiting.clear()
        self._link.close()

    def _look(self, now_ns: int) -> None:
        """Notice that the link is blocked, or free again: then what waited goes out."""
        blocked = any(self._frames.active(kind, now_ns) for kind in ("stall", *CUTS))
        if blocked and not self._blocked:
            self._hush()
        self._blocked = blocked
        if not self._frames.active("stall", now_ns):
            waiting, self._waiting = self._waiting, []
            for batch in waiting:
                self._link.send(batch)
