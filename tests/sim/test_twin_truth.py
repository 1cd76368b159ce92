"""What a rig's twin truly does under a plan, against its linear model and against what an ideal controller would show."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import RigFile, load_rig
from sim_backend.machines.twin.quiet import Sight, floating
from sim_backend.machines.twin.truth_step import steps_asked
from sim_backend.motion import StepsAsked
from sim_backend.truth import draw

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = "vertical-spindle/spindle.toml", "plain-stand/stand.toml"


def rig_of(path: str) -> RigFile:
    return load_rig(str(EXAMPLES / path))


def asked(
    rig: RigFile, points: Mapping[str, float], sizes: tuple[float, ...] = (1e-5,), speed: float = 0.0
) -> StepsAsked:
    """Steps along y by the set points of both bearings' first axes."""
    settings = {name: p.default for name, p in rig.parameters.items()}
    return StepsAsked(
        settings, "y", lambda end: {name: end * way for name, way in points.items()}, sizes, speed, 0.1, 1.0, 0.0
    )


Y = {"TargetLowerU": 1.0, "TargetUpperU": 1.0}


def test_small_steps_swing_as_the_slowest_mode_of_the_linear_model() -> None:
    """Two ways to one number: steps of ten nanometres of the core, and eigenvalues of the matrix of a tick."""
    rig = rig_of(SPINDLE)
    drawn = draw(rig, 1)
    small, shown = steps_asked(rig, drawn, asked(rig, Y))
    assert small.frequency == pytest.approx(drawn.quantities["frequency"], rel=0.005)
    assert small.damping == pytest.approx(drawn.quantities["damping"], rel=0.005)
    assert {*shown} == {(1e-5, 1), (1e-5, -1)}
    up, down = shown[1e-5, 1], shown[1e-5, -1]
    assert up.overshoot == pytest.approx(down.overshoot, rel=0.01)  # no weight across a shaft that stands
    assert up.y[-1] == pytest.approx(1.0, abs=1e-6)  # as read, by its integrators


def test_what_probes_tell_of_a_step_is_off_by_their_gains() -> None:
    rig = rig_of(SPINDLE)
    gains = {"DispLowerU.gain": 1.01, "DispUpperU.gain": 1.01}
    _, shown = steps_asked(rig, draw(rig, 2, gains), asked(rig, Y))
    assert shown[1e-5, 1].steady_error == pytest.approx(1e-5 / 1.01 - 1e-5, rel=0.02)


def test_a_planted_factor_of_a_set_point_is_in_what_is_shown() -> None:
    rig = rig_of(SPINDLE)
    halved = {"factor_TargetLowerU": 0.5, "factor_TargetUpperU": 0.5}
    _, shown = steps_asked(rig, draw(rig, 2, halved), asked(rig, Y))
    assert shown[1e-5, 1].y[-1] == pytest.approx(0.5, abs=1e-4)


@pytest.mark.parametrize("path", [SPINDLE, STAND], ids=["spindle", "stand"])
def test_sight_tells_the_shaft_from_drawn_probes(path: str) -> None:
    """The state of the core is the shaft itself: y, z, psi, theta, x of its centre of mass."""
    rig = rig_of(path)
    drawn = draw(
        rig, 3, {name: 0.0 for name in draw(rig, 3).values if name.startswith("runout_") and "phase" not in name}
    )
    made = floating(rig, drawn, {}, settle_s=0.2)
    sight, plant = Sight(rig, made.plant.params, drawn.values), made.plant
    seen = []
    for moved in (0.0, 1.0):
        s = plant.state()["s"]
        s[:5] = moved * np.array([3e-6, 1e-5, -2e-5, 4e-5, 5e-5])
        other = plant.twin()
        other.set_state(s)
        seen.append(sight.shaft(other.run(1, 1)[1], True)[:, 0])
    y, z, x, theta, psi = seen[1] - seen[0]
    assert np.hypot(y, z) == pytest.approx(np.hypot(1e-5, 2e-5), rel=1e-6)
    assert (theta / sight.arm, -psi / sight.arm) == pytest.approx((5e-5, 4e-5), rel=1e-6)
    assert x == pytest.approx(3e-6 if sight.along else 0.0, rel=1e-6)
