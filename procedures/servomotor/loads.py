"""Known masses on hanger and lever: whether a rig has those of a plan, their certificates, and which hung in each step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.shared.certificates import certified


def check_masses(rig: RigFile, masses: Sequence[str]) -> Iterator[str]:
    """What is wrong with the masses of a plan."""
    if unknown := [m for m in masses if m not in rig.masses]:
        yield f"masses: found {', '.join(unknown)}; the rig file certifies {', '.join(rig.masses)}"
        return
    kg = [rig.masses[m].value for m in masses]
    if kg != sorted(kg) or len(set(kg)) != len(kg):
        yield f"masses: found {kg} kg; expected different masses in ascending order"


def certified_weighing(rig: RigFile) -> dict[str, Estimate]:
    """What turns a mass into its weight in air: gravity m/s^2, densities of air and masses kg/m^3."""
    return {
        "gravity": certified("site/gravity", rig.site.gravity, "local gravity"),
        "air_density": certified("site/air_density", rig.site.air_density, "air density (buoyancy)"),
        "mass_density": certified("masses/density", rig.mass_density, "density of the masses (buoyancy)"),
    }


def certified_masses(rig: RigFile, masses: Sequence[str]) -> dict[str, Estimate]:
    """`mass_<k>` in kg of each of the masses."""
    return {f"mass_{k}": certified(f"masses/{m}", rig.masses[m], f"mass {m}") for k, m in enumerate(masses)}


def load_index(hung: Sequence[str], masses: tuple[str, ...], where: str) -> npt.NDArray[np.int64]:
    """Index (N,) into `masses` by the labels of what `hung`; -1 for nothing.

    Raises:
        AnalysisError: something else hung there, on the `where` ("hanger", "lever").
    """
    index = {"": -1} | {label: k for k, label in enumerate(masses)}
    if strange := sorted(set(hung) - set(index)):
        raise AnalysisError(
            f"masses: found {', '.join(strange)} on the {where}; expected those of the plan, {', '.join(masses)}"
        )
    return np.array([index[label] for label in hung])
