"""The map of runout: the bare model by hand, the whole path against the drawn machine, what is planted, refusals."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, interval
from procedures.runout_map import checks, estimates, fit
from procedures.runout_map.plan import Plan
from procedures.runout_map.planes import planes
from procedures.runout_map.procedure import check, procedure, step_count
from procedures.runout_map.steps import Turned, read_turns
from reports.figures import draw as draw_figure

RIG = load_rig("lira")
REDUCED = {"reduced": 1.0}


def run(folder: Path, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    told = {"places_m": [8e-3], "speed_rad_s": 1.2, "settle_s": 0.3, **plan}
    return simulated_run("runout-map", "lira", 1, told, path, {**REDUCED, **(truth or {})})


def values(done: Simulated) -> dict[str, Estimate]:
    return {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}


def wrong(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


@pytest.mark.parametrize("sense", [1, -1])
def test_a_vector_is_what_turned(sense: int) -> None:
    """With a constant, offsets at eight a turn, and a part of its own that goes the other way."""
    angle = np.linspace(0, 2 * math.pi, 3000, endpoint=False)
    with_it, against = 3e-6 * cmath.exp(0.7j), 4e-7 * cmath.exp(-2j)
    whole = with_it * np.exp(1j * sense * angle) + against * np.exp(-1j * sense * angle) + 5e-6 + 2e-6j
    whole += 1e-6 * np.exp(8j * angle)
    found = fit.vectors(angle, whole.real, whole.imag, sense, 8)
    assert found == pytest.approx((with_it, against), abs=1e-12)


def test_planes_have_their_motors() -> None:
    first, other = planes(RIG)
    assert (first.name, first.positions, first.currents) == ("RA1", ("x1", "y1"), ("i_d_B1", "i_q_B1"))
    assert (other.name, other.positions, other.currents) == ("RA2", ("x2", "y2"), ("i_d_B2", "i_q_B2"))
    assert estimates.ratio(RIG, first).value == pytest.approx(3.7 / 375e3)
    assert estimates.ratio(RIG, first).u / estimates.ratio(RIG, first).value == pytest.approx(
        math.hypot(0.11 / 3.7, 22e3 / 375e3) / math.sqrt(3), rel=0.01)  # fmt: skip


def test_what_the_zero_of_an_encoder_turns() -> None:
    plane = planes(RIG)[0]
    assert estimates._turned(plane, RIG, Plan()).u == pytest.approx(math.radians(2.6) / math.sqrt(3))
    assert estimates._turned(plane, RIG, Plan(parameters={"zero.ra1": 0.1})).value == pytest.approx(-0.1)


def test_a_drawn_machine_is_within_its_intervals(tmp_path: Path) -> None:
    done = run(
        tmp_path, {"target_runout": 9e-6, "magnet_runout_1": 6e-6, "magnet_runout_2": 6e-6}, places_m=[8e-3, 14e-3]
    )
    assert wrong(done) == set()
    found, true = values(done), truth_of_motion(done)
    assert set(found) == set(true)
    assert len(found) == 16
    for name, e in found.items():
        i = interval(e)
        half = (i.high - i.low) / 2
        assert abs(e.value - true[name]) < 1.5 * half, name
        assert half < (1.5e-6 if name.startswith("runout@") else 0.05), name
    for figure in procedure.figures(procedure.evaluated(done.recording).result, done.recording):
        assert draw_figure(figure)


def test_target_and_magnets_do_the_same(tmp_path: Path) -> None:
    """5 um of the target, or 5 um of the magnets the other way: the same vector, of neither alone."""
    alone = {
        "target_runout": 5e-6,
        "target_phase": 0.4,
        "magnet_runout_1": 0.0,
        "magnet_runout_2": 0.0,
        "runout_per_m": 0.0,
    }
    magnets = {"target_runout": 0.0, **{f"magnet_runout_{k}": 5e-6 for k in (1, 2)},
               **{f"magnet_phase_{k}": 0.4 - math.pi for k in (1, 2)}}  # fmt: skip
    first, other = (values(run(tmp_path, t)) for t in (alone, magnets))
    for part, expected in (("x", 5e-6 * math.cos(0.4)), ("y", 5e-6 * math.sin(0.4))):
        a, b = first[f"runout@RA1, 8 mm, {part}"], other[f"runout@RA1, 8 mm, {part}"]
        assert abs(a.value - b.value) < 0.3e-6
        assert a.value == pytest.approx(expected, abs=0.7e-6)


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> list[Turned]:
    return read_turns(run(tmp_path_factory.mktemp("turned")).recording)


PLAN = Plan(speed_rad_s=1.2)


def codes(turned: list[Turned]) -> list[str]:
    return [f.code for f in checks.of_signals(turned, RIG, PLAN)]


def test_signals(turned: list[Turned]) -> None:
    first, *rest = turned
    assert codes(turned) == []
    assert codes([]) == ["no-turns"]
    assert codes(turned[:3]) == ["no-turns"]
    assert codes([t for t in turned if t.sign > 0]) == ["no-turns"]
    assert codes([replace(first, states=("LEVITATED", "LANDING")), *rest]) == ["not-levitated"]
    assert codes([replace(first, lost=100), *rest]) == ["missing-samples"]
    half = slice(0, first.angle.size // 2)
    assert codes([replace(first, angle=first.angle[half], times=first.times[half]), *rest]) == ["way-not-covered"]
    assert codes([replace(first, times=1.2 * first.times), *rest]) == ["way-not-covered"]
    assert codes([replace(first, stood=9e-3), *rest]) == ["way-not-covered"]


def test_results(turned: list[Turned]) -> None:
    def told(some: list[Turned]) -> list[str]:
        return [f.code for f in checks.of_results(estimates.results(some, RIG, PLAN), PLAN)]

    assert told(turned) == []

    def changed(name: str, size: float) -> list[Turned]:
        return [replace(t, channels={**t.channels, name: t.channels[name] + size * np.cos(t.angle)}) for t in turned]

    assert "reading-not-held" in told(changed("x1", 8e-6))
    assert told(changed("i_d_B1", 0.8)) == ["other-way"]


def test_an_axis_that_is_reversed_is_told(turned: list[Turned]) -> None:
    """Of a vector that turns one way a mirrored axis makes one that turns the other way."""
    mirrored = [
        replace(t, channels={**t.channels, "i_d_B2": -3 * t.channels["i_d_B2"], "i_q_B2": 3 * t.channels["i_q_B2"]})
        for t in turned
    ]
    assert "other-way" in [f.code for f in checks.of_results(estimates.results(mirrored, RIG, PLAN), PLAN)]


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert step_count(Plan()) == 12
    assert "ref_z" in next(iter(check(RIG, Plan(places_m=(0.03,)))))
    assert "twice" in next(iter(check(RIG, Plan(places_m=(0.01, 0.01)))))
    assert "observer" in next(iter(check(RIG, Plan(observer="none"))))
    assert "ref_w" in next(iter(check(RIG, Plan(parameters={"ref_w": 1.0}))))
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"hold": None})})
    assert procedure.lacking(bare)
