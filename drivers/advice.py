"""What to look at when a device reports a fault (names of docs/reference/protocol.md), and which may be cleared unseen."""

from __future__ import annotations

from bench.errors import ConfigError

ADVICE = {
    "CONTACT": "the rotor touched a touchdown bearing; inspect it before levitating again",
    "OVERCURRENT": "look for a short or a load beyond the envelope",
    "OVERSPEED": "check the drive and the speed limit",
    "HEARTBEAT_LOST": "the host or the link stalled; the controller made the machine safe by itself",
    "LEVITATION_LOST": "check sensor signs and wiring, amplifier limits and the load",
    "LIFT_TIMEOUT": "the rotor did not reach its place; check sensors, amplifiers and gains",
    "OVERTEMPERATURE": "let the windings cool",
    "STROKE": "an axis came near the end of its travel; look what pushed it, and at its zero, before it is held again",
    "SENSOR": "check the position sensors and the once-per-turn probe",
}
HARMLESS = ("HEARTBEAT_LOST", "COMMUNICATION")
"""Faults of a lost host, which say nothing of the machine: the next run may clear them by itself."""


def may_clear(device: str, fault: str, asked: bool) -> None:
    """Whether a fault that an earlier run left may be cleared: that of a lost host, or any on request.

    Raises:
        ConfigError: somebody should look at the machine first.
    """
    if fault not in HARMLESS and not asked:
        what = ADVICE.get(fault, "look at it")
        raise ConfigError(
            f"the {device} has the fault {fault} of an earlier run: {what}. Next: then run again with --clear-fault"
        )
