"""From operating points with forces and torque to the constants of a force map: what can be told, what is worth keeping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bench.errors import AnalysisError
from procedures.force_map import fit as force_map_fit
from procedures.force_map import selection as force_map_selection
from procedures.force_map.fit import FORCE_TERMS, TORQUE_TERMS, Array, Fit, Identifiability
from procedures.force_map.selection import Selection
from procedures.force_map.table import Table


@dataclass(frozen=True)
class Part:
    """The forces or the torque: its `design` (n, r, k) over `terms`, what was `measured` (n, r), which terms the points can
    tell, how they were selected, and the fit of those kept."""

    name: str
    unit: str
    terms: tuple[str, ...]
    design: Array
    measured: Array
    told: Identifiability
    selection: Selection
    fit: Fit

    @property
    def dropped(self) -> tuple[str, ...]:
        """Terms that could be identified and were not worth keeping."""
        return tuple(n for n in self.terms if n not in self.fit.terms and n not in self.told.unidentifiable)


def identify(table: Table, poles: int) -> tuple[Part, ...]:
    """The force map of a table; forces first, then the torque, whichever there are.

    Raises:
        AnalysisError: too few points for what they should tell.
    """
    parts = []
    if table.force is not None:
        design = force_map_fit.force_design(table.points, poles)
        parts.append(part("force", "N", FORCE_TERMS, design, table.force, table.u_force))
    if table.torque is not None:
        design = force_map_fit.torque_design(table.points, poles)
        parts.append(part("torque", "N m", TORQUE_TERMS, design, table.torque, table.u_torque))
    return tuple(parts)


def part(name: str, unit: str, terms: Sequence[str], design: Array, measured: Array, u: Array | None) -> Part:
    """One part; where no point can be spared to judge the terms, every term that can be identified is kept.

    Raises:
        AnalysisError: no term is excited, or there are no more values than terms.
    """
    told = force_map_fit.identifiability(design, terms)
    clear = [n for n in terms if n not in told.unidentifiable]
    if not clear:
        raise AnalysisError(
            f"{name}: {len(measured)} points determine none of its {len(terms)} terms; expected more points, with currents"
        )
    if measured.size <= len(clear):
        raise AnalysisError(
            f"{name}: found {measured.size} values at {len(measured)} points for {len(clear)} terms; expected more points, "
            "so that values are left to tell the scatter"
        )
    columns = [list(terms).index(n) for n in clear]
    selection = force_map_selection.select(design[:, :, columns], measured, u, clear)
    keep = clear if selection.chosen is None else selection.chosen.terms
    fitted = force_map_fit.fit(design, measured, u, terms, keep)
    return Part(name, unit, tuple(terms), design, measured, told, selection, fitted)
