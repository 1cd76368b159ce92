"""The message map of a rig: a DBC file read into plain frozen dataclasses. cantools does not leave this module."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from bench.errors import ConfigError
from bench.rigfile.dbcreader import database

_PLACE = re.compile(r"line \d+, column \d+")


@dataclass(frozen=True, slots=True)
class Signal:
    """Where a number lies in a payload (DBC conventions) and value = raw * scale + offset in `unit`."""

    name: str
    start: int
    length: int
    little_endian: bool
    signed: bool
    is_float: bool
    scale: float
    offset: float
    unit: str
    choices: Mapping[int, str]
    comment: str
    low: float | None = None
    high: float | None = None
    """The range that the DBC states, in `unit`; None where it states none."""


@dataclass(frozen=True)
class Message:
    """One message: identifier (bit 31 set when extended), payload bytes, period (0: on demand)."""

    name: str
    identifier: int
    length: int
    fd: bool
    period_s: float
    sender: str
    signals: tuple[Signal, ...]
    comment: str
    multiplexed: bool = False
    """Which signals a frame holds depends on another of them: nothing here reads or writes such a message."""

    def signal(self, name: str) -> Signal:
        """The signal of that name (KeyError when there is none)."""
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, Signal]:
        return {s.name: s for s in self.signals}


@dataclass(frozen=True)
class MessageMap:
    """All messages of a rig, by name."""

    messages: Mapping[str, Message]

    def __getitem__(self, name: str) -> Message:
        return self.messages[name]

    def code(self, message: str, signal: str, choice: str) -> int:
        """The number that a value table gives a name (KeyError when it has none)."""
        for number, name in self.messages[message].signal(signal).choices.items():
            if name == choice:
                return number
        raise KeyError(f"{message}.{signal} has no value named {choice}")


def load_messages(dbc: str, name: str = "dbc", *, classic: bool = False) -> MessageMap:
    """Read DBC text; on a `classic` bus no message is a frame of CAN FD.

    Raises:
        ConfigError: it is not a DBC, or signals overlap or do not fit.
    """
    try:
        read = _read(dbc)
    except Exception as error:  # cantools raises a dozen kinds, all meaning this
        raise ConfigError(f"{name}: not a usable DBC: {_why(error)}") from error
    return MessageMap({m.name: _message(m, classic) for m in read.messages})


def _why(error: Exception) -> str:
    """What is wrong, without the line that is: the file may be any that the rig file names. What was read as a DBC and
    contradicts itself is told by the names of its signals."""
    cause = getattr(error, "e_dbc", None) or error
    if found := _PLACE.search(str(cause)):
        return f"wrong syntax at {found[0]}"
    return str(cause) if isinstance(cause, database.errors.Error) else "it breaks off, or holds what no DBC does"


@lru_cache(maxsize=32)
def _read(dbc: str) -> Any:
    """Parsing takes longer than all else that opening a rig does, and a run does it at both ends of the link."""
    return database.load_string(dbc, database_format="dbc", strict=True)


def _message(m: Any, classic: bool) -> Message:
    identifier = m.frame_id | (1 << 31 if m.is_extended_frame else 0)
    fd = (bool(m.is_fd) or m.length > 8) and not classic
    period = (m.cycle_time or 0) * 1e-3
    sender = m.senders[0] if m.senders else ""
    signals = tuple(_signal(s) for s in m.signals)
    return Message(
        m.name, identifier, m.length, fd, period, sender, signals, _text(m.comment), multiplexed=m.is_multiplexed()
    )


def _signal(s: Any) -> Signal:
    choices = {int(k): str(v) for k, v in (s.choices or {}).items()}
    return Signal(
        name=s.name,
        start=s.start,
        length=s.length,
        little_endian=s.byte_order == "little_endian",
        signed=bool(s.is_signed),
        is_float=bool(s.is_float),
        scale=float(s.scale),
        offset=float(s.offset),
        unit=s.unit or "",
        choices=choices,
        comment=_text(s.comment),
        low=None if s.minimum is None else float(s.minimum),
        high=None if s.maximum is None else float(s.maximum),
    )


def _text(comment: Any) -> str:
    return str(comment or "")
