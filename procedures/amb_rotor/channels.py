"""What the AMB stand's controller calls its channels, and the bits of its flags."""

from __future__ import annotations

AXES = ("yi", "zi", "yo", "zo")
PLANES = {"inboard": (0, 1), "outboard": (2, 3)}
POSITIONS = tuple(f"pos_{a}" for a in AXES)
COILS = tuple(f"{a}_{side}" for a in AXES for side in "pn")
CURRENTS, VOLTAGES = tuple(f"i_{c}" for c in COILS), tuple(f"u_{c}" for c in COILS)
CURRENT_LIMIT, VOLTAGE_LIMIT, CONTACT, RANGE = 1, 2, 4 | 8 | 32, 64  # bits of the telemetry signal `flags`
