"""The motor's constants of a served rig, taken from its truth, for the tests of what rests on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from bench.calibration import Calibration
from bench.calibration.store import Store
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence


def adopt(name: str, folder: Path, true: Mapping[str, float]) -> None:
    """The constants as other procedures would have found them, to a thousandth."""
    turn = 8 * true["gamma_0"]
    known = {
        "force-constant": {
            "alpha_d@0": true["alpha_ratio"] * true["alpha_c"] * math.cos(turn),
            "alpha_d": true["alpha_d"],
            "alpha_dx": true["alpha_dx"],
        },
        "negative-stiffness": {"alpha_x_prime": true["alpha_x_prime"]},
        "force-coupling": {name: true[name] for name in ("alpha_ratio", "alpha_c", "gamma_0")},
    }
    rig = load_rig(name)
    store = Store.of(rig, None, folder)
    for procedure, values in known.items():
        estimates = {
            key: Estimate.of(value, Influence(f"{procedure}/{key}", key, 1e-3 * abs(value), "1", "B", "normal"))
            for key, value in values.items()
        }
        store.adopt(
            Calibration(
                procedure, estimates, run_id=procedure, rig=name, uut=rig.uut.serial, backend="served", sha256="0" * 64
            )
        )
