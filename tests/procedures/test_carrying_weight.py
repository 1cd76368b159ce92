"""What coils carry of a weight that is hardly there: a spindle that leans by 10 degrees from standing."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding

SPINDLE = Path(__file__).resolve().parents[2] / "examples/vertical-spindle"
SHORT = {"slow_s": 4.0, "dwell_s": 0.5, "settle_s": 0.8, "speeds_rad_s": [314.16, 733.0]}


@pytest.fixture
def leaning(tmp_path: Path) -> str:
    """The spindle at 80 degrees, its directions from above."""
    lines = (SPINDLE / "spindle.toml").read_text(encoding="utf-8").splitlines()
    lines = [line.replace("value = 90", "value = 80") if line.startswith("tilt") else line for line in lines]
    text = "\n".join(line for line in lines if not line.startswith("zero_at"))
    (tmp_path / "leaning.toml").write_text(text, encoding="utf-8")
    (tmp_path / "spindle.dbc").write_bytes((SPINDLE / "spindle.dbc").read_bytes())
    return str(tmp_path / "leaning.toml")


def wrong(rig: str, truth: dict[str, float], folder: Path) -> list[str]:
    run = simulated_run("unbalance", rig, 3, SHORT, folder / "run.mcap", truth)
    return [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def test_a_magnetic_centre_takes_the_weight_of_an_axis(leaning: str, tmp_path: Path) -> None:
    """20 um are 2 N of 3: a tolerance of the plan's (u = 10 um), and no exchanged coil."""
    assert wrong(leaning, {"magnetic_offset.LowU": -2.0e-5}, tmp_path) == []
