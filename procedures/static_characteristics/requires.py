"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from dataclasses import dataclass

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_cells import LoadCell
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis
from procedures.stages.stators import POLES, axis, lacks, phases


@dataclass(frozen=True)
class Cell:
    """A load cell with the axis that it holds; `length` m of its arm, 1 without one: load over what presses on it."""

    axis: StageAxis
    by: LoadCell
    length: float

    @property
    def unit(self) -> str:
        """In which the operator reads it."""
        return self.by.unit or ("N" if self.axis.unit == "m" or self.by.arm else "N m")


def cells(rig: RigFile) -> tuple[Cell, Cell] | None:
    """Along and around; None where the rig has not got both."""
    out = []
    for measures in ("stroke", "angle"):
        found = axis(rig, measures)
        if found is None or found.name not in rig.capabilities.load_cells:
            return None
        by = rig.capabilities.load_cells[found.name]
        out.append(Cell(found, by, rig.geometry[by.arm.removeprefix("geometry/")].value if by.arm else 1.0))
    return out[0], out[1]


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted, some = ("positioning", "phase_test", "load_cells"), phases(rig)
    if rig.capabilities.phase_test is None or rig.capabilities.positioning is None or not rig.capabilities.load_cells:
        return Requires(roles=("motion",), capabilities=wanted)
    test, both = rig.capabilities.phase_test, cells(rig)
    axes = [a for a in (axis(rig, "stroke"), axis(rig, "angle")) if a is not None]
    without = [a.name for a in axes if a.name not in rig.capabilities.load_cells]
    return Requires(
        roles=("motion", "operator"),
        channels=(STATE, *(a.channel for a in axes), *(c.by.channel for c in both or () if c.by.channel)),
        sensors=tuple(p.current for p in some),
        machine=(POLES,),
        capabilities=wanted,
        lacks=(*lacks(rig, 2), *(f"capabilities.load_cells: found none of {name}" for name in without),
               *(("capabilities.phase_test: found no current",) if not test.current else ()),
               *_six(len(some))),
        uses=("model",),
    )  # fmt: skip


def _six(found: int) -> tuple[str, ...]:
    return () if found == 6 else (f"capabilities.phase_test.phases: found {found} of known motors; expected 6",)
