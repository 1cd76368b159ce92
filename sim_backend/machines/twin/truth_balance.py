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

Complex = npt.NDArray[np.complex128]


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
    recording."""
    p, stated = truth.plant, list(rig.balancing)
    ledger = Ledger(len(stated))
    own = np.array([cmath.rect(p.unbalance[k], p.unbalance_phase[k]) for k in range(len(stated))])
    hands = Fitter(rig, ledger, truth)  # type: ignore[arg-type]
    geometry = Geometry(rig, layout_of(rig), truth.values)

    def told() -> Complex:
        whole, out = own + ledger.fixed, []
        for name in names:
            plane, u = rig.balancing[name], complex(whole[stated.index(name)])
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
