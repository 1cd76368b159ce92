"""The truth of a balancing of a rig's twin: which unbalance turned in each run, weights with their own errors included, each on
the scale of its plane as it stands on the shaft."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.twin.layout import Geometry, layout_of
from sim_backend.machines.twin.operator import Fitter

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def _shares(at: Sequence[float], chosen: Sequence[int]) -> Array:
    """Of each plane at `at` in the two chosen ones, (2, planes): by force and moment, all that a rigid shaft feels."""
    one, other = (at[k] for k in chosen)
    out = np.array([[(other - x) / (other - one), (x - one) / (other - one)] for x in at]).T
    out[:, chosen] = np.eye(2)
    return out


class Ledger:
    """In place of the plant: keeps what is fixed, (planes,) kg m from the mark in the sense of the speed."""

    def __init__(self, planes: int) -> None:
        self.fixed = np.zeros(planes, complex)

    def weights(self, plane: int, unbalance: float, angle: float) -> None:
        """One more."""
        self.fixed[plane] += cmath.rect(unbalance, angle)

    def without_weights(self, plane: int) -> None:
        """Every one of a plane off."""
        self.fixed[plane] = 0


def left(rig: RigFile, truth: Truth, events: Iterable[Mapping[str, Any]], names: Sequence[str]) -> list[Complex]:
    """The unbalance of the planes of these names, kg m on their scales, at first and after each of the operator's events of a
    recording. Of more planes than these two, what is in the others acts on a rigid shaft like so much in the two."""
    p, stated = truth.plant, list(rig.balancing)
    ledger = Ledger(len(stated))
    own = np.array([cmath.rect(p.unbalance[k], p.unbalance_phase[k]) for k in range(len(stated))])
    hands = Fitter(rig, ledger, truth)  # type: ignore[arg-type]
    geometry = Geometry(rig, layout_of(rig), truth.values)
    shares = _shares([geometry.station(f"balancing/{name}") for name in stated], [stated.index(name) for name in names])

    def told() -> Complex:
        whole, out = shares @ (own + ledger.fixed), []
        for name, u in zip(names, whole.tolist(), strict=True):
            plane = rig.balancing[name]
            zero = 0.0 if plane.zero is None else geometry.number(plane.zero, f"balancing.{name}.zero")
            on = u * cmath.exp(-1j * zero)
            out.append(on if plane.sense > 0 else on.conjugate())
        return np.array(out)

    made = [told()]
    for e in events:
        if e["action"] == "attach":
            hands.request(f"attach {e['plane']} {e['mass_kg']!r} {e['angle_rad']!r}")
        elif e["action"] == "detach":
            hands.request(f"detach {e['plane']}")
        made.append(told())
    return made
