"""The message map: what a DBC file says, as plain frozen data. No cantools object leaves this module."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final

import cantools

from bench.errors import ConfigError, Problem
from bench.units import unit

EXTENDED: Final = 0x8000_0000
"""Set in `Message.id` for 29-bit identifiers, as in `FRAME`."""
CLASSIC_LENGTHS: Final = range(9)
FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Payload lengths that a CAN FD frame can carry (ISO 11898-1, table of DLC)."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal: physical value = raw * scale + offset, in `unit`.

    `start` counts as in a DBC: the least significant bit of a little-endian signal, the most significant bit of a
    big-endian one, bit 0 being the least significant bit of byte 0.
    """

    name: str
    start: int
    length: int
    big_endian: bool = False
    signed: bool = False
    is_float: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str = "1"
    low: float | None = None
    high: float | None = None
    choices: Mapping[int, str] = field(default_factory=dict)
    comment: str = ""

    def code(self, choice: str) -> int:
        """The raw number of a named value (raises KeyError when the table lacks it)."""
        for number, name in self.choices.items():
            if name == choice:
                return number
        raise KeyError(f"signal {self.name} has no value named {choice!r}; it has {', '.join(self.choices.values())}")

    def choice(self, number: float) -> str:
        """The name of a raw number, or the number itself as text when the table lacks it."""
        return self.choices.get(int(number), str(int(number)))

    def bits(self) -> frozenset[int]:
        """The bits it occupies, numbered as in the payload: 8 * byte + bit of the byte."""
        if not self.big_endian:
            return frozenset(range(self.start, self.start + self.length))
        first = self.start - self.start % 8 + 7 - self.start % 8  # counted from the top of byte 0
        return frozenset(bit - bit % 8 + 7 - bit % 8 for bit in range(first, first + self.length))


@dataclass(frozen=True)
class Message:
    """One message: identifier (bit 31 set when extended), payload bytes and signals in order of their start."""

    name: str
    id: int
    length: int
    signals: tuple[Signal, ...]
    fd: bool = False
    cycle_s: float | None = None
    comment: str = ""

    @cached_property
    def by_name(self) -> Mapping[str, Signal]:
        """Its signals by name."""
        return MappingProxyType({signal.name: signal for signal in self.signals})

    def signal(self, name: str) -> Signal:
        """The signal of that name (raises KeyError)."""
        return self.by_name[name]


@dataclass(frozen=True)
class MessageMap:
    """All messages of a rig."""

    messages: tuple[Message, ...]

    @cached_property
    def by_name(self) -> Mapping[str, Message]:
        """Messages by name."""
        return MappingProxyType({message.name: message for message in self.messages})

    @cached_property
    def by_id(self) -> Mapping[int, Message]:
        """Messages by identifier, bit 31 set for extended ones."""
        return MappingProxyType({message.id: message for message in self.messages})

    def __getitem__(self, name: str) -> Message:
        return self.by_name[name]


def load_messages(dbc: str | bytes, encoding: str = "utf-8", file: str = "DBC") -> MessageMap:
    """Parse a DBC. Units stay as written; `in_si` converts.

    Args:
        dbc: the file's text, or its bytes, which are decoded by `encoding`.
        encoding: a rig key, because the customary default mangles a UTF-8 micro sign.
        file: named in errors.

    Raises:
        ConfigError: not text in that encoding, not a DBC, or it uses multiplexing.
    """
    try:
        text = dbc if isinstance(dbc, str) else dbc.decode(encoding)
    except (UnicodeDecodeError, LookupError) as error:
        raise ConfigError(
            f"{file} cannot be read", (Problem(file, "encoding", str(error), f"text encoded as {encoding}"),)
        ) from error
    try:
        database: Any = cantools.database.load_string(text, database_format="dbc", strict=False)
    except Exception as error:  # cantools lets parser, key and value errors of many kinds through
        raise ConfigError(
            f"{file} cannot be parsed", (Problem(file, "syntax", " ".join(str(error).split()), "a DBC file"),)
        ) from error
    multiplexed = [message.name for message in database.messages if message.is_multiplexed()]
    if multiplexed:
        problems = tuple(Problem(file, name, "a multiplexed message", "plain messages only") for name in multiplexed)
        raise ConfigError(f"{file} uses multiplexing", problems)
    return MessageMap(tuple(_message(message) for message in database.messages))


def _message(source: Any) -> Message:
    return Message(
        name=str(source.name),
        id=int(source.frame_id) | (EXTENDED if source.is_extended_frame else 0),
        length=int(source.length),
        signals=tuple(_signal(signal) for signal in sorted(source.signals, key=lambda item: (item.start, item.name))),
        fd=bool(source.is_fd),
        cycle_s=source.cycle_time / 1e3 if source.cycle_time else None,
        comment=source.comment or "",
    )


def _signal(source: Any) -> Signal:
    return Signal(
        name=str(source.name),
        start=int(source.start),
        length=int(source.length),
        big_endian=source.byte_order == "big_endian",
        signed=bool(source.is_signed),
        is_float=bool(source.is_float),
        scale=source.scale,
        offset=source.offset,
        unit=source.unit or "1",
        low=source.minimum,
        high=source.maximum,
        choices=MappingProxyType({int(number): str(name) for number, name in (source.choices or {}).items()}),
        comment=source.comment or "",
    )


def in_si(messages: MessageMap) -> MessageMap:
    """The same map with every signal in SI.

    Raises:
        ValueError: a signal's unit is not in the table.
    """
    return MessageMap(
        tuple(
            replace(message, signals=tuple(_signal_in_si(s) for s in message.signals)) for message in messages.messages
        )
    )


def _signal_in_si(signal: Signal) -> Signal:
    row = unit(signal.unit)
    if row.factor == 1.0 and row.offset == 0.0:
        return replace(signal, unit=row.si)
    return replace(
        signal,
        unit=row.si,
        scale=signal.scale * row.factor,
        offset=signal.offset * row.factor + row.offset,
        low=None if signal.low is None else signal.low * row.factor + row.offset,
        high=None if signal.high is None else signal.high * row.factor + row.offset,
    )


def layout_problems(messages: MessageMap, file: str) -> list[Problem]:
    """What no frame could carry: illegal lengths, signals outside the payload, overlaps, duplicates, unknown units."""
    problems = _duplicates(messages, file)
    for message in messages.messages:
        legal = FD_LENGTHS if message.fd else CLASSIC_LENGTHS
        if message.length not in legal:
            kind = "CAN FD" if message.fd else "classic CAN"
            expected = f"a {kind} payload length: {', '.join(str(n) for n in legal)}"
            problems.append(Problem(file, f"BO_ {message.name}", f"{message.length} bytes", expected))
        taken: dict[int, str] = {}
        for signal in message.signals:
            key = f"SG_ {message.name}.{signal.name}"
            problems += _signal_problems(signal, message, file, key)
            others = sorted({taken[bit] for bit in signal.bits() if bit in taken})
            if others:
                problems.append(
                    Problem(file, key, f"bits shared with {', '.join(others)}", "signals that do not overlap")
                )
            taken.update(dict.fromkeys(signal.bits(), signal.name))
    return problems


def _signal_problems(signal: Signal, message: Message, file: str, key: str) -> list[Problem]:
    problems = []
    if not 1 <= signal.length <= 64 or (signal.is_float and signal.length not in (16, 32, 64)):
        problems.append(Problem(file, key, f"{signal.length} bits", "1 to 64 bits (16, 32 or 64 for a float)"))
    if max(signal.bits(), default=0) >= 8 * message.length:
        problems.append(Problem(file, key, "bits outside the payload", f"bits inside its {message.length} bytes"))
    if signal.scale == 0:
        problems.append(Problem(file, key, "scale 0", "a scale that is not zero"))
    try:
        unit(signal.unit)
    except ValueError as error:
        problems.append(Problem(file, f"{key} unit", repr(signal.unit), str(error).partition("; ")[2]))
    return problems


def _duplicates(messages: MessageMap, file: str) -> list[Problem]:
    problems, names, identifiers = [], set[str](), dict[int, str]()
    for message in messages.messages:
        if message.name in names:
            problems.append(Problem(file, f"BO_ {message.name}", "a second message of that name", "unique names"))
        if message.id in identifiers:
            found = f"identifier 0x{message.id & ~EXTENDED:X}, also of {identifiers[message.id]}"
            problems.append(Problem(file, f"BO_ {message.name}", found, "one message per identifier"))
        names.add(message.name)
        identifiers.setdefault(message.id, message.name)
    return problems
