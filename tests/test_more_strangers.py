"""Two more rigs as strangers write them: `ventil`, a fan whose disc overhangs its bearings, with three planes of probes, French
names, a comb and 1 kHz; `lean`, 30 degrees up, axes 80 degrees apart and not alike in its two bearings, an axis that carries a
sixth of another one's load, classic CAN at 400 Hz with a tick of 12 bits, a probe that counts backwards, no capture.
Each test is of what went wrong with them once, in silence or without a word why."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from bench.cli.abilities import abilities
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.uncertainty import interval

FOLDER = Path(__file__).resolve().parent / "strangers"
ABLE = {
    "ventil": {
        "amb-calibration",
        "bearing-model",
        "step",
        "sensitivity",
        "tracking",
        "unbalance",
        "run-up",
        "coast-down",
    },
    "lean": {"amb-calibration", "bearing-model", "tracking"},
}


def flown(name: str, procedure: str, seed: int, plan: Mapping[str, Any], folder: Path) -> Simulated:
    return simulated_run(procedure, str(FOLDER / f"{name}.toml"), seed, plan, folder / "run.mcap")


def wrong(run: Simulated) -> list[str]:
    return [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def off(run: Simulated, *names: str) -> dict[str, float]:
    """Errors in U of the quantities that have a truth, by `name@where`."""
    truth = {**run.truth, **truth_of_motion(run)}
    told = [m for m in run.results if isinstance(m, Measured) and (not names or m.quantity.name in names)]
    keys = {f"{m.quantity.name}@{m.where}": m.estimate for m in told}
    return {k: (e.value - truth[k]) / interval(e).U for k, e in keys.items() if k in truth}


@pytest.mark.parametrize("name", ABLE)
def test_nothing_is_wrong_with_the_files(name: str) -> None:
    path = str(FOLDER / f"{name}.toml")
    assert check_rig(path)[0] == ()
    found = abilities(load_rig(path))
    assert not any(a.problems for a in found)
    assert {a.procedure for a in found if a.able} >= ABLE[name]


@pytest.mark.long
def test_the_phase_margin_of_a_rotor_that_overhangs(tmp_path: Path) -> None:
    """|S| is as great near 54 Hz, narrowly, as near 305 Hz; 1.07 rad were told for 0.77, 16 U."""
    plan = {"axes": ["Av45"], "settle_s": 2.0, "amplitude_A": 0.02}
    seen = off(flown("ventil", "sensitivity", 0, plan, tmp_path), "phase_margin")
    assert len(seen) == 1
    assert max(map(abs, seen.values())) < 1.2


@pytest.mark.long
def test_six_probes_that_cannot_all_read_zero_are_no_lack_of_settling(tmp_path: Path) -> None:
    run = flown("ventil", "amb-calibration", 0, {}, tmp_path)
    assert "unsettled" not in wrong(run)
    assert max(map(abs, off(run, "K").values())) < 1.5


@pytest.mark.long
def test_every_overshoot_is_told(tmp_path: Path) -> None:
    """One of eight was missing, with its bandwidth, and no finding said so."""
    run = flown("ventil", "step", 1, {"settle_s": 2.0}, tmp_path)
    told = [m.quantity.name for m in run.results if isinstance(m, Measured)]
    assert (told.count("overshoot"), told.count("bandwidth"), told.count("way_effect")) == (8, 8, 2)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 5])
def test_an_axis_that_carries_little_bends_no_certificates(tmp_path: Path, seed: int) -> None:
    """`certificate-contradicted` on five of nine sound machines, and the force constant 11 % low."""
    run = flown("lean", "bearing-model", seed, {}, tmp_path)
    assert "certificate-contradicted" not in wrong(run)
    assert abs(off(run, "beta")["beta@lb"]) < 1.5


@pytest.mark.long
def test_an_orbit_of_set_points_ends_within_the_envelope(tmp_path: Path) -> None:
    run = flown("lean", "tracking", 1, {}, tmp_path)
    assert wrong(run) == []
    assert max(map(abs, off(run).values())) < 2
