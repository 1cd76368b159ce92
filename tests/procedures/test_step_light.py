"""A light fast rotor turns its currents round within the telemetry by which a step's start is told; bearings that are turned
against each other hold the shaft by levers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.uncertainty import interval
from procedures.amb_rotor.conventions import conventions
from procedures.step.acting import START_S, UNLIKE, Acted, acted_together
from procedures.step.following import Push, by_distance, is_told, motion
from procedures.step.held import asked_over_sent

Array = npt.NDArray[np.float64]
SPINDLE = Path(__file__).resolve().parents[2] / "examples" / "vertical-spindle"
TICK, LAG, REST, AFTER = 2.5e-5, 6e-5, 1600, 800  # s, s, ticks


def stepped(hz: float, damping: float) -> tuple[Array, Array]:
    """Readings of a control current and of the position, by tick, of a rotor that a sampled law holds by its distance from the
    set point and by the difference of two readings; the set point is 1 from the reading REST on."""
    w, keep = 2 * np.pi * hz, np.exp(-TICK / LAG)
    y = speed = current = told = before = 0.0
    out = []
    for k in range(REST + AFTER):
        out.append((current, y))
        applied, told = told, float(k >= REST) - y - 2 * damping / w * (y - before) / TICK
        before = y
        follows = applied + (current - applied) * keep
        pull = w * w * (current + follows) / 2
        y += speed * TICK + pull * TICK**2 / 2
        speed += pull * TICK
        current = follows
    both = np.array(out)
    return both[:, 0], both[:, 1]


def means(x: Array, ticks: int, phase: int) -> Array:
    return x[phase : phase + (len(x) - phase) // ticks * ticks].reshape(-1, ticks).mean(axis=1)


def pushes(ticks: int, hz: float, damping: float, noise: float = 0.0, seed: int = 1) -> list[Push]:
    """Steps at every second phase of the telemetry's period, with noise of the readings' means."""
    current, y = stepped(hz, damping)
    rng, out = np.random.default_rng(seed), []
    for phase in range(0, ticks, 2):
        c, x = (means(z, ticks, phase) for z in (current, y))
        t = TICK * (phase + ticks * np.arange(1, len(c) + 1))
        period, first = ticks * TICK, float(t[int(np.argmax(c > 0.25 * c.max()))])
        c, x = (z + rng.normal(0, noise, len(z)) for z in (c, x))
        out.append(Push(t, c, x, first - 1.8 * period, first - 0.5 * period, TICK, ticks, LAG))
    return out


def starts(of: list[Push], *, by_distance: bool = True) -> tuple[Array, list[Acted]]:
    """How late starts are told, s, and all that is; the law has the set point at the next reading."""
    found = acted_together(of, np.ones(len(of)), by_distance=by_distance)
    return np.array([a.began for a in found]) - (REST - 1) * TICK, found


@pytest.mark.parametrize("ticks", [10, 20])
def test_what_the_shaft_does_is_known_to_the_start(ticks: int) -> None:
    """Telemetry of 0.25 and 0.5 ms beside a rise of 1.4 ms: within 20 us, at every phase of the step in its period; and within
    what is said of it."""
    late, found = starts(pushes(ticks, 150.0, 0.6))
    assert np.abs(late).max() < 2e-5
    assert abs(late.mean()) < found[0].half < 2e-5
    assert max(a.unlike for a in found) < UNLIKE / 2


def test_a_square_of_time_is_not_what_a_light_rotor_does() -> None:
    late, found = starts(pushes(20, 150.0, 0.6), by_distance=False)
    assert late.mean() < -4e-5
    assert {(a.half, a.noise) for a in found} == {(START_S, 0.0)}


def test_noise_makes_no_start_early_and_is_told() -> None:
    """1 % of the step in each reading: motions told by single steps made the start 24 us early, since what is read at rest is
    noise. Steps scatter about their run as is said; so does the whole run, within its half width."""
    runs = [starts(pushes(20, 150.0, 0.6, noise=0.01, seed=seed)) for seed in range(16)]
    late, said = np.array([of for of, _ in runs]), [a.noise for _, found in runs for a in found]
    assert abs(late.mean()) < 1.5e-5
    about = late - late.mean(axis=0)
    run = about.mean(axis=1, keepdims=True)
    assert (about - run).std() == pytest.approx(np.mean(said), rel=0.4)
    assert run.std() < np.mean([found[0].half for _, found in runs])


def test_readings_that_are_noise_tell_no_motion() -> None:
    """1 % of the step, beside a shaft that goes all of it within four periods and one that goes a fifth."""
    for hz, told in ((150.0, True), (60.0, False)):
        of = pushes(20, hz, 0.6, noise=0.01)
        begans = np.full(len(of), (REST - 1) * TICK)
        assert is_told(motion(of, begans, np.ones(len(of))), 20 * TICK) is told


def turned(folder: Path) -> RigFile:
    """The spindle with its upper bearing, and what looks along it, an eighth of a turn on."""
    text = (SPINDLE / "spindle.toml").read_text(encoding="utf-8")
    axis = r"(axes\.UppU = \{ direction = \{ value = )30,"
    text, times = re.subn(axis, r"\g<1>75,", text)
    assert times == 1
    (folder / "spindle.toml").write_text(text, encoding="utf-8")
    (folder / "spindle.dbc").write_bytes((SPINDLE / "spindle.dbc").read_bytes())
    return load_rig(str(folder / "spindle.toml"))


def test_a_step_is_what_was_sent_at_the_centre_of_mass(tmp_path: Path) -> None:
    """20 um at 45 degrees are 14.142 um, sent as 14.14: where the upper bearing holds the shaft it steps by 19.997 um, below by
    20 um, and between them by the lever of each."""
    rig = turned(tmp_path)
    by_axis = {axis: placed.arm.value for axis, placed in conventions(rig).stations.axes.items()}
    lower, upper = by_axis["LowU"], by_axis["UppU"]
    upper_m = 14.14e-6 * np.sqrt(2)
    centre = (20e-6 * upper - upper_m * lower) / (upper - lower)
    assert asked_over_sent(rig, "y", 0.0, 20e-6) == pytest.approx(20e-6 / centre, abs=1e-8)
    assert abs(20e-6 / ((20e-6 + upper_m) / 2) - 20e-6 / centre) > 2e-6  # the mean of both is another place
    assert by_distance(conventions(rig))
    assert not by_distance(conventions(load_rig("amb5dof")))


def test_settling_times_of_bearings_that_are_turned(tmp_path: Path) -> None:
    turned(tmp_path)
    plan = {"axes": ["y", "z"], "settle_s": 1.0}
    run = simulated_run("step", str(tmp_path / "spindle.toml"), 3, plan, tmp_path / "s.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    true = truth_of_motion(run)
    told = {f"settling_time@{m.where}": m.estimate for m in run.results
            if isinstance(m, Measured) and m.quantity.name == "settling_time"}  # fmt: skip
    off = [(e.value - true[k]) / interval(e).U for k, e in told.items()]
    assert len(off) == 8
    assert max(map(abs, off)) < 1.0
    assert abs(np.mean(off)) < 0.5
