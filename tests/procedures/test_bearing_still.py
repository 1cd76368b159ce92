"""A shaft that turns on after its lift, in a stand of which one bearing carries next to nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval

STAND = Path(__file__).resolve().parents[2] / "examples" / "plain-stand"
BY_MM = 110.0  # how far the centre of mass is nearer to the front bearing: 20 mm from it


@pytest.mark.long
def test_it_is_waited_for_before_the_first_position(tmp_path: Path) -> None:
    """Without that, positions of the first seconds are 28 mN off the model, 2 % of what the rear bearing carries."""
    text = (STAND / "stand.toml").read_text(encoding="utf-8").replace("value = 3.2, unit", "value = 2.0, unit")
    places = r"(?<=value = )(130|98|-122|158|-178|-205|245)(?=, unit = \"mm\")"
    text, moved = re.subn(places, lambda m: f"{float(m[0]) - BY_MM:g}", text)
    assert moved == 9
    (tmp_path / "stand.toml").write_text(text, encoding="utf-8")
    (tmp_path / "stand.dbc").write_bytes((STAND / "stand.dbc").read_bytes())
    run = simulated_run("bearing-model", str(tmp_path / "stand.toml"), 2, {}, tmp_path / "recording.mcap")
    assert not [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    found = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    for name in ("beta@y_hinten", "beta@y_vorn", "offset@y_hinten", "offset@y_vorn"):
        assert abs(found[name].value - run.truth[name]) < 1.3 * interval(found[name]).U, name
