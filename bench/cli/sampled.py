"""What a rig's telemetry can show of time, where its controller records nothing faster: known before a run."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from bench import units
from bench.rigfile import RigFile

WIDTH = 80
SHARE = 0.4  # of the rate: above it nothing is stated, as in procedures.synchronous.dwells
IN_RISE = 2.0  # samples from a tenth to nine tenths of a step, as in procedures.step.checks
WATCHED = ("A", "m")  # SI units of currents and positions


def told(rig: RigFile) -> str:
    """Lines of at most 80 columns; nothing where positions and currents are captured at a faster rate, or no message has a
    period."""
    first = rig.messages.messages.get(rig.binding.telemetry[0])
    if first is None or first.period_s == 0 or not _missing(rig):
        return ""
    period = first.period_s
    text = (f"telemetry every {period * 1e3:g} ms and no capture of positions and currents: nothing is told above "
            f"{SHARE / period:.0f} Hz, nor of a step that rises in less than {IN_RISE * period * 1e3:g} ms")  # fmt: skip
    return "\n".join(textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)) + "\n"


def _missing(rig: RigFile) -> bool:
    """Whether a position or a current of the machine is not captured."""
    captured = () if rig.capture is None else rig.capture.channels
    return any(name not in captured for name in _watched(rig))


def _watched(rig: RigFile) -> Iterator[str]:
    """Positions of probes and currents of coils, by channel."""
    coils = {coil for b in rig.bearings.values() for a in b.axes.values() for coil in a.coils}
    probes = {p.channel for p in rig.probes.values()}
    for name in (*coils, *probes):
        unit = units.UNITS.get(rig.channels[name].unit) if name in rig.channels else None
        if unit is not None and unit.si in WATCHED:
            yield name
