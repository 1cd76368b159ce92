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
from procedures.amb_rotor.onset import onset, unlike
from procedures.step.acting import UNLIKE
from procedures.step.following import by_distance, is_told, motion
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


def starts(ticks: int, hz: float, damping: float, *, known: bool) -> tuple[Array, Array]:
    """How late the start is told, s, and how unlike a jump the answer is, at every second phase of the telemetry's period."""
    current, y = stepped(hz, damping)
    true, period, found = (REST - 1) * TICK, ticks * TICK, []  # the law has it at the next reading
    for phase in range(0, ticks, 2):
        c, x = means(current, ticks, phase), means(y, ticks, phase)
        t = TICK * (phase + ticks * np.arange(1, len(c) + 1))
        first = float(t[int(np.argmax(c > 0.25 * c.max()))])
        shaft = motion(t, x, tick=TICK, lag_s=LAG) if known else None
        how = {"tick": TICK, "ticks": ticks, "lag_s": LAG, "shaft": shaft}
        began, _ = onset(t, c, first - 1.8 * period, first - 0.5 * period, **how)  # type: ignore[arg-type]
        found.append((began - true, unlike(t, c, began, **how)))  # type: ignore[arg-type]
    late, apart = np.array(found).T
    return late, apart


@pytest.mark.parametrize("ticks", [10, 20])
def test_what_the_shaft_does_is_known_to_the_start(ticks: int) -> None:
    """Telemetry of 0.25 and 0.5 ms beside a rise of 1.4 ms: within 15 us, at every phase of the step in its period."""
    late, apart = starts(ticks, 150.0, 0.6, known=True)
    assert np.abs(late).max() < 2e-5
    assert abs(late.mean()) < 1.5e-5
    assert apart.max() < UNLIKE / 2


def test_a_square_of_time_is_not_what_a_light_rotor_does() -> None:
    late, _ = starts(20, 150.0, 0.6, known=False)
    assert late.mean() < -4e-5


def test_readings_that_are_noise_tell_no_motion() -> None:
    """1 % of the step, beside a shaft that goes all of it and one that goes a fifth."""
    noise = np.random.default_rng(1).normal(0, 0.01, 80)
    t = 5e-4 * np.arange(80)
    for gone, told in ((1.0, True), (0.2, False)):
        assert is_told(t, noise + np.where(t > 0.03, gone, 0.0), 0.03, 0.035) is told


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
