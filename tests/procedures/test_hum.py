"""Hum of the mains in the probes: found where it is in a vector, and not where it is told apart or is the runout's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amb_stand import AMB_ROTOR

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from procedures.synchronous.dwells import SLOW, read_dwell
from procedures.synchronous.hum import Heard, leak_over, listen

RPM = math.pi / 30
DWELLS = {"slow_s": 5.0, "dwell_s": 1.5, "capture_s": 0.2, "settle_s": 1.0, "repeat": False}
ONE: dict[str, Any] = {**DWELLS, "speeds_rad_s": (2000 * RPM, 3000 * RPM)}
PASSED = {"top_rad_s": 4000 * RPM, "speeds_rad_s": (3000 * RPM,), "slow_s": 5.0, "settle_s": 1.0}
SWITCHED = {**DWELLS, "speeds_rad_s": (3000 * RPM,), "literal_rad_s": (), "switch_rad_s": 9000 * RPM, "after_s": 0.6}
BALANCED = {
    "slow_s": 4.2,
    "dwell_s": 0.5,
    "capture_s": 0.3,
    "settle_s": 0.8,
    "repeat": False,
    "speeds_rad_s": (3000 * RPM,),
}


def found(
    folder: Path, procedure: str, plan: Mapping[str, Any], truth: Mapping[str, float], seed: int = 1
) -> list[Finding]:
    run = simulated_run(procedure, "amb5dof", seed, plan, folder / "recording.mcap", truth)
    return [f for f in run.results if isinstance(f, Finding) and f.code == "hum"]


@pytest.mark.parametrize("probe", [0.0, 1.0])
def test_hum_at_the_speed_of_a_dwell_is_found_there_alone(tmp_path: Path, probe: float) -> None:
    """Of 0.1 µm, which the loop makes 0.17 µm of; at 2000 r/min the same hum is told apart."""
    hums = found(tmp_path, "unbalance", ONE, {"hum": 1e-7, "hum_probe": probe})
    assert [(f.where, f.effect) for f in hums] == [("3000 r/min, off", Effect.INDETERMINATE)]
    assert hums[0].concerns == ("@3000 r/min, off", "reduction@3000 r/min")
    for told in ("at 50.0", "reads a line of 0.1", "times its U", "Below 2918 and above 308"):
        assert told in hums[0].text


@pytest.mark.parametrize("truth", [{}, {"hum": 1e-8}, {"hum": 1e-7, "hum_hz": 51.5}, {"hum": 1e-6, "hum_hz": 60.0}])
def test_hum_that_moves_no_vector_is_not_found(tmp_path: Path, truth: Mapping[str, float]) -> None:
    """A fifth of U, or told apart by the dwell's turns."""
    assert not found(tmp_path, "unbalance", ONE, truth)


@pytest.mark.parametrize(("hum", "many"), [(0.0, 0), (2e-7, 1)])
def test_an_order_of_the_slow_roll_is_no_hum(tmp_path: Path, hum: float, many: int) -> None:
    """Order 4 of the runout, 1 µm, at 750 r/min lies within 0.3 Hz of 50 Hz, closer than five seconds tell: the standing
    shaft does."""
    plan = {**ONE, "slow_rad_s": 750 * RPM}
    truth = {"runout_i4": 1e-6, "runout_o4": 1e-6, "drive_gain": 1.0, "hum": hum}
    assert len(found(tmp_path, "unbalance", plan, truth)) == many


def test_hum_at_the_speed_of_a_capture_is_found_in_a_passage(tmp_path: Path) -> None:
    hums = found(tmp_path, "run-up", PASSED, {"hum": 3e-7})
    assert [f.where for f in hums] == ["3000 r/min, up, CCS"]
    assert hums[0].concerns[0] == "@3000 r/min, up, CCS"


@pytest.mark.long
def test_hum_within_the_peak_of_a_critical_concerns_it(tmp_path: Path) -> None:
    """65 Hz is 3900 r/min. At 2500 r/min it is told apart."""
    plan = {**PASSED, "law": "PID", "parameters": {"kd": 10.0}, "acceleration_rad_s2": 100.0, "bottom_rad_s": 1000 * RPM,
            "top_rad_s": 7000 * RPM, "speeds_rad_s": (2500 * RPM,)}  # fmt: skip
    hums = found(tmp_path, "run-up", plan, {"hum": 6e-7, "hum_hz": 65.0})
    assert {f.where for f in hums} >= {"zi, peak 1", "zo, peak 1"}
    assert all(f.concerns == (f"@{f.where}",) and "peak" in f.where for f in hums)


@pytest.mark.long
def test_hum_at_the_speed_of_the_switch_concerns_drop_and_residual(tmp_path: Path) -> None:
    hums = found(tmp_path, "compensation", SWITCHED, {"hum": 3e-7, "hum_hz": 150.0})
    assert {q for f in hums for q in f.concerns} == {"drop@9000 r/min", "residual@9000 r/min"}


@pytest.mark.long
@pytest.mark.parametrize(("hum", "many"), [(0.0, 0), (3e-8, 1)])
def test_hum_at_the_speed_of_a_balancing_is_found(tmp_path: Path, hum: float, many: int) -> None:
    """Runout cancels in influence coefficients, hum does not: they are known far better than a vector."""
    hums = found(tmp_path, "balance", BALANCED, {"hum": hum})
    assert [f.concerns for f in hums] == [()] * many


def test_the_amplitude_heard_is_that_of_the_line(tmp_path: Path) -> None:
    """At 400 Hz, beyond what the loop answers to, less what the mean of ten readings leaves: 0.76."""
    run = simulated_run("unbalance", "amb5dof", 1, ONE, tmp_path / "r.mcap", {"hum": 5e-7, "hum_hz": 400.0})
    sound = listen(run.recording, read_dwell(run.recording, next(iter(run.recording.steps(SLOW)))))
    assert sound is not None
    lines = list(sound.lines(395.0, 405.0))
    assert {x.probe for x in lines} == {0, 1, 2, 3}
    assert [x.hz for x in lines] == pytest.approx([400.0] * len(lines), abs=0.03)
    assert max(x.size for x in lines) == pytest.approx(0.76 * 5e-7, rel=0.1)


def test_of_a_line_within_the_width_of_an_order_counts_what_the_standing_shaft_shows() -> None:
    """10 s at 1 kHz, order 10 of 5 Hz; the standing shaft's noise is 10 nm, of which 0.7 nm show in a line."""
    hz, t, noise = (
        np.arange(0, 100, 0.0125),
        np.arange(200) * 1e-3,
        np.random.default_rng(1).normal(0, 1e-8, (4, 4, 200)),
    )
    values = np.full((4, hz.size), 3e-9 + 0j)
    values[1, np.argmin(np.abs(hz - 50.0))] = 1e-7
    for there, size in ((0.0, None), (2e-8, 2e-8), (6e-8, 1e-7)):
        still = tuple((t + k, there * np.sin(100 * math.pi * (t + k)) + noise[k]) for k in range(4))
        lines = [x.size for x in Heard(hz, values, 0.1, 5.0, 0.0, still, AMB_ROTOR.axes).lines(49.0, 51.0)]
        assert lines == ([] if size is None else [pytest.approx(size, rel=0.1)])
        assert (
            len(list(Heard(hz, values, 0.1, 4.9, 0.0, still, AMB_ROTOR.axes).lines(49.0, 51.0))) == 1
        )  # order 10 lies at 49 Hz


class Steady:
    """A shaft at 50 Hz."""

    def angle(self, t: Any) -> Any:
        return 100 * math.pi * t


@pytest.mark.parametrize(
    ("hz", "share"), [(50.0, 1.0), (50.1, math.sin(0.3 * math.pi) / (0.3 * math.pi)), (50 + 1 / 3, 0.0)]
)
def test_what_leaks_is_what_the_turns_do_not_tell_apart(hz: float, share: float) -> None:
    assert leak_over(Steady(), 7.0, 3.0, hz) == pytest.approx(share, abs=1e-3)  # type: ignore[arg-type]
