"""Load cells that hold the rotary-linear motor: wound from both sides, their mean is what acts; each reads with its errors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from bench.rigfile import load_rig
from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.device import StagePlant
from sim_backend.machines.rlsrm.operator import Attendant
from sim_backend.truth import draw

RIG = load_rig("rlsrm")


class Stand:
    def __init__(self, planted: Mapping[str, float] | None = None) -> None:
        self.truth = draw(RIG, 4, planted)
        self.plant = StagePlant(self.truth.plant, 4)
        self.attendant = Attendant(RIG, self.plant, self.truth)
        self.core = self.plant.core
        self.core.put(5e-3, 0.3, 0.0, 0.0)
        self.core.power_on()
        self.core.command("ready")
        self.ask("mount cells")

    def ask(self, line: str) -> list[str]:
        said = self.attendant.request(line).split()
        assert said[0] == "ok", said
        self.core.run(float(said[1]), every=0)
        return said

    def both(self, read: bool = False) -> Array:
        rows = []
        for side in ("above", "below"):
            self.ask(f"wind {side}")
            rows.append([float(self.ask(f"cell {axis}")[2]) for axis in ("x", "angle")] if read else self.core.carried)
        return np.array(rows)


def test_the_mean_of_both_sides_is_what_acts() -> None:
    """Friction is held around by up to its own size, and hardly any along, for what turns has none there."""
    stand = Stand()
    without = stand.both()
    stand.core.set("test_phase", 0.0)
    stand.core.set("test_current", 4.0)
    found = stand.both()
    assert found.mean(axis=0) - without.mean(axis=0) == pytest.approx(stand.core.acting, rel=2e-3, abs=2e-4)
    half = np.abs(found[0] - found[1]) / 2
    p = stand.truth.plant.plant
    assert 0.3 * p.coulomb_angle < half[1] <= p.coulomb_angle
    assert half[0] < 0.1 * p.coulomb


def test_what_they_read() -> None:
    """Gain, cross-talk and arm of the truth; zeros fall out."""
    planted = {"load_cells.x.gain": 1.02, "load_cells.angle.gain": 1.0, "load_cells.angle.cross.x": 0.03,
               "load_cells.x.cross.angle": 0.0, "geometry.torque_arm": 0.11, "cell_zero": 5.0}  # fmt: skip
    stand = Stand(planted)
    without = stand.both(read=True).mean(axis=0)
    stand.core.set("test_phase", 1.0)
    stand.core.set("test_current", 5.0)
    read = stand.both(read=True).mean(axis=0) - without
    force, torque = stand.core.acting
    assert read[0] == pytest.approx(1.02 * force, abs=0.01)
    assert read[1] == pytest.approx(torque / 0.11 + 0.03 * force, abs=0.01)


def test_what_is_refused() -> None:
    stand = Stand()
    assert stand.attendant.request("cell y").startswith("error")
    stand.ask("mount -")
    assert stand.attendant.request("wind above").startswith("error")
