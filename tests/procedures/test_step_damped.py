"""A shaft that hardly swings: what dies away fast is no oscillation, and still is in the way of what slow integrators leave."""

from __future__ import annotations

from pathlib import Path

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from benchmarks import drawn_rigs


def drawn_spindle(number: int, axis: str, seed: int, folder: Path) -> tuple[Simulated, dict[str, float]]:
    """Steps of it, and how far each result is off its truth, in U."""
    path = drawn_rigs.write("spindle", number, folder)
    run = simulated_run("step", str(path), seed, {"axes": [axis]}, folder / "run.mcap")
    true = truth_of_motion(run)
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    return run, {k: (e.value - true[k]) / interval(e).U for k, e in told.items() if k in true}


def serious(run: Simulated) -> set[str]:
    return {f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}


def test_a_shaft_that_hardly_swings(tmp_path: Path) -> None:
    """A spindle with magnets three times as strong: poles at -656 + 273i and -872 + 295i 1/s, an integrator of 57 ms. By
    constants of 10, 30 and 100 ms alone its settling times were .5 ms long, ten U."""
    run, off = drawn_spindle(23, "y", 1, tmp_path)
    assert {"rise_time", "settling_time", "steady_error"} <= {k.partition("@")[0] for k in off}
    assert max(map(abs, off.values())) < 1.3
    assert serious(run) <= {"fit-unsteady"}


def test_integrators_that_are_unlike(tmp_path: Path) -> None:
    """KiUpper is three times KiLower: settling times were .7 ms off, six U, by constants from .1 s on."""
    _, off = drawn_spindle(1003, "y", 3, tmp_path)
    assert len([k for k in off if k.startswith("settling_time")]) == 4
    assert max(map(abs, off.values())) < 1.3


def test_slow_integrators_without_a_fast_one(tmp_path: Path) -> None:
    """They leave what lasts 70 ms too: by decays of .1 s and longer this axis settled .5 to .9 ms early, up to 3 U."""
    run, off = drawn_spindle(1006, "z", 4, tmp_path)
    assert serious(run) == set()
    times = [off[k] for k in off if k.startswith("settling_time")]
    assert len(times) == 4
    assert max(map(abs, times)) < 1.5


def test_steps_that_do_not_follow_what_fits_them(tmp_path: Path) -> None:
    """Two oscillations told an overshoot that was 14 U off, and a bandwidth 12. How long 10 um take to settle hangs on the last
    digits of the processor's linear algebra here: -0.26 U by one of its kernels, -1.56 by another, in a run that says
    `fit-unsteady`."""
    run, off = drawn_spindle(1012, "z", 3, tmp_path)
    assert {k.partition("@")[0] for k in off} == {"rise_time", "steady_error", "settling_time"}
    assert max(abs(v) for k, v in off.items() if not k.startswith("settling_time")) < 1.3
    assert max(map(abs, off.values())) < 2
    assert serious(run) == {"fit-unsteady"}
