"""Telemetry as a controller of a rig file would send it, with whatever is wrong with it, given to what listens."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from bench.link.codec import encode
from bench.link.frames import FD, FrameBatch, batch_of, packed
from bench.link.link import LinkStats
from bench.link.listened import Ear, Listened
from bench.rigfile import RigFile, load_rig

START_NS = 1_700_000_000_000_000_000
SILENT = "listen-only (L): the adapter acknowledges nothing"
Values = Callable[[int], Mapping[str, float]]


def listening(rig: str = "tsbs12", manner: str = SILENT, complaint: str = "") -> Listened:
    """To nothing yet."""
    loaded = load_rig(rig)
    return Listened(loaded, Ear("controller", loaded.link.url, manner, START_NS, complaint))


def readings(k: int) -> dict[str, float]:
    """Of tsbs12: a sound sample number k, at rest in OFF."""
    noise = 1e-6 * ((k * 7) % 5 - 2)
    values = dict.fromkeys(("pos_xi", "pos_yi", "pos_xo", "pos_yo", "pos_z"), 40e-6 + noise)
    return {**values, "seq": k % 65536, "tick": 10 * k, "i_xi_p": 0.1 + noise * 1e3, "supply": 48.0 + noise * 2e4,
            "temp_i": 293.15 + noise * 2e4, "host_age": 65.535}  # fmt: skip


def telemetry(
    rig: RigFile, count: int, values: Values = readings, first: int = 0, period_ns: int = 1_000_000
) -> FrameBatch:
    """Samples of a rig with one telemetry message, one each period of the host's clock."""
    message = rig.messages[rig.binding.telemetry[0]]
    return batch_of(
        packed(message.identifier, encode(message, values(k)), t_ns=START_NS + k * period_ns, flags=FD)
        for k in range(first, first + count)
    )


def hear(heard: Listened, batch: FrameBatch, seconds: float, **counts: int) -> Listened:
    """In looks of 50 ms, up to so many seconds after the start."""
    stats = LinkStats(received=len(batch), **counts)
    looks = np.arange(0.05, seconds + 0.025, 0.05)
    for look in looks:
        end = START_NS + round(look * 1e9)
        mine = batch[
            (batch["t_ns"] <= end) & (batch["t_ns"] > end - 50_000_000 - (START_NS if look == looks[0] else 0))
        ]
        heard.take(mine, stats, end)
    return heard
