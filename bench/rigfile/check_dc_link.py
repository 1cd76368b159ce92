"""A DC link whose voltage a channel of the rig file reads."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected."""
    link = rig.capabilities.dc_link
    if link is None:
        return
    channel = rig.channels.get(link.channel)
    if channel is None:
        yield "dc_link.channel", repr(link.channel), f"a channel of this file{near(link.channel, rig.channels)}"
    elif units.UNITS[channel.unit].si != "V":
        yield "dc_link.channel", f"{link.channel}, in {channel.unit}", "a channel in V"
