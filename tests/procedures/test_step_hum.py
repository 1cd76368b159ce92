"""A line in what the probes read before the steps: mains hum is one, the loop's own swing is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from bench.cli.virtual import simulated_run
from bench.findings import Finding
from procedures.step.estimates import Result
from procedures.step.hum import line, shared_poles
from procedures.step.oscillation import Swing
from procedures.step.settling import Settling
from procedures.step.steps import Case

PERIOD = 5e-4
Rest = np.ndarray[tuple[int], np.dtype[np.float64]]


def rests(hum: float = 0.0, hz: float = 62, damping: float = 0.2) -> list[Rest]:
    """Sixteen of 0.3 s, of a loop that swings, shaken by noise, to some 40 nm rms."""
    rng, w = np.random.default_rng(0), 2 * np.pi * hz
    swing = signal.cont2discrete(([w * w], [1, 2 * damping * w, w * w]), PERIOD, "zoh")
    t = np.arange(600) * PERIOD
    out = []
    for _ in range(16):
        x = signal.lfilter(swing[0].ravel(), swing[1], rng.standard_normal(4200))[3600:]
        out.append(
            4e-8 * x / x.std() + 2e-8 * rng.standard_normal(600) + hum * np.sin(2 * np.pi * 50 * t + rng.uniform(0, 6))
        )
    return out


def test_hum_is_a_line_whose_frequency_and_amplitude_are_told() -> None:
    hz, amplitude = line(rests(5e-8), PERIOD)
    assert hz == pytest.approx(50, abs=2)
    assert amplitude == pytest.approx(5e-8, rel=0.2)


def test_the_loops_own_swing_is_no_line() -> None:
    assert line(rests(), PERIOD) == (0.0, 0.0)


@pytest.mark.parametrize("damping", [0.02, 0.05])
def test_the_swing_of_a_loop_that_is_hardly_damped_is_no_line(damping: float) -> None:
    """At 40 Hz, half its power within 2 x damping x 40 Hz; hum of 0.2 µm at 50 Hz beside it is one."""
    pole = 2 * np.pi * 40 * np.array([complex(-damping, np.sqrt(1 - damping**2))])
    assert line(rests(hz=40, damping=damping), PERIOD)[1] > 0
    assert line(rests(hz=40, damping=damping), PERIOD, pole) == (0.0, 0.0)
    hz, amplitude = line(rests(2e-7, hz=40, damping=damping), PERIOD, pole)
    assert hz == pytest.approx(50, abs=2)
    assert amplitude == pytest.approx(2e-7, rel=0.2)


def response(*poles: complex) -> Result:
    """Of one case; the hum asks for no more of it than its poles."""
    swing = Swing(np.array(poles), np.ones(len(poles), np.complex128), 1.0, 0.0, 0.0)
    return Result(Case("A", 0.0, "y", 1e-5, 1), (), swing, Settling(0.01, 0.02, np.zeros(0)), 0.0, {})


def test_poles_that_one_response_alone_shows_are_its_noise() -> None:
    """Of seed 28 of amb5dof, steps along y alone: four responses, each with a second pole fitted to noise. By the hill of the
    loop's own swing beside it, at 98 Hz, its noise at 70 Hz was called hum."""
    fitted = [(-95 + 419j, -11 + 614j), (-95 + 421j, -5 + 285j), (-95 + 422j, 23 + 443j), (-95 + 421j, 56 + 551j)]
    found = shared_poles([response(*poles) for poles in fitted])
    assert found.tolist() == [poles[0] for poles in fitted]
    assert shared_poles([response(*fitted[0])]).tolist() == list(fitted[0])
    assert not len(shared_poles([]))


def test_what_turns_with_the_shaft_is_no_line_and_hum_beside_it_is_one() -> None:
    """What is left of an orbit at 3000 r/min was taken for hum, and the steps of sound stands ended INDETERMINATE."""
    assert line(rests(5e-8), PERIOD, orders=(50, 100)) == (0.0, 0.0)
    assert line(rests(5e-8), PERIOD, orders=(35, 70))[0] == pytest.approx(50, abs=2)


def test_rests_that_are_too_short_say_nothing() -> None:
    assert line([x[:80] for x in rests(5e-8)], PERIOD) == (0.0, 0.0)


@pytest.mark.long
def test_a_tenth_of_a_micrometre_of_hum_is_found_in_steps_of_the_spindle(tmp_path: Path) -> None:
    """It moved an overshoot by 4.9 U in silence: steps follow each other in whole periods of the mains."""
    rig = str(Path(__file__).parents[2] / "examples" / "vertical-spindle" / "spindle.toml")
    plan = {"axes": ["y"], "settle_s": 1}
    for hum, codes in ((0.0, set()), (1e-7, {"hum"})):
        path = tmp_path / f"{hum}.mcap"
        done = simulated_run("step", rig, 1, plan, path, {"hum": hum} if hum else None)
        found = {r.code for r in done.results if isinstance(r, Finding) and r.effect.name != "NOTE"}
        assert found == codes
