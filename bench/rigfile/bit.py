"""A bit that tells something of a controller."""

from __future__ import annotations

from pydantic import Field

from bench.rigfile.part import Part


class Bit(Part):
    """What a channel says: any of the bits of `mask`, or, without one, that it is not zero."""

    channel: str
    mask: int | None = Field(None, gt=0)
