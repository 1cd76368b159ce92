"""One machine described in other ways is one machine: from another zero of the angles, from the other end of the shaft with the
other sense of rotation, with the axes of one bearing turned half round and named in the other order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from described import Table, as_it_is, from_another_mark, from_the_other_end, with_a_bearing_turned, written

from bench.cli.abilities import abilities
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.uncertainty import interval
from sim_backend.truth import draw

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SPINDLE, STAND = (str(EXAMPLES / name) for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml"))
SHORT = {"slow_s": 5.0, "settle_s": 1.0, "dwell_s": 1.0, "speeds_rad_s": [400.0, 900.0], "repeat": False}
WAYS: dict[str, Callable[[str], Callable[[Table], None]]] = {
    "mark": lambda _: from_another_mark(37.0),
    "end": lambda _: from_the_other_end,
    "turned": with_a_bearing_turned,
}


def from_another_end_and_mark(table: Table) -> None:
    """Two at once, since each run costs."""
    from_the_other_end(table)
    from_another_mark(37.0)(table)


SAME, ANEW = 0.25, 2.3  # of U: the same noise in the same order; each its own, 3.3 standard deviations of a difference
SIGNED = ("vector_cos", "vector_sin", "influence_cos", "influence_sin", "offset")  # by the way that an axis counts
LONG, LONGER = pytest.mark.long, pytest.mark.longer


@pytest.mark.parametrize(("rig", "bearing"), [(SPINDLE, "upper"), (STAND, "hinten")], ids=["spindle", "stand"])
@pytest.mark.parametrize("way", WAYS)
def test_another_description_is_sound_and_of_the_same_truth(way: str, rig: str, bearing: str, tmp_path: Path) -> None:
    here, there = (written(rig, tmp_path / name, how) for name, how in (("a", as_it_is), ("b", WAYS[way](bearing))))
    assert check_rig(there)[0] == ()
    able = [[a.procedure for a in abilities(load_rig(path)) if a.able] for path in (here, there)]
    assert able[0] == able[1]
    one, other = (draw(load_rig(path), 1).quantities for path in (here, there))
    assert other == pytest.approx(one, rel=1e-9)


def results(procedure: str, rig: str, plan: dict[str, Any], path: Path) -> tuple[dict[tuple[str, str], Any], list[str]]:
    run = simulated_run(procedure, rig, 1, plan, path)
    found = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    return found, [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


@LONG
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("rig", "bearing", "procedure", "plan"),
    [
        (SPINDLE, "upper", "unbalance", SHORT),
        pytest.param(SPINDLE, "upper", "step", {"axes": ["y", "z"]}, marks=LONGER),
        pytest.param(SPINDLE, "upper", "balance", {}, marks=LONGER),
        (SPINDLE, "upper", "run-up", {}),
        pytest.param(SPINDLE, "upper", "coast-down", {}, marks=LONGER),
        pytest.param(STAND, "vorn", "step", {"axes": ["y"]}, marks=LONGER),
        (STAND, "hinten", "bearing-model", {}),
        (STAND, "hinten", "amb-calibration", {}),
    ],
    ids=lambda value: value if isinstance(value, str) and "/" not in value else "",
)
def test_another_description_has_the_same_results(
    rig: str, bearing: str, procedure: str, plan: dict[str, Any], tmp_path: Path
) -> None:
    """Up to the sign of what is told along an axis that was turned. y is along the first axis of the first bearing, which is
    not turned; corrections are of readings, so that after the first one a balancing is another."""
    told, codes = results(procedure, written(rig, tmp_path / "here", as_it_is), plan, tmp_path / "here.mcap")
    assert told
    for way, how in (("end and mark", from_another_end_and_mark), ("turned", with_a_bearing_turned(bearing))):
        other = written(rig, tmp_path / way, how)
        found, also = results(procedure, other, plan, tmp_path / f"{way}.mcap")
        assert sorted(also) == sorted(codes), way
        assert found.keys() == told.keys(), way
        for name, e in told.items():
            if name[0].startswith("misfit"):  # of one set of data: another in other noise has its own
                continue
            a, b = found[name].value, e.value
            off = min(abs(a - b), abs(a + b)) if name[0] in SIGNED else abs(a - b)
            assert off <= (ANEW if way == "turned" or procedure == "balance" else SAME) * interval(e).U, (way, name)
