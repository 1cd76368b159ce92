"""The truth of a balancing on the AMB stand: which unbalance turned in each run, weights with their own errors included."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.amb5dof.operator import PLANES, Balancer

Complex = npt.NDArray[np.complex128]


class Ledger:
    """In place of the plant: keeps what is fixed, (2,) kg m from y towards z."""

    def __init__(self) -> None:
        self.fixed = np.zeros(2, complex)

    def weights(self, plane: int, unbalance: float, angle: float) -> None:
        """One more."""
        self.fixed[plane] += cmath.rect(unbalance, angle)

    def without_weights(self, plane: int) -> None:
        """Every one of a plane off."""
        self.fixed[plane] = 0


def left(rig: RigFile, truth: Truth, events: Iterable[Mapping[str, Any]]) -> list[Complex]:
    """The shaft's whole unbalance (2,) kg m on the scale, at first and after each of the operator's events of a recording."""
    ledger, p = Ledger(), truth.plant
    own = np.array([cmath.rect(u, phase) for u, phase in zip(p.unbalance, p.unbalance_phase, strict=True)])
    hands = Balancer(ledger, rig, truth)  # type: ignore[arg-type]
    out = [own + ledger.fixed]
    for e in events:
        if e["action"] == "attach":
            hands.request(f"attach {e['plane']} {e['mass_kg']!r} {e['angle_rad']!r}")
        elif e["action"] == "detach":
            hands.request(f"detach {e['plane']}")
        out.append(own + ledger.fixed)
    return out


__all__ = ["PLANES", "left"]
