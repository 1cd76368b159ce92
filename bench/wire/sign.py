"""How a served simulation says what it is, on every transport and without the user's DBC (docs/reference/protocol.md).

The identifier is one of those that the CAN specification 2.0 leaves to nobody (0x7F0 to 0x7FF), so that no controller's own
message can be it; being the last of all in arbitration, it holds up none.
"""

from __future__ import annotations

from typing import Final

IDENTIFIER: Final = 0x7FF
PAYLOAD: Final = b"LEVSIM\x01\x00"
"""Eight bytes, in a classic frame: what it is, the version of this page of the protocol, zero."""
PERIOD_S: Final = 0.1
SLCAN_VERSION: Final = b"VSIM1"
"""What the SLCAN adapter of a served simulation answers to V."""
NAME: Final = "the sign of a served simulation"


def simulated(identifier: int, payload: bytes) -> bool:
    """Whether a frame is the sign."""
    return identifier == IDENTIFIER and payload == PAYLOAD
