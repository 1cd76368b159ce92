"""How well a procedure repeats itself: the same machine on two days, which share every certificate and no scatter."""

from __future__ import annotations

import math

import pytest
from identified import serious

from bench.cli.virtual import Simulated, simulated_run
from bench.procedure import Measured
from bench.uncertainty import Estimate

SEED, PLAN = 1, {"settle_s": 0.3, "average_s": 0.2}


def type_a(estimate: Estimate) -> float:
    """Standard uncertainty by what the run itself scattered."""
    return math.hypot(*(c * i.u for i, c in estimate.sensitivities.items() if i.kind == "A"))


def estimates(run: Simulated) -> dict[str, Estimate]:
    assert serious(run) == []
    return {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured)}


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulated, Simulated]:
    folder = tmp_path_factory.mktemp("days")
    one, other = (
        simulated_run("amb-calibration", "tsbs12", SEED, PLAN, folder / f"{visit}.mcap", visit=visit)
        for visit in (0, 1)
    )
    return one, other


def test_a_calibration_of_another_day_differs_by_its_type_a_alone(days: tuple[Simulated, Simulated]) -> None:
    assert days[0].truth == days[1].truth
    first, second = (estimates(day) for day in days)
    for name in ("K_i", "K_o"):
        apart, known = second[name].value - first[name].value, math.hypot(*(type_a(e[name]) for e in (first, second)))
        assert 0 < abs(apart) < 3 * known, name
        assert known < 0.5 * first[name].u, name  # most of u is certificates, which two days share


def test_the_facts_of_two_days_share_no_scatter(days: tuple[Simulated, Simulated]) -> None:
    """Adopted side by side, influences that a run invented are that day's own."""
    first, second = ({i.id for e in day.calibration().values.values() for i in e.sensitivities} for day in days)
    assert {i.partition("/")[0] for i in first & second} <= {"site", "geometry", "masses", "sensors", "machine", "hook"}
    assert any(i.startswith("sensors/") for i in first & second)


def test_a_recording_says_its_visit(days: tuple[Simulated, Simulated]) -> None:
    """Nothing where it is 0: such a file is what it was before there were visits."""
    assert [day.recording.visit for day in days] == [0, 1]
    assert [day.recording.run.get("visit") for day in days] == [None, "1"]
