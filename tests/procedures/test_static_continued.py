"""Static characteristics that were stopped go on at the next place: what is read again, and what drifted meanwhile."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from statics import SHORT, Cells, exchanged, taken
from stopped_runs import Stopping, ran, stopped_after, went_on

from bench.cli.compose import Request
from bench.cli.loading import load_procedure
from bench.cli.virtual import flown
from bench.errors import ConfigError
from bench.findings import Effect, Finding
from bench.record.outcomes import Outcome
from bench.recording import Recording
from bench.recording.earlier import AGAIN
from bench.rigfile import load_rig
from bench.run import stopped
from bench.run.runner import RunResult
from bench.rundir import RunDirectory
from procedures.shared.continued import DRIFTED
from procedures.static_characteristics import estimates, halves
from procedures.static_characteristics.beside import of_controller
from procedures.static_characteristics.estimates import Result
from procedures.static_characteristics.halves import Change
from procedures.static_characteristics.places import repeated
from procedures.static_characteristics.steps import READ, READING, Taken

sys.path.insert(0, str(Path(__file__).parents[1] / "sim"))
from rlsrm_bench import drawn

RIG, MACHINE, PLACE = load_rig("rlsrm"), replace(drawn(3), once=0.0), 4
PLAN = ("positions_m=[-0.013, 0.0, 0.013]", "angles_per_position=2", "levels_A=[2.0, 5.0]")
ASKED = Request("static-characteristics", "rlsrm", seed=2, plan=PLAN)
EACH, AGAINST = 28, 16
"""Readings at a place, and those that are taken again."""


def found(t: Taken) -> Result:
    return estimates.result(t, RIG, max(SHORT.levels_A), of_controller(RIG, t.phases))


def changed(r: Result, again: Taken) -> Change:
    """By readings of all places, of which one is looked at, and there the loads that are read again."""
    keep = repeated(SHORT, r.phases)
    there = replace(again, places=again.places[PLACE : PLACE + 1], loads=again.loads[PLACE : PLACE + 1],
                    times=again.times[PLACE : PLACE + 1], currents=again.currents[PLACE : PLACE + 1],
                    x=again.x[PLACE : PLACE + 1], angle=again.angle[PLACE : PLACE + 1])  # fmt: skip
    return halves.change(r, RIG, PLACE, there, keep)


@pytest.fixture(scope="module")
def sound() -> Result:
    return found(taken(RIG, MACHINE))


def parted(one: Taken, other: Taken) -> Taken:
    """The places of one to the seam, and those of another after it."""
    after = np.arange(len(one.x)) > PLACE
    four, three = after[:, None, None, None], after[:, None, None]
    return replace(one, loads=np.where(four, other.loads, one.loads), times=np.where(three, other.times, one.times),
                   x=np.where(after, other.x, one.x), angle=np.where(after, other.angle, one.angle))  # fmt: skip


@pytest.mark.parametrize("seed", range(1, 7))
def test_the_same_loads_once_more_are_no_change(sound: Result, seed: int) -> None:
    c = changed(sound, taken(RIG, MACHINE, seed=seed))
    assert (np.abs(c.value) < 4 * c.u + c.within).all()
    assert c.u[:2].max() < 3e-3
    assert min(c.chance, c.shares_chance) > 1e-3


@pytest.mark.parametrize(("gain", "number"), [((1.01, 1.0), 0), ((1.0, 1.02), 1)])
def test_a_cell_that_shows_more_by_its_share(sound: Result, gain: tuple[float, float], number: int) -> None:
    c = changed(sound, taken(RIG, MACHINE, Cells(gain=gain), seed=1))
    assert c.value[number] == pytest.approx(gain[number] - 1, abs=4 * c.u[number])
    assert c.value[number] > 5 * c.u[number]


def test_an_encoder_that_reads_more(sound: Result) -> None:
    """By two counts: the place is where it was, so that two counts are to be taken off."""
    again = taken(RIG, MACHINE, seed=1)
    counts = 2 * MACHINE.pitch[1]
    c = changed(sound, replace(again, angle=again.angle + counts))
    assert c.value[3] == pytest.approx(-counts, abs=4 * c.u[3] + c.within[3])


def test_a_phase_that_presses_more_is_named(sound: Result) -> None:
    """Phase C1 by 2 %, both along and around, as a current sensor would have it; cells and encoders do not explain it."""
    again, k, more = taken(RIG, MACHINE, seed=1), 2, 1 / 1.02 - 1
    c = changed(sound, halves.freed_of_phase(again, k, more, PLACE - 1))
    assert c.chance < 1e-6
    assert c.shares_chance > 1e-3
    assert c.shares[k] == pytest.approx(0.02, abs=4 * c.shares_u[k])
    assert (np.abs(np.delete(c.shares / c.shares_u, k)) < 4).all()
    drifted = found(parted(sound.taken, halves.freed_of_phase(again, k, more, PLACE)))
    (told,) = halves.told(c, drifted, RIG, PLACE)
    assert (told.code, told.where) == (DRIFTED, "C1")


def test_what_nothing_explains_decides(sound: Result) -> None:
    """Two phases are exchanged at the connector meanwhile."""
    c = changed(sound, exchanged(taken(RIG, MACHINE, seed=1), 1, 2, len(SHORT.levels_A)))
    (told,) = [f for f in halves.told(c, sound, RIG, PLACE) if not f.where]
    assert told.effect is Effect.INDETERMINATE
    assert "neither cells nor encoders nor phases" in told.text


def test_readings_are_freed_of_a_change_after_the_seam_alone(sound: Result) -> None:
    value = np.array([0.01, -0.02, 1e-5, 2e-3])
    t = sound.taken
    other = replace(t, loads=t.loads * (1 + value[:2]), x=t.x - value[2], angle=t.angle - value[3])
    back = halves.freed(parted(t, other), value, PLACE)
    assert np.allclose(back.loads, t.loads, rtol=1e-12)
    assert np.allclose(back.x, t.x, rtol=0, atol=1e-15)
    assert np.allclose(back.angle, t.angle, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("gain", "effects"), [(1.0, []), (1.02, [Effect.INDETERMINATE])])
def test_a_drift_that_matters_decides(gain: float, effects: list[Effect]) -> None:
    again = taken(RIG, MACHINE, Cells(gain=(gain, 1.0)), seed=1)
    r = found(parted(taken(RIG, MACHINE), again))
    told = [*halves.told(changed(r, again), r, RIG, PLACE)]
    assert [f.effect for f in told] == effects
    assert [f.where for f in told] == ["x"] * len(effects)
    assert all("axial load cell shows +2." in f.text or "+1.9" in f.text for f in told)


def opened(result: RunResult) -> Recording[Any]:
    return Recording.open(result.directory / "recording.mcap", load_procedure("static-characteristics").plan)


@pytest.mark.long
def test_stopped_within_a_place_it_goes_on_at_its_beginning(tmp_path: Path) -> None:
    """Stopped at the fourth of six places: three are taken over, the last of them is read again, and the rest is read."""
    whole = ran(ASKED, tmp_path / "whole")
    first = stopped_after(3 * EACH + 10, tmp_path / "a", ASKED)
    assert first.outcome is Outcome.ABORTED
    result = went_on(first.directory, tmp_path / "b")
    assert result.outcome is whole.outcome
    assert {f.code for f in result.record.findings} - {f.code for f in whole.record.findings} == {"continued"}
    (run,) = result.record.continues
    assert (run.run_id, run.steps, run.stopped) == (first.directory.name, 3 * EACH, "operator-stop")
    recording = opened(result)
    places = [s.labels["place"] for s in recording.steps(READING)]
    assert places == [p for p in range(6) for _ in range(EACH)]
    assert [s.labels["place"] for s in recording.steps(READING + AGAIN)] == [2] * AGAINST
    numbers = [s.labels["number"] for s in recording.all_steps()]
    assert numbers == sorted(set(numbers))
    assert {e["number"] for e in recording.events(READ)} == set(numbers)
    for one, other in zip(whole.record.measurements, result.record.measurements, strict=True):
        assert one.name == other.name
        if one.name not in ("held", "held_angle"):  # of these very readings
            (low, high), value = one.interval, other.value
            assert low - (high - low) / 4 < value < high + (high - low) / 4, one.name
    with pytest.raises(ConfigError, match="cannot be continued with another plan"):
        went_on(first.directory, tmp_path / "c", plan=("levels_A=[2.0, 4.0]",))


@pytest.mark.long
def test_a_cell_that_shows_more_in_the_second_half(tmp_path: Path) -> None:
    """Through the whole path: its gain is 1 % another one while the machine is off."""
    run, short = (
        RunDirectory(tmp_path),
        {"positions_m": (-13e-3, 0.0, 13e-3), "angles_per_position": 2, "levels_A": (2.0, 5.0)},
    )
    half = flown(ASKED.procedure, "rlsrm", 2, short, run.recording, progress=Stopping(3 * EACH))
    earlier = stopped.left_of(run, stopped.opened(run), load_procedure(ASKED.procedure))
    gain = {"load_cells.x.gain": half.drawn.values["load_cells.x.gain"] + 0.01}
    done = flown(ASKED.procedure, "rlsrm", 2, short, tmp_path / "on.mcap", gain, earlier=earlier).analysed()
    drifts = [f for f in done.results if isinstance(f, Finding) and f.code == DRIFTED]
    assert [(f.where, f.effect) for f in drifts] == [("x", Effect.INDETERMINATE)]
