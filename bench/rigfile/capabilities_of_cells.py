"""What holds an axis without a lock and reads what it holds: a load cell. Axes are the rig file's encoders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from bench.rigfile.elements import Name
from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced


class LoadCell(Part):
    """A cell that reads what an axis presses on it. `channel` of the telemetry, or none: the operator reads it, in `unit` where
    the answer has none. Around, `arm` is the length at whose end a cell in N sits ("geometry/arm"); a transducer in N m has
    none. `sign` -1 where a push towards + reads less. `gain`, reading over load; `cross` by another axis, what it reads of the
    load on that one's cell, each in its own unit; `noise` of one reading; `resolution`; `give`, how far it yields, m/N along
    and rad/(N m) around."""

    instrument: str
    channel: str = ""
    unit: str = ""
    arm: str = ""
    sign: Literal[-1, 1] = 1
    gain: Toleranced
    cross: Mapping[Name, Toleranced] = {}
    noise: Toleranced | None = None
    resolution: float = Field(0.0, ge=0)
    give: Toleranced
