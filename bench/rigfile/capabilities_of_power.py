"""What holds a dangerous voltage, and how it is seen to have none. Bound as `bench.rigfile.capabilities` says."""

from __future__ import annotations

from pydantic import Field

from bench.rigfile.part import Part

RESIDUAL_V = 60.0
"""What a person may reach, direct voltage: IEC 60204-1 6.2.4 and IEC 61800-5-1."""


class DcLink(Part):
    """The DC link, which is fed while the amplifiers are on and discharges once they are off: `channel` that reads its voltage;
    below `safe`, V, a machine that is off may be touched; `discharged_s`, within which it gets there."""

    channel: str
    safe: float = Field(RESIDUAL_V, gt=0, le=RESIDUAL_V)
    discharged_s: float = Field(5.0, gt=0)
