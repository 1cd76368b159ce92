"""The AMB calibration of a shaft with more probes than its bearings have axes: their zeros cannot all be reached."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from procedures.amb_calibration.held import held
from procedures.amb_calibration.pulls import further, pulls
from procedures.amb_rotor.stations import stations

RIG = str(Path(__file__).resolve().parents[1] / "strangers" / "threeplanes.toml")
SHORT = {"settle_s": 4.0, "average_s": 0.3, "angles": 2}


def found(folder: Path, truth: Mapping[str, float] | None = None) -> tuple[set[str], int]:
    """Codes above a note, and how many quantities are told."""
    run = simulated_run("amb-calibration", RIG, 0, SHORT, folder / "run.mcap", truth)
    serious = {f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}
    return serious, sum(isinstance(m, Measured) for m in run.results)


def test_zeros_that_differ_from_probe_to_probe_are_no_lack_of_settling(tmp_path: Path) -> None:
    """Six probes with zeros of ±5 µm on four motions: each step was `unsettled` by up to 3.5 µm, on every seed."""
    assert found(tmp_path) == (set(), 12)


def test_an_integrator_that_is_too_slow_is_found_still(tmp_path: Path) -> None:
    assert "unsettled" in found(tmp_path, {"integrator_factor": 0.02})[0]


@pytest.mark.parametrize("zeros_um", [(0, 0, 3, -4, 0, 0), (1, -2, 3, 4, -5, 2)], ids=["by-four", "by-six"])
def test_either_way_of_a_controller_counts(zeros_um: tuple[float, ...]) -> None:
    """One that leaves the middle probes out has its own four at zero; one that takes all six has the least squares there.
    What the shaft is off beside that is off by both ways."""
    rig, pull = load_rig(RIG), pulls(load_rig(RIG))[0]
    s, zeros = stations(rig), 1e-6 * np.array(zeros_um)
    own = [s.channels.index(a.position) for a in pull.axes]
    off = np.zeros(4) if not zeros[own].any() else -np.linalg.pinv(s.reads) @ zeros
    for further_off in (np.zeros(4), np.array([1e-6, 2e-6, 0, 0])):
        reads = s.reads @ (off + further_off) + zeros
        mean = {c: np.full((1, 2), x) for c, x in zip(s.channels, reads, strict=True)}
        worst = max(np.abs(x).max() for x in held(rig, pull, mean, further(rig)).values())
        assert worst == pytest.approx(0.0, abs=1e-15) if not further_off.any() else worst > 5e-7


def test_four_probes_are_taken_as_they_read() -> None:
    rig = load_rig("tsbs12")
    pull, mean = pulls(rig)[0], {f"pos_{a}": np.full((1, 2), 1e-6) for a in ("yi", "zi", "yo", "zo")}
    assert further(rig) == ()
    assert held(rig, pull, mean, ()) == {a.position: mean[a.position] for a in pull.axes}
