"""What is wrong with a rig file's table `capture`."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capture import BY_BLOCKS, MESSAGES, CaptureSpec
from bench.rigfile.check_binding import Found, multiplexed
from bench.rigfile.messages import MessageMap


def problems_of(spec: CaptureSpec, messages: MessageMap, *, blocks: bool = True) -> Iterator[Found]:
    """Key, found and expected of what is wrong with the table `capture`; `blocks`: it comes in blocks, not in pieces."""
    needed = (name for name in MESSAGES if blocks or name not in BY_BLOCKS)
    if missing := [name for name in needed if name not in messages.messages]:
        yield "capture", f"no message {', '.join(missing)} in the DBC", "the messages of docs/reference/captures.md"
    yield from multiplexed((("capture", name) for name in MESSAGES), messages)
    taken: dict[int, str] = {}
    for name, c in spec.channels.items():
        key = f"capture.channels.{name}"
        unit = units.UNITS.get(c.unit)
        if unit is None or (unit.factor, unit.offset) != (1.0, 0.0):
            yield f"{key}.unit", repr(c.unit), "an SI unit: `scale` leads there"
        if c.index in taken:
            yield f"{key}.index", str(c.index), f"an index of its own ({taken[c.index]})"
        taken.setdefault(c.index, name)
