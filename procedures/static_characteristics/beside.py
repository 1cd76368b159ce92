"""Another map that force and torque are held against: the one that pulses found by flux, or the controller's own.

Pulses know flux, cells force: what ties them is the co-energy, no certificate but that of the currents. So forces by that map
are a prediction, and the ratio is a check of all that both rest on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.stages.map_model import names
from procedures.stages.stators import Phase
from procedures.static_characteristics.model import MAP, Array

TURNED = ("cosine", "sine")


@dataclass(frozen=True)
class Beside:
    """A map by the numbers of the formula, `estimates` in the order of `MAP` and then gains by phase; `by` what it is
    called."""

    by: str
    estimates: tuple[Estimate, ...]

    @property
    def values(self) -> Array:
        """Alone."""
        return np.array([e.value for e in self.estimates])

    @staticmethod
    def split(values: Array) -> tuple[dict[str, float], Array]:
        """The map's numbers by name, and gains (6,)."""
        return dict(zip(MAP, map(float, values), strict=False)), values[len(MAP) :]


def by_flux(found: Mapping[str, Estimate], some: Sequence[Phase]) -> Beside | None:
    """Of a calibration by `inductance-map`; None where it lacks a number."""
    stators = list(dict.fromkeys(p.motor for p in some))
    zeros = {f"zero_{k + 1}": f"zero@{stator}" for k, stator in enumerate(stators)}
    wanted = [
        *(zeros.get(name, f"uneven@{name}" if name in TURNED else name) for name in MAP),
        *(f"gain@{p.name}" for p in some),
    ]
    if any(name not in found for name in wanted):
        return None
    return Beside("the map by flux", tuple(found[name] for name in wanted))


def of_controller(rig: RigFile, some: Sequence[Phase]) -> Beside | None:
    """As its parameters are by default; None where it has no such map."""
    stators = list(dict.fromkeys(p.motor for p in some))
    model, out = rig.capabilities.model, {}
    for meaning, name in names(stators, [p.name for p in some]).items():
        known = rig.parameters.get(model.get(meaning, ""))
        if known is None:
            return None
        out[meaning.removeprefix("map_") if meaning.startswith("map_zero") else name] = known.default
    wanted = [*(out.get(name, 0.0) for name in MAP), *(out[f"gain@{p.name}"] for p in some)]
    return Beside("the controller's map", tuple(Estimate.exact(float(v)) for v in wanted))
