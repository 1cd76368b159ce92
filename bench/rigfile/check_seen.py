"""What a rig file says and nothing can ever see: bits that no signal has, certificates of channels that there are not, settings
that leave parameters as another one set them."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from bench.rigfile.bit import Bit
from bench.rigfile.messages import MessageMap, Signal
from bench.rigfile.model import RigFile

Found = tuple[str, str, str]


def problems_of(rig: RigFile) -> Iterator[Found]:
    """Key, found and expected, by the rig file alone."""
    yield from _sensors(rig)
    yield from _settings(rig)


def beyond_signals(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Masks of more bits than the signal has: they would be watched for ever and never be seen."""
    for key, bit in _bits(rig):
        channel = rig.channels.get(bit.channel)
        signal = _signal_of(messages, channel.signal) if channel is not None else None
        if signal is None or bit.mask is None or not _plain(signal):
            continue
        if bit.mask > (most := (1 << signal.length) - 1):
            bits = "1 bit" if signal.length == 1 else f"{signal.length} bits"
            found = f"{bit.mask}, of which {channel.signal if channel else ''} with its {bits} cannot hold all"
            yield f"{key}.mask", found, f"at most {most}, the largest value of the signal"


def _bits(rig: RigFile) -> Iterator[tuple[str, Bit]]:
    status, loops, stage = rig.capabilities.status, rig.capabilities.loop_injection, rig.capabilities.positioning
    for name, loop in ({} if loops is None else loops.loops).items():
        if loop.limited is not None:
            yield f"capabilities.loop_injection.loops.{name}.limited", loop.limited
    if stage is not None and stage.homed is not None:
        yield "capabilities.positioning.homed", stage.homed
    yield from ((f"capabilities.status.contact.{ring}", bit) for ring, bit in status.contact.items())
    yield from ((f"capabilities.status.{key}", bit) for key, bit in status if isinstance(bit, Bit))


def _signal_of(messages: MessageMap, path: str) -> Signal | None:
    message, _, name = path.partition(".")
    known = messages.messages[message].signals if message in messages.messages else ()
    return next((s for s in known if s.name == name), None)


def _plain(s: Signal) -> bool:
    """Whether its value is the number of its bits; a negative number has every bit above it."""
    return not s.signed and not s.is_float and (s.scale, s.offset) == (1.0, 0.0)


def _sensors(rig: RigFile) -> Iterator[Found]:
    """Gains and offsets are looked up by channel: those of another name correct nothing."""
    captured = {} if rig.capture is None else rig.capture.channels
    known = [*rig.channels, *captured]
    for name in rig.sensors:
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            hint = f", such as {close[0]}" if close else ""
            yield f"sensors.{name}", repr(name), f"a channel of this file{hint}"


def _settings(rig: RigFile) -> Iterator[Found]:
    """Each name of a kind sets the same parameters: one that leaves some out would be another setting after each other one."""
    for kind, names in rig.capabilities.settings.items():
        every = tuple(dict.fromkeys(parameter for values in names.values() for parameter in values))
        for name, values in names.items():
            missing = [parameter for parameter in every if parameter not in values]
            if values and missing:
                key = f"capabilities.settings.{kind}.{name}"
                yield key, f"no {', '.join(missing)}", f"a value of every parameter that settings.{kind} sets"
