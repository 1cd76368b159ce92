"""Several messages as one long one, so that a sample of several messages costs as many steps as one of a single message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bench.rigfile.messages import Message


def width_of(messages: Sequence[Message]) -> int:
    """Bytes that each has in the long one: those of the longest."""
    return max(m.length for m in messages)


def name_in(message: Message, signal: str) -> str:
    """What a message's signal is called in the long one."""
    return f"{message.name}.{signal}"


def beside(messages: Sequence[Message]) -> Message:
    """Messages one after the other, each in `width_of` bytes; nothing is ever sent like this."""
    width = width_of(messages)
    signals = tuple(
        replace(s, name=name_in(m, s.name), start=s.start + 8 * width * k)
        for k, m in enumerate(messages)
        for s in m.signals
    )
    first = messages[0]
    return replace(first, name="+".join(m.name for m in messages), length=width * len(messages), signals=signals)
