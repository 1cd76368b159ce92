"""Load cells of a simulated rig that hold its shaft: each reads what is pressed on it with an error of its own, as is stated.

    reading = sign (gain L + sum of cross L' + noise) + zero + drift t,     rounded to its resolution

L is the load in the cell's own unit, around N at the end of the arm where it has one; L' the loads of the other cells; t
since its first reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_cells import LoadCell
from bench.rigfile.check_load_cells import reads
from bench.rigfile.toleranced import Toleranced
from sim_backend.draws import draw_one, uniform
from sim_backend.machine import Truth

READING_S: Final = 0.2
ZERO: Final = 0.5  # of its unit, to either side: where a display was left
DEFECTS: Final = {"cell_sign": 1.0, "cell_zero": 0.0, "cell_drift": 0.0, "cell_mistyped": 0.0}
"""Planted in every cell, with their harmless values: the way in which it counts, what it reads of nothing, by how much that
wanders in a second (both in its own unit), and the number of the reading that is typed with its point one place off."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """What is drawn of each cell, by name."""
    out: dict[str, Toleranced] = {}
    for axis, cell in rig.capabilities.load_cells.items():
        out |= {f"load_cells.{axis}.gain": cell.gain, f"load_cells.{axis}.give": cell.give}
        out |= {f"load_cells.{axis}.cross.{other}": number for other, number in cell.cross.items()}
    return out


class Cells:
    """All of a rig's; `loads` give what is pressed on one by its axis, N or N m, `now` s."""

    def __init__(
        self, rig: RigFile, truth: Truth, loads: Mapping[str, Callable[[], float]], now: Callable[[], float]
    ) -> None:
        self._rig, self._truth, self._loads, self._now = rig, truth, loads, now
        self._begun: dict[str, float] = {}
        self._count = 0

    def gives(self, axis: str) -> float:
        """How far one truly yields, m/N or rad/(N m)."""
        return self._truth.values[f"load_cells.{axis}.give"]

    def request(self, axis: str) -> str:
        """What the operator's line answers to `cell AXIS`."""
        cell = self._rig.capabilities.load_cells.get(axis)
        if cell is None or axis not in self._loads:
            return f"error no load cell holds {axis}"
        symbol = cell.unit or reads(cell, self._rig.encoders[axis].measures == "angle")
        return f"ok {READING_S} {self.shown(axis, cell) / units.unit(symbol).factor!r} {symbol}"

    def shown(self, axis: str, cell: LoadCell) -> float:
        """Its next reading, SI of its own unit."""
        values, defects, seed, visit = self._truth.values, self._truth.defects, self._truth.seed, self._truth.visit
        self._count += 1
        noise = (
            draw_one(cell.noise, seed, f"load_cells.{axis}.noise.{self._count}", visit)
            if cell.noise is not None
            else 0.0
        )
        read = values[f"load_cells.{axis}.gain"] * self._load(axis) + noise
        read += sum(values[f"load_cells.{axis}.cross.{other}"] * self._load(other) for other in cell.cross)
        since = self._now() - self._begun.setdefault(axis, self._now())
        zero = ZERO * (2 * uniform(seed, f"load_cells.{axis}.zero", visit) - 1) + defects["cell_zero"]
        shown = cell.sign * defects["cell_sign"] * read + zero + defects["cell_drift"] * since
        if self._count == int(defects["cell_mistyped"]):
            shown *= 10
        return round(shown / cell.resolution) * cell.resolution if cell.resolution else shown

    def _load(self, axis: str) -> float:
        arm = self._rig.capabilities.load_cells[axis].arm
        length = self._truth.values[arm.replace("/", ".")] if arm else 1.0
        return self._loads[axis]() / length
