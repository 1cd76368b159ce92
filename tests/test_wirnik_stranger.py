"""`wirnik`, 11 kg and 4 degrees up, as a laboratory in Poland writes it: a tick of 1/15000 s, which is no whole number of
nanoseconds, names in cp1250, axes at 37 and 52 degrees, two unlike bearings, clockwise, a probe that counts backwards, 8 and 16
holes, a drive with the lower word first. Each test is of what went wrong with it once, in silence or without a way out."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_more_strangers import off, wrong

from bench.cli.abilities import abilities
from bench.cli.virtual import simulated_run
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig

WIRNIK = str(Path(__file__).resolve().parent / "strangers/wirnik.toml")
ABLE = {
    "amb-calibration",
    "spindown",
    "step",
    "bearing-model",
    "tracking",
    "unbalance",
    "balance",
    "run-up",
    "coast-down",
}


def test_nothing_is_wrong_with_the_file() -> None:
    """`balance` asked for another `rate_hz`, a key that its plan has not."""
    assert check_rig(WIRNIK)[0] == ()
    found = abilities(load_rig(WIRNIK))
    assert not any(a.problems for a in found)
    assert {a.procedure for a in found if a.able} == {*ABLE, "sensitivity"}


@pytest.mark.long
def test_phases_stay_where_they_are(tmp_path: Path) -> None:
    """Vectors at 6800 r/min were 17 U off: by ticks rounded to nanoseconds the mark was 0.2 ms late after 40 s."""
    run = simulated_run("unbalance", WIRNIK, 0, {}, tmp_path / "run.mcap")
    assert wrong(run) == []
    seen = off(run)
    assert len(seen) == 48
    assert max(map(abs, seen.values())) < 1.5


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 6])
def test_a_strap_that_seats_anew_contradicts_no_mass(tmp_path: Path, seed: int) -> None:
    """`load-inconsistent`, chi-squared 38 and 40 of 8, as a hanging without load was taken to have no noise at all."""
    run = simulated_run("amb-calibration", WIRNIK, seed, {}, tmp_path / "run.mcap")
    assert wrong(run) == []
    assert max(map(abs, off(run).values())) < 1.5
