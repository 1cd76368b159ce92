"""What the servomotor's rig file calls its geometry."""

from __future__ import annotations

LEVERS = tuple(f"com_to_{b}_{what}" for b in ("inboard", "outboard") for what in ("sensor", "amb"))
"""From the centre of mass to the sensors and the AMBs, m."""
