"""Worst-case load of a CAN bus from a message map: every frame stuffed as badly as the standard allows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from bench.errors import Problem
from bench.rigfile.capture import MESSAGES as CAPTURES
from bench.rigfile.messages import Message, MessageMap
from bench.rigfile.model import RigFile
from bench.wire import sign

REFUSE, WARN = 0.90, 0.70
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
UPLOADED = ("CaptureBlock", "CaptureData")
SEGMENTED_HZ = 10.0  # for one of a capture, which are asked for one after the other
ON_DEMAND_HZ = 50.0  # allowance for commands and their replies, per message without a period


@dataclass(frozen=True)
class BusLoad:
    """Share of the bus's time, in all and by message."""

    total: float
    by_message: dict[str, float]


def frame_seconds(m: Message, bitrate: float, data_bitrate: float | None) -> float:
    """Longest time of one message with its interframe space, ISO 11898-1.

    Classic: 44 bits (64 extended) and the data; stuffed from start of frame to CRC at worst one bit in four. FD: the
    arbitration phase at the nominal rate, from the bit-rate switch to the CRC at the data rate; the CRC field carries
    fixed stuff bits (one at its start and one after every four bits) and a stuff count of four bits.
    """
    extended = bool(m.identifier >> 31)
    if not m.fd and m.length > 8:  # segments of ISO 15765-2: 6 bytes in the first, 7 in each that follows
        return (1 + math.ceil((m.length - 6) / 7)) * frame_seconds(replace(m, length=8), bitrate, data_bitrate)
    if not m.fd:
        stuffable = (54 if extended else 34) + 8 * m.length
        return (stuffable + math.floor((stuffable - 1) / 4) + 13) / bitrate
    head = 36 if extended else 17  # start of frame, identifier, control bits up to and with the bit-rate switch
    head += math.floor((head - 1) / 4)
    body = 5 + 8 * m.length  # error state, length code, data
    body += math.ceil(body / 4)
    crc = 21 if m.length > 16 else 17
    body += 4 + crc + math.ceil((4 + crc) / 4) + 1
    tail = 1 + 2 + 7 + 3  # CRC delimiter, acknowledge, end of frame, interframe space
    return (head + tail) / bitrate + body / (data_bitrate or bitrate)


def bus_load(messages: MessageMap, bitrate: float, data_bitrate: float | None) -> BusLoad:
    """The load of every periodic message, and of the others at an allowance of ON_DEMAND_HZ each, SEGMENTED_HZ where they go in
    segments. An upload in segments takes what the rest leaves."""
    parts = {
        m.name: frame_seconds(m, bitrate, data_bitrate) * (1 / m.period_s if m.period_s else _on_demand_hz(m))
        for m in messages.messages.values()
        if m.fd or m.name not in UPLOADED
    }
    return BusLoad(sum(parts.values()), parts)


def upload_frame_seconds(messages: MessageMap, bitrate: float, data_bitrate: float | None) -> float:
    """Time from frame to frame of a capture's upload that leaves the bus free for everything else, at a load of REFUSE."""
    m = _block_frame(messages)
    periodic = (x for x in messages.messages.values() if x.period_s)
    busy = sum(frame_seconds(x, bitrate, data_bitrate) / x.period_s for x in periodic)
    return frame_seconds(m, bitrate, data_bitrate) / max(REFUSE - busy, 1 - REFUSE)


def net_bytes_per_second(messages: MessageMap, bitrate: float, data_bitrate: float | None) -> float:
    """Payload that a bus carries in its longest frames in the time that periodic messages leave, bytes a second."""
    m = _block_frame(messages)
    busy = sum(frame_seconds(x, bitrate, data_bitrate) / x.period_s for x in messages.messages.values() if x.period_s)
    return m.length * (1 - busy) / frame_seconds(m, bitrate, data_bitrate)


def _on_demand_hz(m: Message) -> float:
    return SEGMENTED_HZ if m.length > 8 and not m.fd else ON_DEMAND_HZ


def _block_frame(messages: MessageMap) -> Message:
    """The longest frame of an upload: CaptureBlock carries frames of ISO 15765-2, of 8 bytes where CAN is classic."""
    m = messages["CaptureBlock"]
    return m if m.fd else replace(m, length=min(m.length, 8))


def problems_of(rig: RigFile, messages: MessageMap) -> Iterator[Problem]:
    """Identifiers that two messages share, lengths that no frame has, a bus that cannot carry it all."""
    owner: dict[int, str] = {}
    too_long = [
        m.name for m in messages.messages.values() if rig.link.classic and m.length > 8 and m.name not in CAPTURES
    ]
    for m in messages.messages.values():
        if m.identifier in owner:
            shown = f"identifier {m.identifier & ~(1 << 31):#x}, which {owner[m.identifier]} has too"
            yield Problem(rig.link.dbc, f"BO_ {m.name}", shown, "one of its own: nobody could tell the two apart")
        owner.setdefault(m.identifier, m.name)
        if m.identifier == sign.IDENTIFIER:
            yield Problem(rig.link.dbc, f"BO_ {m.name}", f"identifier {m.identifier:#x}, which is {sign.NAME}",
                          "another one: a controller with it would pass for a simulation")  # fmt: skip
        if m.name in too_long:
            yield Problem(rig.link.dbc, f"BO_ {m.name}", f"{m.length} bytes on a bus of classic CAN", "at most 8, or "
                          f"data_bitrate in [links.{rig.devices['controller'].link}] where the bus has CAN FD")  # fmt: skip
        if m.length not in FD_LENGTHS:
            yield Problem(rig.link.dbc, m.name, f"{m.length} bytes", f"a CAN FD length: {FD_LENGTHS}")
    if rig.link.bitrate is None or too_long:
        return  # no CAN bus, or not this one
    load = bus_load(messages, rig.link.bitrate, rig.link.data_bitrate)
    if load.total > REFUSE:
        worst = max(load.by_message, key=lambda name: load.by_message[name])
        yield Problem(rig.path, f"links.{rig.devices['controller'].link}", f"a bus load of {load.total:.0%}",
                      f"at most {REFUSE:.0%}; {worst} takes {load.by_message[worst]:.0%}")  # fmt: skip
