"""What a controller's own words mean, the other way round: our states and faults to the codes of its DBC."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from bench.rigfile import RigFile
from bench.rigfile.binding import LEVITATION_MODES, STAGE_MODES, Binding

FAULTS: Final = ("LEVITATION_LOST", "OVERCURRENT", "OVERSPEED", "HEARTBEAT_LOST", "SENSOR", "LIFT_TIMEOUT", "STROKE",
                 "OVERTEMPERATURE")  # fmt: skip
"""What the simulated controller latches."""

NEAREST: Final[Mapping[str, tuple[str, ...]]] = {
    "LIFTING": ("READY", "LEVITATED"), "LANDING": ("LEVITATED", "READY"), "SPINNING": ("LEVITATED",),
    "COASTING": ("SPINNING", "LEVITATED"), "READY": ("OFF",), "OFF": ("READY",), "FAULT": ("OFF",), "LEVITATED": ("SPINNING",),
    "HOMING": ("READY",), "HOLDING": ("MOVING",), "MOVING": ("HOLDING",), "STOPPING": ("MOVING", "HOLDING"),
}  # fmt: skip
"""For a mode that no state of the DBC means: the mode that a movement comes from, until it has ended; and what holds the
rotor as this one does. So LEVITATED is never told before the rotor stands, nor READY before it lies."""


def state_codes(binding: Binding, choices: Mapping[int, str]) -> dict[str, int]:
    """The code that tells each mode of what levitates, or of a stage: of several states that mean it the one with the lowest
    number, of none the nearest mode's (NEAREST), and where that has none either the lowest code."""
    told: dict[str, int] = {}
    for code in sorted(choices):
        mode = binding.mode(choices[code])
        if mode is not None:
            told.setdefault(mode, code)
    lowest = min(told.values(), default=0)
    modes = STAGE_MODES if "HOLDING" in told else LEVITATION_MODES
    near = {m: next((told[n] for n in NEAREST.get(m, ()) if n in told), lowest) for m in modes if m not in told}
    return told | near


def fault_codes(rig: RigFile, choices: Mapping[int, str]) -> dict[str, int]:
    """The code that tells NONE and each of FAULTS.

    NONE is the lowest code whose name is one of the binding's `no_fault`, else 0. A fault has the code that
    `[simulation.faults]` names for it; else that of the same name, whatever its case and underscores; else the lowest that
    means some fault, or 1 where the DBC names none.
    """
    named = {_plain(name): code for code, name in sorted(choices.items(), reverse=True)}
    none = [code for code in sorted(choices) if choices[code] in rig.binding.no_fault]
    some = [code for code in sorted(choices) if code not in none]
    stated = rig.simulation.get("faults", {})
    return {"NONE": none[0] if none else 0} | {
        fault: named.get(_plain(stated.get(fault, fault)), some[0] if some else 1) for fault in FAULTS
    }


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).casefold()
