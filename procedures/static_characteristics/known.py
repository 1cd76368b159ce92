"""What the rig file says of cells, arm, currents and encoders, by the terms of the fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from procedures.stages.stators import Phase
from procedures.static_characteristics.fit import Known
from procedures.static_characteristics.model import Rows, Terms
from procedures.static_characteristics.steps import Cell

COUNT = 1 / math.sqrt(12)  # standard uncertainty of a reading within its count
EXACT = 1e-9


def certificates(of: Rows, rig: RigFile, some: Sequence[Phase], both: tuple[Cell, Cell]) -> list[Known]:
    """All of them."""
    at = Terms(len(of.x))
    return [*_of_cells(at, rig, both), *_of_currents(at, rig, some), *_of_encoders(at, both)]


def _of_cells(at: Terms, rig: RigFile, both: tuple[Cell, Cell]) -> Iterator[Known]:
    along, around = both
    for name, cell, other, give in (("x", along, around, "give_x"), ("angle", around, along, "give")):
        stem, by, term = f"capabilities/load_cells/{cell.axis.name}", cell.by, at.cell
        share = by.gain.standard_uncertainty / by.gain.value
        yield Known(term(f"cell_{name}"), 1.0, max(share, EXACT), f"{stem}/gain", by.gain.distribution)
        cross = by.cross.get(other.axis.name)
        value, u = (
            (0.0, 0.0) if cross is None else (cross.value / by.gain.value, cross.standard_uncertainty / by.gain.value)
        )
        yield Known(term(f"cross_{name}"), value, max(u, EXACT), f"{stem}/cross/{other.axis.name}",
                    "rectangular" if cross is None else cross.distribution)  # fmt: skip
        yield Known(
            term(give), by.give.value, max(by.give.standard_uncertainty, 1e-12), f"{stem}/give", by.give.distribution
        )
    arm = rig.geometry[around.by.arm.removeprefix("geometry/")] if around.by.arm else None
    u = EXACT if arm is None else max(arm.standard_uncertainty / arm.value, EXACT)
    identity = around.by.arm or f"capabilities/load_cells/{around.axis.name}/arm"
    yield Known(at.cell("arm"), 1.0, u, identity, "normal" if arm is None else arm.distribution)


def _of_currents(at: Terms, rig: RigFile, some: Sequence[Phase]) -> Iterator[Known]:
    for k, phase in enumerate(some):
        sensor = rig.sensors[phase.current]
        for name, stated, part in (("current", sensor.gain, "gain"), ("offset", sensor.offset, "offset")):
            u = max(stated.standard_uncertainty, EXACT)
            identity = f"sensors/{phase.current}/{part}"
            yield Known(at.each(name).start + k, stated.value, u, identity, stated.distribution)


def _of_encoders(at: Terms, both: tuple[Cell, Cell]) -> Iterator[Known]:
    x, angle = (cell.axis for cell in both)
    wide = EXACT if angle.error is None else _half(angle.error) / math.sqrt(2)  # of each part of a sine
    for k, part in enumerate(("cosine", "sine")):
        yield Known(at.once.start + k, 0.0, max(wide, EXACT), f"encoders/{angle.name}/error/{part}", "arcsine")
    count = 0.0 if angle.pitch is None else angle.pitch.value
    for p in range(at.places):
        yield Known(at.off.start + p, 0.0, max(COUNT * count, EXACT), f"counts/{angle.name}/{p}")
    share = 0.0 if x.pitch is None else x.pitch.standard_uncertainty / x.pitch.value
    yield Known(at.scale, 1.0, max(share, EXACT), f"encoders/{x.name}/pitch")


def _half(number: Toleranced) -> float:
    return number.standard_uncertainty
