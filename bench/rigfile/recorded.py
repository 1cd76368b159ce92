"""What a controller records of the mark in its own memory, whatever a rig file calls it: the count of the edges, their age.

The count goes by the telemetry's channel of it (`mark.pulses`) where that can be recorded, else by the controller's own name
for it. The age of the last edge has no channel of the mark.
"""

from __future__ import annotations

from collections.abc import Sequence

from bench.rigfile.model import RigFile

COUNT, AGE = "pulses", "pulse_age"
"""Of a controller, inside: as `inject`, `before` and `after` are."""


def pulsed(rig: RigFile) -> tuple[str, ...]:
    """The channels of a capture that tell the shaft's angle, the count first; nothing where not both can be recorded."""
    known = rig.capture.channels if rig.capture is not None else {}
    count = told_by(rig, COUNT)
    count = count if count in known else COUNT
    return (count, AGE) if count in known and AGE in known else ()


def unrecorded(rig: RigFile) -> tuple[str, ...]:
    """What of it cannot be recorded, in words."""
    known = rig.capture.channels if rig.capture is not None else {}
    count = dict.fromkeys(name for name in (told_by(rig, COUNT), COUNT) if name)
    names = [] if any(name in known for name in count) else [f"{' or '.join(count)} (the mark's count of pulses)"]
    return (*names, *(() if AGE in known else (f"{AGE} (the time since the last of them)",)))


def recorded(rig: RigFile, names: Sequence[str]) -> int:
    """How many of them can be captured."""
    return sum(name in rig.capture.channels for name in names) if rig.capture is not None else 0


def told_by(rig: RigFile, key: str) -> str:
    """The channel of one of the mark's readings; "" where none is bound."""
    return str(getattr(rig.mark, key)) if rig.mark is not None else ""
