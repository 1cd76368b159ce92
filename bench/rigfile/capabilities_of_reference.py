"""What reads an axis beside its own encoder: an instrument outside the loop. Axes are the rig file's encoders."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced


class ReferenceInstrument(Part):
    """An instrument that reads where an axis is, m or rad, and is in no loop. `channel` of the telemetry, or none: the operator
    reads it, in `unit` where the answer has none. `sign` -1 where it counts the other way. `gain`, what it reads of what is,
    with its alignment; `error`, how far off its scale is at any one place; `noise` of one reading; `resolution` m or rad;
    `drift`, m/s or rad/s, how fast its zero may wander. `temperature`: channel, of what carries the axis."""

    instrument: str
    channel: str = ""
    unit: str = ""
    sign: Literal[-1, 1] = 1
    gain: Toleranced
    error: Toleranced | None = None
    noise: Toleranced | None = None
    resolution: float = Field(0.0, ge=0)
    drift: Toleranced | None = None
    temperature: str = ""
