"""Readings that procedures ask for by what they are, whatever a rig file calls them: those of the mark, and the status word.

A role has a dot, which no channel's name has. `resolved` gives the channels that stand behind what is asked for, `answered`
makes of their samples what was asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from enum import IntFlag
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from bench import units
from bench.errors import Lacking
from bench.rigfile import judged
from bench.rigfile.bit import Bit
from bench.rigfile.judged import Judged
from bench.rigfile.messages import Signal
from bench.rigfile.model import RigFile
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.supports import once_per_rig
from bench.samples import TICKS

Samples = Mapping[str, npt.NDArray[Any]]
ANGLE, SPEED, PULSES, EDGE = "mark.angle", "mark.speed", "mark.pulses", "mark.edge"
STATUS = "controller.status"
STATE = "state"
"""The key that every controller's state has among the channels: a role of the protocol and no name."""
AGE = "mark.age"
"""How long before a sample's time the last edge came, s; by `mark.edge` and the device's ticks."""
FLOAT_BITS = 24  # of a whole number that a float of 32 bits still holds
JUST_S = 1e-3  # an edge so little after a sample has just come, rounded
TEN_DIGITS = 1e-9


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
        elif name == AGE:
            out[name] = age_of_edge(rig, samples[_channels(rig, name)[0]], samples[TICKS])
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
    return role == STATUS or bool(rig.mark is not None and getattr(rig.mark, _key(role)))


def told_in(rig: RigFile, role: str) -> str:
    """The channel of a role of the mark as the bench itself watches it: the one that is bound, else one that is called so; ""
    where there is none."""
    if is_bound(rig, role):
        return _channels(rig, role)[0]
    plain = role.partition(".")[2]
    return plain if plain in rig.channels else ""


def wraps_at(rig: RigFile, channel: str) -> float:
    """Where a counter begins anew: as many as its signal holds, in its own steps."""
    signal = _signal_of(rig, channel)
    return float(2**signal.length) * abs(signal.scale)


def age_of_edge(rig: RigFile, edge: npt.NDArray[np.float64], ticks: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """How long before each tick the last edge of the mark came, s (n,). `edge` is its time on the device's clock, s, `ticks`
    are those of the same clock; both come round, and how often each has done so before anybody listened is not known. What both
    tell together is the age less whole turns of their greatest common divisor."""
    if not len(ticks):
        return np.zeros(0)
    tick, step = exact(rig.devices["controller"].tick_s), exact(resolution_s(rig))
    steps = np.rint(edge / float(step)).astype(np.int64)
    at = ticks.astype(np.int64)
    whole = _round(rig)
    first = (int(at[0]) * tick - int(steps[0]) * step) % whole  # of a device that is on for days: by whole numbers
    since = float(first) + (at - at[0]) * float(tick) - (steps - steps[0]) * float(step)
    return np.asarray((since + JUST_S) % float(whole) - JUST_S, np.float64)


def edge_round_s(rig: RigFile) -> float:
    """The longest age of an edge, s, that its time and the telemetry's ticks tell together: an edge that is older shows as
    less old."""
    return float(_round(rig))


def _round(rig: RigFile) -> Fraction:
    ticks = exact(rig.devices["controller"].tick_s) * (
        1 << rig.messages[rig.binding.telemetry[0]].signal(rig.binding.tick).length
    )
    edges = exact(resolution_s(rig)) * (1 << _signal_of(rig, _channels(rig, EDGE)[0]).length)
    return Fraction(math.gcd(ticks.numerator * edges.denominator, edges.numerator * ticks.denominator),
                    ticks.denominator * edges.denominator)  # fmt: skip


def exact(seconds: float) -> Fraction:
    """A time that a device counts in, as it is: the whole share of a second that a number of ten digits and more stands for
    (6.666666667e-5 is 1/15000 s), else the decimal that was written. Rounded to nanoseconds, 1/15000 s is wrong by 5 parts in
    a million, and an edge by 0.3 ms after a minute."""
    hertz = round(1 / seconds)
    if hertz and abs(hertz * seconds - 1) < TEN_DIGITS:
        return Fraction(1, hertz)
    return Fraction(f"{seconds:.12g}")


def resolution_s(rig: RigFile) -> float:
    """A step of the time of the mark's edge, s."""
    signal = _signal_of(rig, _channels(rig, EDGE)[0])
    return abs(signal.scale) * units.unit(signal.unit).factor


def whole_channels(rig: RigFile) -> frozenset[str]:
    """Channels that a float of 32 bits cannot hold: the time of the mark's edge; counters and bits that are wider than it."""
    wide = [bit.channel for bit in bits(rig).values()] + [
        _channels(rig, PULSES)[0] for _ in (0,) if is_bound(rig, PULSES)
    ]
    told = {c for c in wide if _signal_of(rig, c).length > FLOAT_BITS}
    return frozenset(told | set(_channels(rig, EDGE) if is_bound(rig, EDGE) else ()))


def _signal_of(rig: RigFile, channel: str) -> Signal:
    message, _, name = rig.channels[channel].signal.partition(".")
    return rig.messages[message].signal(name)


def status(rig: RigFile, samples: Samples) -> npt.NDArray[np.int64]:
    """The status word (n,), by the channels that the controller tells it in, and by readings where it does not."""
    word: npt.NDArray[np.int64] | None = None
    for flag, bit in bits(rig).items():
        told = samples[bit.channel].astype(np.int64)
        shown = np.where((told & bit.mask if bit.mask else told) != 0, int(flag), 0)
        word = shown if word is None else word | shown
    for flag, found in untold(rig):
        shown = np.where(found.shows(samples), int(flag), 0)
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


@once_per_rig
def untold(rig: RigFile) -> tuple[tuple[Status, Judged], ...]:
    """What is judged from readings, as no bit of its kind is bound."""
    told = rig.capabilities.status
    kinds = ((told.current_limit, Status.CURRENT_LIMIT, judged.currents), (told.voltage_limit, Status.VOLTAGE_LIMIT,
    judged.voltages),
             (told.sensor_range, Status.SENSOR_RANGE, judged.ranges))  # fmt: skip
    found = [(flag, of(rig)) for bound, flag, of in kinds if bound is None]
    out = [(flag, one) for flag, one in found if one is not None]
    return (*out, *((_contact(rig, ring), one) for ring, one in (judged.rings(rig) if not told.contact else ())))


def _contact(rig: RigFile, ring: str) -> Status:
    if ring in rig.bearings and rig.bearings[ring].kind == "axial":
        return Status.CONTACT_AXIAL
    if ring in rig.rings and rig.rings[ring].kind == "axial":
        return Status.CONTACT_AXIAL
    places = Places(rig)
    radial = sorted(_radial(rig, places))
    names = [name for _, name in radial]
    if ring in names:
        return Status.CONTACT_NEAR if names.index(ring) == 0 else Status.CONTACT_FAR
    try:
        at = places.place(f"rings/{ring}").value
    except PlaceError:
        return Status.CONTACT_NEAR
    nearest = min(range(len(radial)), key=lambda k: abs(radial[k][0] - at), default=0)
    return Status.CONTACT_NEAR if nearest == 0 else Status.CONTACT_FAR


def _radial(rig: RigFile, places: Places) -> Iterator[tuple[float, str]]:
    """Place and name of each radial bearing whose place can be told."""
    for name, bearing in rig.bearings.items():
        if bearing.kind == "radial":
            with suppress(PlaceError):
                yield places.place(f"bearings/{name}").value, name


def _channels(rig: RigFile, name: str) -> tuple[str, ...]:
    """The channels behind one name."""
    if "." not in name:
        return (name,)
    if name == STATUS:
        behind = (channel for _, one in untold(rig) for channel in one.channels)
        return tuple(dict.fromkeys((*(bit.channel for bit in bits(rig).values()), *behind)))
    if not is_bound(rig, name):
        raise Lacking(f"mark: found no channel for {_key(name)}")
    return (str(getattr(rig.mark, _key(name))),)


def _key(role: str) -> str:
    """Of the mark's table."""
    return (EDGE if role == AGE else role).partition(".")[2]
