"""Orbits of set points on rigs as strangers write them: a shaft that is lost on one, set points in several messages."""

from __future__ import annotations

from pathlib import Path

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding

FOLDER = Path(__file__).resolve().parents[1] / "strangers"


def told(name: str, folder: Path) -> dict[str, Finding]:
    run = simulated_run("tracking", str(FOLDER / f"{name}.toml"), 0, {}, folder / "run.mcap")
    return {r.code: r for r in run.results if isinstance(r, Finding)}


def test_a_shaft_that_goes_farther_than_it_is_sent_is_lost_with_a_word(tmp_path: Path) -> None:
    """The soft loop of a hanging rotor makes 150 um of 40: it ended with the controller's F1 alone."""
    found = told("hanging", tmp_path)["orbit-lost"]
    assert found.effect is Effect.ERROR
    for word in ("asked for 40 µm", "gap_top_", "y_m, z_m", "points_hz"):
        assert word in found.text


def test_set_points_that_are_written_apart_are_no_ellipse(tmp_path: Path) -> None:
    """One message an axis, 10 ms one behind the other: phase lag, tilt and contour were 10 to 33 U off in silence."""
    found = told("tilted", tmp_path)["set-points-apart"]
    assert found.effect is Effect.INDETERMINATE
    assert found.concerns[0].startswith("@as set, 0.5 Hz")
