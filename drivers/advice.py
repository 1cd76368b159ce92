"""What to look at when a controller reports a fault (names of docs/reference/protocol.md)."""

from __future__ import annotations

ADVICE = {
    "CONTACT": "the rotor touched a touchdown bearing; inspect it before levitating again",
    "OVERCURRENT": "look for a short or a load beyond the envelope",
    "OVERSPEED": "check the drive and the speed limit",
    "HEARTBEAT_LOST": "the host or the link stalled; the controller landed the rotor by itself",
    "LEVITATION_LOST": "check sensor signs and wiring, amplifier limits and the load",
    "LIFT_TIMEOUT": "the rotor did not reach its place; check sensors, amplifiers and gains",
    "OVERTEMPERATURE": "let the windings cool",
    "SENSOR": "check the position sensors",
}
HARMLESS = ("HEARTBEAT_LOST",)
"""Faults that say nothing of the machine: the next run may clear them by itself."""
