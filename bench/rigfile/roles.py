"""Readings that procedures ask for by what they are, whatever a rig file calls them: those of the mark, and the status word.

A role has a dot, which no channel's name has. `resolved` gives the channels that stand behind what is asked for, `answered`
makes of their samples what was asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntFlag
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import Lacking
from bench.rigfile.capabilities import Bit
from bench.rigfile.model import RigFile
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.supports import once_per_rig

Samples = Mapping[str, npt.NDArray[Any]]
ANGLE, SPEED, PULSES, EDGE = "mark.angle", "mark.speed", "mark.pulses", "mark.edge"
STATUS = "controller.status"


class Status(IntFlag):
    """Bits of the status word, whatever bits of what channels the controller has for them. The near and the far ring are those
    at the first and at the last radial bearing."""

    CURRENT_LIMIT = 1
    VOLTAGE_LIMIT = 2
    CONTACT_NEAR = 4
    CONTACT_FAR = 8
    CONTACT_AXIAL = 32
    SENSOR_RANGE = 64
    SEGMENT_LIMIT = 128


def resolved(rig: RigFile, names: Iterable[str]) -> tuple[str, ...]:
    """Each channel once, in the order in which it is first needed.

    Raises:
        Lacking: the rig has none for a role.
    """
    out: dict[str, None] = {}
    for name in names:
        out |= dict.fromkeys(_channels(rig, name))
    return tuple(out)


def answered(rig: RigFile, names: Iterable[str], samples: Samples) -> dict[str, npt.NDArray[Any]]:
    """Samples (n,) of what was asked for, and whatever else is in `samples` without being a channel behind a role alone."""
    asked = tuple(names)
    behind = {c for name in asked if "." in name for c in _channels(rig, name)} - set(asked)
    out = {name: x for name, x in samples.items() if name not in behind}
    for name in asked:
        if name == STATUS:
            out[name] = status(rig, samples)
        elif "." in name:
            out[name] = samples[_channels(rig, name)[0]]
    return out


def read_now(rig: RigFile, name: str, latest: Mapping[str, float]) -> float:
    """A role's newest reading, of the `latest` by channel.

    Raises:
        KeyError: the channel behind it has none.
        Lacking: the rig has no channel for it.
    """
    behind = {channel: np.array([latest[channel]]) for channel in resolved(rig, [name])}
    return float(answered(rig, [name], behind)[name][0])


def is_bound(rig: RigFile, role: str) -> bool:
    """Whether a rig has a channel for a role of the mark; it has always a status word, if only of zeros."""
    return role == STATUS or bool(rig.mark is not None and getattr(rig.mark, role.partition(".")[2]))


def told_in(rig: RigFile, role: str) -> str:
    """The channel of a role of the mark as the bench itself watches it: the one that is bound, else one that is called so; ""
    where there is none."""
    if is_bound(rig, role):
        return _channels(rig, role)[0]
    plain = role.partition(".")[2]
    return plain if plain in rig.channels else ""


def wraps_at(rig: RigFile, channel: str) -> float:
    """Where a counter begins anew: as many as its signal holds, in its own steps."""
    message, _, name = rig.channels[channel].signal.partition(".")
    signal = rig.messages[message].signal(name)
    return float(2**signal.length) * abs(signal.scale)


def status(rig: RigFile, samples: Samples) -> npt.NDArray[np.int64]:
    """The status word (n,), by the channels that the controller tells it in."""
    word: npt.NDArray[np.int64] | None = None
    for flag, bit in bits(rig).items():
        told = samples[bit.channel].astype(np.int64)
        shown = np.where((told & bit.mask if bit.mask else told) != 0, int(flag), 0)
        word = shown if word is None else word | shown
    if word is not None:
        return word
    return np.zeros(max((len(x) for x in samples.values()), default=0), np.int64)


@once_per_rig
def bits(rig: RigFile) -> dict[Status, Bit]:
    """Where each bit is told, as far as it is."""
    told = rig.capabilities.status
    found = {Status.CURRENT_LIMIT: told.current_limit, Status.VOLTAGE_LIMIT: told.voltage_limit,
             Status.SENSOR_RANGE: told.sensor_range, Status.SEGMENT_LIMIT: told.segment_limit}  # fmt: skip
    for name, bit in told.contact.items():
        found[_contact(rig, name)] = bit
    return {flag: bit for flag, bit in found.items() if bit is not None}


def _contact(rig: RigFile, ring: str) -> Status:
    if ring in rig.bearings and rig.bearings[ring].kind == "axial":
        return Status.CONTACT_AXIAL
    if ring in rig.rings and rig.rings[ring].kind == "axial":
        return Status.CONTACT_AXIAL
    places = Places(rig)
    radial = sorted(
        (places.place(f"bearings/{name}").value, name) for name, b in rig.bearings.items() if b.kind == "radial"
    )
    names = [name for _, name in radial]
    if ring in names:
        return Status.CONTACT_NEAR if names.index(ring) == 0 else Status.CONTACT_FAR
    try:
        at = places.place(f"rings/{ring}").value
    except PlaceError:
        return Status.CONTACT_NEAR
    nearest = min(range(len(radial)), key=lambda k: abs(radial[k][0] - at), default=0)
    return Status.CONTACT_NEAR if nearest == 0 else Status.CONTACT_FAR


def _channels(rig: RigFile, name: str) -> tuple[str, ...]:
    """The channels behind one name."""
    if "." not in name:
        return (name,)
    if name == STATUS:
        return tuple(dict.fromkeys(bit.channel for bit in bits(rig).values()))
    if not is_bound(rig, name):
        raise Lacking(f"mark: found no channel for {name.partition('.')[2]}")
    return (str(getattr(rig.mark, name.partition(".")[2])),)
