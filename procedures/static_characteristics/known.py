"""What the rig file says of cells, arm, currents and encoders, by the terms of the fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from procedures.stages.stators import Phase
from procedures.static_characteristics.fit import Known
from procedures.static_characteristics.model import Rows, Terms
from procedures.static_characteristics.requires import Cell

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
        yield _share(term(f"cell_{name}"), by.gain, f"{stem}/gain")
        cross, identity = by.cross.get(other.axis.name), f"{stem}/cross/{other.axis.name}"
        if cross is None:
            yield Known(term(f"cross_{name}"), 0.0, EXACT, identity)
        else:
            yield _share(term(f"cross_{name}"), cross, identity, of=by.gain.value)
        u = max(by.give.standard_uncertainty, 1e-12)
        yield Known(term(give), by.give.value, u, f"{stem}/give", by.give.distribution, by.give.unit)
    arm = around.by.arm
    if arm:
        yield _share(at.cell("arm"), rig.geometry[arm.removeprefix("geometry/")], arm)
    else:
        yield Known(at.cell("arm"), 1.0, EXACT, f"capabilities/load_cells/{around.axis.name}/arm", "normal")


def _share(term: int, stated: Toleranced, identity: str, of: float | None = None) -> Known:
    """A term that is a number over what it is stated as, or over `of`."""
    per = stated.value if of is None else of
    u = max(stated.standard_uncertainty / abs(per), EXACT)
    return Known(
        term, stated.value / per, u, identity, stated.distribution, stated.unit, per, stated.standard_uncertainty
    )


def _of_currents(at: Terms, rig: RigFile, some: Sequence[Phase]) -> Iterator[Known]:
    for k, phase in enumerate(some):
        sensor = rig.sensors[phase.current]
        for name, stated, part in (("current", sensor.gain, "gain"), ("offset", sensor.offset, "offset")):
            u = max(stated.standard_uncertainty, EXACT)
            identity = f"sensors/{phase.current}/{part}"
            yield Known(at.each(name).start + k, stated.value, u, identity, stated.distribution, stated.unit)


def _of_encoders(at: Terms, both: tuple[Cell, Cell]) -> Iterator[Known]:
    x, angle = (cell.axis for cell in both)
    wide = EXACT if angle.error is None else _half(angle.error) / math.sqrt(2)  # of each part of a sine
    for k, part in enumerate(("cosine", "sine")):
        yield Known(at.once.start + k, 0.0, max(wide, EXACT), f"encoders/{angle.name}/error/{part}", "arcsine", "rad")
    count = 0.0 if angle.pitch is None else angle.pitch.value
    for p in range(at.places):
        yield Known(at.off.start + p, 0.0, max(COUNT * count, EXACT), f"counts/{angle.name}/{p}")
    if x.pitch is None:
        yield Known(at.scale, 1.0, EXACT, f"encoders/{x.name}/pitch")
    else:
        yield _share(at.scale, x.pitch, f"encoders/{x.name}/pitch")


def _half(number: Toleranced) -> float:
    return number.standard_uncertainty
