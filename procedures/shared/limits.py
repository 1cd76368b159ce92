"""What the controller itself keeps to, as its parameters state it."""

from __future__ import annotations

from bench.rigfile import RigFile
from bench.units import RPM


def landing_speed(rig: RigFile) -> float:
    """Below it the controller lands the rotor, rad/s; 0 where it is not told."""
    p = rig.parameters.get(rig.capabilities.landing_speed)
    return p.default if p else 0.0


def above_landing(landing: float) -> str:
    """Above what a plan's speeds are, for messages, of a landing speed in rad/s: 0 where none is told."""
    return f"{2 * landing * RPM:.0f} r/min, twice the landing speed" if landing else "0 r/min"


def current_limit(rig: RigFile) -> float:
    """Of each coil, A: the controller's, else the envelope's."""
    p = rig.parameters.get(rig.capabilities.current_limit)
    return p.default if p else rig.envelope.max_current_A
