"""What is wrong with a rig file's table `capture`."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capture import BY_BLOCKS, MESSAGES, CaptureSpec
from bench.rigfile.check_binding import Found, multiplexed
from bench.rigfile.messages import MessageMap

SIGNALS = {
    "CaptureArm": ("channels0", "channels1", "divider", "length", "before", "trigger", "source", "level"),
    "CaptureAsk": ("code",),
    "CaptureRead": ("number", "form", "offset", "length"),
    "CaptureFlow": ("flow", "block_size", "st_min"),
    "CaptureStatus": ("status", "state", "number", "divider", "size", "samples", "trigger", "tick", "crc"),
}
"""What is written and read of those messages; the others are bytes."""
NAMES: dict[str, dict[str, tuple[str, ...]]] = {
    "CaptureArm": {"trigger": ("NOW",)},
    "CaptureAsk": {"code": ("STATUS", "CANCEL")},
    "CaptureStatus": {"status": ("OK",), "state": ("IDLE", "ARMED", "TRIGGERED", "DONE")},
}
"""Names that the value tables of their signals must have: a capture is told by them."""


def problems_of(spec: CaptureSpec, messages: MessageMap, *, blocks: bool = True) -> Iterator[Found]:
    """Key, found and expected of what is wrong with the table `capture`; `blocks`: it comes in blocks, not in pieces."""
    needed = (name for name in MESSAGES if blocks or name not in BY_BLOCKS)
    if missing := [name for name in needed if name not in messages.messages]:
        yield "capture", f"no message {', '.join(missing)} in the DBC", "the messages of docs/reference/captures.md"
    yield from multiplexed((("capture", name) for name in MESSAGES), messages)
    yield from _lacking(messages, blocks=blocks)
    taken: dict[int, str] = {}
    for name, c in spec.channels.items():
        key = f"capture.channels.{name}"
        unit = units.UNITS.get(c.unit)
        if unit is None or (unit.factor, unit.offset) != (1.0, 0.0):
            yield f"{key}.unit", repr(c.unit), "an SI unit: `scale` leads there"
        if c.index in taken:
            yield f"{key}.index", str(c.index), f"an index of its own ({taken[c.index]})"
        taken.setdefault(c.index, name)


def _lacking(messages: MessageMap, *, blocks: bool) -> Iterator[Found]:
    """Signals that are not there, and numbers without the names by which captures go."""
    named = NAMES | {"CaptureRead": {"form": ("BLOCK" if blocks else "PIECES",)}}
    for message in (messages[name] for name in SIGNALS if name in messages.messages):
        if not blocks and message.name in BY_BLOCKS:
            continue
        there = {signal.name: set(signal.choices.values()) for signal in message.signals}
        if missing := [name for name in SIGNALS[message.name] if name not in there]:
            yield (
                "capture",
                f"message {message.name} without {', '.join(missing)}",
                "its signals of docs/reference/captures.md",
            )
        for signal, names in named.get(message.name, {}).items():
            if signal in there and (unnamed := [name for name in names if name not in there[signal]]):
                yield (f"capture: {message.name}.{signal}", f"no value named {', '.join(unnamed)}",
                       "a value table (VAL_ of the DBC) as in docs/reference/captures.md")  # fmt: skip
