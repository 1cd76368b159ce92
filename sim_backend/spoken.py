"""What a rig file calls the readings of a simulated machine: the machine speaks its own DBC, a rig file has its own names."""

from __future__ import annotations

from collections.abc import Mapping

from bench.rigfile import RigFile


def channels_by_reading(rig: RigFile) -> Mapping[str, str]:
    """The rig's channel of each reading, by the signal that it is bound to. A reading that is no signal of the telemetry, but
    recorded inside the controller alone, goes by its own name."""
    return {c.signal.partition(".")[2]: name for name, c in rig.channels.items()}


def reading_of(rig: RigFile, channel: str) -> str:
    """The machine's own name of a channel."""
    bound = rig.channels.get(channel)
    return channel if bound is None else bound.signal.partition(".")[2]
