"""What a rig's twin truly does under a plan, against its linear model and against what an ideal controller would show."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.rigfile import RigFile, load_rig
from benchmarks import drawn_rigs
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.frame import describe
from procedures.step.position import leans, shares
from sim_backend.machines.stepping import Shown
from sim_backend.machines.twin import truth_sensitivity, truth_whirl
from sim_backend.machines.twin.quiet import Sight, floating
from sim_backend.machines.twin.truth_step import steps_asked
from sim_backend.motion import DragAsked, StepsAsked, drag
from sim_backend.truth import draw

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = "vertical-spindle/spindle.toml", "plain-stand/stand.toml"


def rig_of(path: str) -> RigFile:
    return load_rig(str(EXAMPLES / path))


def _spindle(folder: Path, *changes: tuple[str, str]) -> str:
    """The spindle's rig file with changes."""
    text = (EXAMPLES / SPINDLE).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    for path in (EXAMPLES / SPINDLE).parent.glob("*.dbc"):
        (folder / path.name).write_bytes(path.read_bytes())
    (folder / "spindle.toml").write_text(text, encoding="utf-8")
    return str(folder / "spindle.toml")


def asked(
    rig: RigFile, points: Mapping[str, float], sizes: tuple[float, ...] = (1e-5,), speed: float = 0.0
) -> StepsAsked:
    """Steps along y by the set points of both bearings' first axes."""
    settings = {name: p.default for name, p in rig.parameters.items()}
    return StepsAsked(
        settings, "y", lambda end: {name: end * way for name, way in points.items()}, sizes, speed, 0.1, 1.0, 0.0
    )


Y = {"TargetLowerU": 1.0, "TargetUpperU": 1.0}


def test_a_shaft_that_its_noise_alone_lifts_has_no_truth(tmp_path: Path) -> None:
    """Bearings so weak that it hangs on a ring until noise shakes it off: taken for floating there, its steps were truly
    nothing, and the run's results 120 to 3000 U off."""
    rig = load_rig(str(drawn_rigs.write("spindle", 8, tmp_path)))
    with pytest.raises(AnalysisError, match="does not lift without its noise"):
        floating(rig, draw(rig, 5), {})


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


def test_small_motions_of_a_turning_shaft_are_those_of_its_mean() -> None:
    """Gyroscopic moments hardly reach a centre of mass between its bearings. From one phase of the unbalance alone damping was
    1 % and frequency 1.5 % off, and up or down, 10 or 20 um settled .2 ms apart."""
    rig = rig_of(SPINDLE)
    drawn, of = draw(rig, 1), dataclasses.replace(asked(rig, Y), sizes=(1e-5, 2e-5), record_s=0.4, wait_s=2.0)
    rests, _ = steps_asked(rig, drawn, of)
    turns, shown = steps_asked(rig, drawn, dataclasses.replace(of, speed=600.0))
    assert turns.frequency == pytest.approx(rests.frequency, rel=0.003)
    assert turns.damping == pytest.approx(rests.damping, rel=0.003)
    assert np.ptp([s.settling_time(0.02, 2 * math.pi / 600.0) for s in shown.values()]) < 4e-5


def test_axes_that_are_not_at_right_angles_have_z_across_y(tmp_path: Path) -> None:
    """A step along z moves the second axis of each bearing by sin a, and the shaft by the whole of it across y."""
    rig = load_rig(_spindle(tmp_path, ("plus_deg = 90", "plus_deg = 60")))
    points = conventions(rig).point("z", 1.0)
    assert sorted(points) == ["TargetLowerV", "TargetUpperV"]
    assert [*points.values()] == pytest.approx([math.sin(math.radians(60))] * 2)
    plan = dataclasses.replace(asked(rig, points), axis="z", record_s=2.5)
    _, shown = steps_asked(rig, draw(rig, 1, {f"{c}.gain": 1.0 for c in shares(rig, "z")}), plan)
    assert abs(shown[1e-5, 1].steady_error) < 2e-8  # along the second axis it would be 1.34 um short
    assert shown[1e-5, 1].y[-1] == pytest.approx(1.0, abs=1e-3)
    assert leans(rig)
    assert not leans(rig, "x")
    assert not leans(rig_of(SPINDLE))
    frame = next(iter(describe(rig, "yz"))).text
    assert "y is along LowU and UppU, 30°" in frame
    assert "z is across y, to the side of LowV and UppV, 120°" in frame  # LowV itself is at 90 degrees


def test_a_probe_that_counts_the_other_way_makes_no_axes_square(tmp_path: Path) -> None:
    """With axes 60 degrees apart one oscillation was fitted to two, as soon as a probe read against its axis: 17 U off."""
    rig = load_rig(
        _spindle(
            tmp_path,
            ("plus_deg = 90", "plus_deg = 60"),
            ('channel = "DispUpperV"', 'channel = "DispUpperV", sign = -1'),
        )
    )
    assert not conventions(rig).probed
    assert leans(rig)


def test_bearings_that_are_turned_to_each_other(tmp_path: Path) -> None:
    """y is along the first axis of the bearing nearest to the near end; the other bearing's lies beside it."""
    upper = "axes.UppU = { direction = { value = "
    rig = load_rig(_spindle(tmp_path, (f"{upper}30", f"{upper}40")))
    assert "y is along LowU, 30° from" in next(iter(describe(rig, "yz"))).text
    assert "(UppU is at 40°)" in next(iter(describe(rig, "yz"))).text


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


@pytest.mark.parametrize("axis", [0, 3])
def test_the_loop_s_sensitivity_is_that_of_injected_sines(axis: int) -> None:
    """Two ways to one number: the linear model's, and the core's own injection into an axis of the machine without noise. Its
    runout, the errors of its current sensors and the weight that its bearings carry shift where it floats."""
    rig = rig_of(STAND)
    drawn = draw(rig, 1)
    settings = {name: p.default for name, p in rig.parameters.items()}
    names = [a for b in rig.bearings.values() for a in b.axes]
    made, plant = truth_sensitivity.loop(rig, drawn, settings, names), floating(rig, drawn, settings).plant
    for hz in (20.0, 80.0, 250.0):
        other = plant.twin()
        for key, value in (("axis", axis), ("hz", hz), ("amplitude", 1e-3), ("lines", 1.0)):
            other.set(f"inject.{key}", value)
        other.run(round(1.0 / other.tick_s))
        trace = other.run(round(0.5 / other.tick_s), 1)[1]
        into, after = (trace[:, other.trace_channels.index(name)] for name in ("inject", "after"))
        wave = np.exp(-2j * np.pi * hz * other.tick_s * np.arange(len(trace)))
        seen = (wave @ (after - after.mean())) / (wave @ into)
        assert made.sensitivity(hz)[0, axis] == pytest.approx(seen, rel=5e-5), hz


def test_a_shaft_that_turns_whirls_as_its_unbalance_makes_it() -> None:
    """Small orbits go with the unbalance, most in its own plane; the second probe comes a quarter of a turn later."""
    rig = rig_of(SPINDLE)
    values = {name: 0.0 for name in draw(rig, 2).values if name.startswith("runout_") and "phase" not in name}
    settings = {name: p.default for name, p in rig.parameters.items()}
    channels = ["DispLowerU", "DispLowerV", "DispUpperU", "DispUpperV"]
    once, twice = (
        truth_whirl.whirl(
            rig, draw(rig, 2, {**values, "unbalance.lower": size, "unbalance.upper": 0.0}), settings, 600.0, channels
        )
        for size in (1e-6, 2e-6)
    )
    assert np.abs(twice.shaft) == pytest.approx(2 * np.abs(once.shaft), rel=0.02)
    assert abs(once.shaft[0]) > 2 * abs(once.shaft[2])  # the plane of the weight
    lag = np.angle(once.shaft[1] / once.shaft[0])
    assert lag == pytest.approx(-np.pi / 2, abs=0.05)  # the second probe is a quarter of a turn on
    far = np.abs(once.shaft).max()
    assert once.d_max[0] > 0.9 * far


def test_a_shaft_that_turns_freely_is_stopped_by_the_drag_that_is_told() -> None:
    """J w' = -B w - T_c from 300 rad/s, in closed form: w = (w_0 + T_c/B) exp(-B t/J) - T_c/B."""
    rig = rig_of(SPINDLE)
    drawn = draw(rig, 1)
    told = drag(drawn, DragAsked(0.0, 0.0, False))
    plant = floating(rig, drawn, {name: p.default for name, p in rig.parameters.items()}, 300.0, 0.5).plant
    plant.drive(None)
    begin = float(plant.state()["s"][11])
    plant.run(round(2.0 / plant.tick_s))
    level = told["T_c"] / told["B"]
    expected = (begin + level) * np.exp(-told["B"] / told["J_z"] * 2.0) - level
    assert begin - float(plant.state()["s"][11]) == pytest.approx(begin - expected, rel=1e-3)


def test_a_bending_mode_far_above_is_no_bandwidth() -> None:
    """A loop of 70 Hz with a mode that rings at 420 Hz: the gain falls below -3 dB, and is above it again there."""
    t = np.arange(0, 0.5, 5e-5)
    w, mode = 2 * np.pi * 70, 2 * np.pi * 420
    swing = 1 - np.exp(-0.7 * w * t) * (np.cos(0.714 * w * t) + 0.98 * np.sin(0.714 * w * t))
    rings = 0.2 * np.exp(-20 * t) * np.sin(mode * t)
    alone, both = (Shown(t, y, 0.0, 5e-5).bandwidth for y in (swing, swing + rings))
    assert alone == pytest.approx(70, rel=0.02)
    assert both == pytest.approx(70, rel=0.1)
