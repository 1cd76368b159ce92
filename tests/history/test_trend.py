"""Trends of histories that are known: segments, charts, drifts, dates, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_histories import OWN, record, result, results

from bench.cli.__main__ import main
from bench.cli.trend_table import text
from bench.errors import ConfigError
from bench.history.series import one_history
from bench.history.trend import Trend, reaches, steps, trend
from bench.history.trendfigure import figure
from bench.history.trendjson import as_data
from bench.run.indexrow import Result
from reports.figures import draw


def of(found: list[Result], **given: float) -> Trend:
    return trend(one_history(found, "K_i", lambda: ["K_i", "K_o"], "runs"), **given)  # type: ignore[arg-type]


def scattered(count: int, seed: int = 3, slope: float = 0.0, after: int = 0) -> list[float]:
    k = np.arange(count)
    values = 75 + OWN * np.random.default_rng(seed).standard_normal(count) + slope * np.maximum(0, k - after)
    return [float(v) for v in values]


def refused(found: list[Result], quantity: str = "K_i", known: tuple[str, ...] = ("K_i", "K_o", "B")) -> str:
    with pytest.raises(ConfigError) as error:
        one_history(found, quantity, lambda: known, "runs")
    return str(error.value)


def test_each_change_begins_a_segment_and_no_line_crosses_it() -> None:
    values = scattered(20)
    for field, word in (("settings", "plan"), ("firmware", "firmware"), ("parameters", "parameters"),
                        ("certificates", "certificates"), ("calibrations", "calibrations")):  # fmt: skip
        found = of([result(k, v, **({field: "new"} if k >= 9 else {})) for k, v in enumerate(values)])
        assert [len(s.results) for s in found.segments] == [9, 11]
        assert found.segments[1].changed == (word,)
        shown = figure(found)
        for one in shown.series:
            assert not (one.x.size and one.x[0] < 9 <= one.x[-1])  # a change at day 9
        assert shown.notes[0][0] == f"new {word}"


def test_plans_that_take_turns_are_segments_side_by_side() -> None:
    found = of([result(k, v, settings="ab"[k % 2]) for k, v in enumerate(scattered(24))])
    assert [len(s.results) for s in found.segments] == [12, 12]
    assert found.segments[1].changed == ("plan",)


def test_what_comes_back_is_another_segment() -> None:
    found = of([result(k, v, firmware="121"[k // 8]) for k, v in enumerate(scattered(24))])
    assert [len(s.results) for s in found.segments] == [8, 8, 8]


def test_a_drift_is_found_dated_and_advised_on() -> None:
    values = scattered(26, slope=OWN, after=12)
    found = of(results(values))
    (segment,) = found.segments
    assert [g.chart for g in segment.signals] == ["individuals", "EWMA"]
    assert all(g.upward and 12 <= g.at <= 20 and g.began >= 8 for g in segment.signals)
    steady = of(results([75 + 0.05 * k + 0.01 * (-1) ** k for k in range(20)]))
    drift = steady.segments[0].drift
    assert drift is not None
    assert drift.slope == pytest.approx(0.05, abs=1e-3)
    assert drift.shown
    low, high = reaches(steady.segments[0])
    assert low.time is None
    assert high.time is not None
    # by hand: 80 - U = 75 + 0.05 k, U = 2 u of the model
    days = (80 - 2 * math.hypot(0.05, 0.12) - 75) / 0.05
    assert high.time - steady.history.times[0] == pytest.approx(days, abs=0.6)
    told = text(steady, False)
    assert "advice (ILAC-G24, method 2), not a due date" in " ".join(told.split())


def test_no_advice_from_few_runs_and_none_far_away() -> None:
    few = of(results([75.0, 75.1, 75.15, 75.3]))
    assert reaches(few.segments[0]) == []
    slow = of(results([75 + 0.001 * k + 0.0001 * (-1) ** k for k in range(20)]))
    assert [r.time for r in reaches(slow.segments[0])] == [None, None]


def test_a_run_less_sure_than_the_limits_are_wide_says_so() -> None:
    found = results(scattered(12))
    narrow = [r._replace(U=0.01, u=0.005) for r in found]
    narrow[9] = narrow[9]._replace(U=3.0, u=1.5)
    segment = of(narrow).segments[0]
    assert [k for k, wide in enumerate(segment.wide) if wide] == [9]
    told = text(of(narrow), False)
    assert "w own U wider than the limits" in told
    assert sum(line.endswith(" w") for line in told.splitlines()) == 1
    assert "what the runs have in common does not scatter" in " ".join(text(of(found), False).split())


def test_scatter_that_no_budget_has_is_told() -> None:
    values = [75 + x for x in np.random.default_rng(1).standard_normal(15)]  # u is 0.13
    segment = of(results(values)).segments[0]
    assert segment.excess is not None
    assert segment.drift is not None
    assert segment.excess == pytest.approx(segment.drift.scatter / 0.13)
    assert 3 < segment.excess < 10
    assert "something moves them that no budget has" in " ".join(text(of(results(values)), False).split())
    assert of(results(scattered(15))).segments[0].excess is None


def test_a_step_between_segments_has_its_interval() -> None:
    values = [75 + 0.05 * (-1) ** k + 0.5 * (k >= 10) for k in range(20)]
    found = of([result(k, v, settings="ab"[k // 10]) for k, v in enumerate(values)])
    (step,) = steps(found)
    assert step is not None
    assert step.change == pytest.approx(0.5)
    # by hand: all 20 are 0.05 off their mean, t_0.975(18) = 2.1009
    assert step.half == pytest.approx(2.1009 * math.sqrt(20 * 0.05**2 / 18) * math.sqrt(2 / 10), rel=1e-4)
    assert "mean +0.500 ± 0.050 N/A against segment 1" in " ".join(text(found, False).split())
    drifting = [*scattered(10, slope=1.0), *scattered(10)]
    assert steps(of([result(k, v, settings="ab"[k // 10]) for k, v in enumerate(drifting)])) == [None]


def test_a_change_under_two_plans_is_held_against_the_segment_of_its_own() -> None:
    """Plans a and b take turns, b gives 1 more; at run 17 the firmware changes and moves nothing."""
    values = [75 + 0.05 * (-1) ** (k // 2) + (k % 2) for k in range(24)]
    found = of([result(k, v, settings="ab"[k % 2], firmware="12"[k >= 16]) for k, v in enumerate(values)])
    assert [s.changed for s in found.segments] == [(), ("plan",), ("firmware",), ("firmware",)]
    assert [s.against for s in found.segments] == [None, 0, 0, 1]
    assert [s.change for s in steps(found) if s] == pytest.approx([1.0, 0.0, 0.0])
    assert "segment 4: new firmware; mean +0.000" in text(found, False)
    assert "against segment 2" in text(found, False)
    assert [s["against"] for s in as_data(found)["segments"]] == [None, 1, 1, 2]


def test_a_run_that_does_not_say_its_firmware_hides_no_change() -> None:
    values = scattered(20)
    for field in ("firmware", "parameters", "certificates"):
        said = ["1"] * 9 + [""] + ["2"] * 10
        found = of([result(k, v, **{field: said[k]}) for k, v in enumerate(values)])
        assert [len(s.results) for s in found.segments] == [10, 10]
        assert found.segments[1].changed == (field,)


def test_visits_are_the_days_of_a_virtual_machine() -> None:
    made = [result(0, 75 + k / 10, seed=4, visit=k, run_id=f"r-{k}") for k in (3, 1, 2, 5)]
    found = of(made)
    assert found.history.axis == "visit"
    assert found.history.times == (1.0, 2.0, 3.0, 5.0)
    again = of([*made, made[0]._replace(run_id="r-again")])  # the same simulation measured nothing new
    assert again.history.repeated == 1
    assert again.history.times == found.history.times


def test_a_baseline_that_was_disturbed_says_so() -> None:
    values = [75.0, 75.02, 75.0, 75.02, 75.0, 75.3, 75.3, 75.32, 75.0, 75.02]
    found = results(values)
    found[2] = found[2]._replace(outcome="INDETERMINATE")
    told = " ".join(text(of(found), False).split())
    assert "in the baseline run 3 ended INDETERMINATE, run 6 lies beyond them" in told
    assert "in the baseline" not in text(of(results(scattered(12))), False)
    assert "neither shown nor in a baseline" in " ".join(text(of(results(scattered(12))), True).split())


def test_a_copy_of_a_run_is_no_second_measurement() -> None:
    """Each run stands there twice: equal neighbours would take half of the moving range away."""
    once = results(scattered(12))
    twice = of([r._replace(run_id=name) for r in once for name in (r.run_id, f"{r.run_id}-copy")])
    assert twice.history.repeated == 12
    assert twice.segments[0].chart.limits == of(once).segments[0].chart.limits  # type: ignore[union-attr]
    assert "12 that are there twice left out" in text(twice, False)


def test_runs_without_a_value_are_left_out_and_counted() -> None:
    found = of([*results(scattered(9)), result(9, None), result(10, 75.0, outcome="ABORTED")])
    assert found.history.broken == 2
    assert len(found.history.results) == 9
    assert "2 without a value left out" in text(found, False)


def test_what_makes_no_history_is_refused_with_the_next_step() -> None:
    assert refused([], "k_i") == ("trend of k_i: found no such quantity in runs; the nearest names are K_i, K_o. Next: "
                                  "`bench trend 'K_i'`")  # fmt: skip
    assert "found no results in runs" in refused([], "K_i", ())
    assert "found 1 run with a value in runs; expected 2 or more" in refused([result(0)])
    units = refused([result(0), result(1, procedure="other", unit="N")])
    assert (
        "found different units: N/A by amb-calibration; N by other; expected one. Next: add --procedure NAME" in units
    )
    assert "several of machine: tsbs12 (7) (1 run); tsbs12 (8) (1 run)" in refused([result(0), result(1, uut="8")])
    assert "several of quantity: K_i (1 run); K_o (1 run)" in refused([result(0), result(1, name="K_o")])
    assert "add --procedure amb-calibration" in refused([result(0), result(1), result(2, procedure="other")])
    with pytest.raises(ConfigError, match=r"--lambda: found 0\.01; expected 0\.05 to 1"):
        of(results(scattered(9)), weight=0.01)
    with pytest.raises(ConfigError, match="--baseline: found 5; expected 8 or more"):
        of(results(scattered(9)), baseline=5)


sizes = st.floats(-1e12, 1e12, allow_subnormal=False) | st.sampled_from([0.0, 1e-9, 75.0])


@settings(max_examples=40)
@given(st.lists(sizes, min_size=2, max_size=14), st.sampled_from([None, 0.0, 1e-12, 0.3, 1e9]), st.booleans())
def test_any_values_are_told_in_80_columns_as_data_and_in_a_figure(
    values: list[float], half: float | None, virtual: bool
) -> None:
    seed, visit = (3, 1) if virtual else (None, None)
    made = [result(k, v, U=half, u=half, seed=seed, visit=visit and k, settings="ab"[k // 11], lower=None)
            for k, v in enumerate(values)]  # fmt: skip
    found = of(made)
    assert max(len(line) for line in text(found, True).splitlines()) <= 80
    json.dumps(as_data(found), allow_nan=False)
    shown = figure(found)
    assert shown.series


def test_the_figure_is_drawn() -> None:
    found = of([result(k, v, firmware="12"[k // 18]) for k, v in enumerate(scattered(30, slope=0.03, after=9))])
    svg = draw(figure(found)).svg
    assert svg.startswith("<svg")
    shown = figure(of(results(scattered(5))))
    assert shown.below is None  # no limits, no EWMA
    assert replace(shown, title="") != shown


def test_values_by_an_overdue_certificate_are_marked() -> None:
    """In the table, in a sentence with the certificate, in the figure and in the data; silence of a record stays silence."""
    late = {10: "span", 11: "span, masses", 12: None}
    found = of([result(k, v, overdue=late.get(k, "")) for k, v in enumerate(scattered(14))])
    told = text(found, False)
    rows = [line for line in told.splitlines()[3:] if line[:3].strip().isdigit()]
    assert [k for k, row in enumerate(rows) if row.rpartition(" ")[2] == "d"] == [10, 11]
    assert "certificate span was past its due date in 2 of 14 runs: " in told
    assert "certificate masses was past its due date in 1 of 14 runs: " in told
    assert "marks: d rests on a certificate past its due date\n" in told
    (segment,) = as_data(found)["segments"]
    assert [run["overdue"] for run in segment["runs"][9:]] == [[], ["span"], ["span", "masses"], None, []]
    (box,) = (s for s in figure(found).series if s.style == "box")
    assert (box.label, box.x.tolist()) == ("certificate past its due date", pytest.approx([10 + 1 / 3, 11 + 1 / 3]))
    assert "certificate past its due date" in draw(figure(found)).svg
    assert "d rests" not in text(of(results(scattered(14))), False)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k, v in enumerate(scattered(12)):
        record(tmp_path, k, v)
    assert main(["trend", "K_i", "--out", str(tmp_path), "--figure", str(tmp_path / "k.svg")]) == 0
    out = capsys.readouterr().out
    assert out.startswith("K_i of amb-calibration on tsbs12 (7)\n12 runs, 2026-01-05 08:00 to 2026-01-16 08:00\n")
    assert (tmp_path / "k.svg").read_text().startswith("<svg")
    (tmp_path / "folder.svg").mkdir()
    assert main(["trend", "K_i", "--out", str(tmp_path), "--figure", str(tmp_path / "folder.svg")]) == 3
    assert (
        f"--figure {tmp_path / 'folder.svg'}: cannot be written: Is a directory. Next: give another"
        in capsys.readouterr().err
    )
    assert main(["trend", "K_i", "--out", str(tmp_path), "--json", "--last", "10"]) == 0
    data = json.loads(capsys.readouterr().out)
    (segment,) = data["segments"]
    started = [run["started"] for run in segment["runs"]]
    assert len(started) == 10
    assert all(a < b for a, b in pairwise(started))
    assert main(["trend", "K_i", "--out", str(tmp_path), "--last", "10"]) == 0
    assert "older ones are neither shown" in capsys.readouterr().out


def test_the_command_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(tmp_path, 0, 75.0)
    for arguments, said in (
        (["K_i"], "found 1 run with a value"),
        (["K_1"], "the nearest names are K_i"),
        (["K_i", "--rig", "other"], "leave them out"),
        (["K_i", "--figure", "k.png"], "found .png; expected .svg"),
        (["K_i", "--figure", "nowhere/k.svg"], "found no folder nowhere; expected one that is there"),
        (["K_i", "--seed", "3"], "leave them out"),
    ):
        assert main(["trend", *arguments, "--out", str(tmp_path)]) == 2
        told = capsys.readouterr().err
        assert said in told
        assert told.count("\n") == 1
    assert main(["trend", "K_i", "--out", str(tmp_path / "nowhere")]) == 2
    assert "found no folder there" in capsys.readouterr().err
