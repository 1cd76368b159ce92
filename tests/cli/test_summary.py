"""What a finished run says on the terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bench.cli.summary import summary
from bench.findings import Effect
from bench.procedure import Quantity
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome
from bench.record.records import FindingEntry, LimitEntry, Measurement, Record, missing, unfinished

LIMIT = LimitEntry(None, 30e-6, "m", "test", True)


def result(name: str, verdict: Verdict, value: float | None = 12.3e-6, where: str = "") -> Measurement:
    empty = missing(Quantity(name, "m", ""), None, where)
    if value is None:
        return empty
    limit = None if verdict is Verdict.NONE else LIMIT
    return replace(empty, value=value, standard_uncertainty=0.2e-6, coverage_factor=2.0, expanded_uncertainty=0.4e-6,
                   verdict=verdict, limit=limit)  # fmt: skip


def record(outcome: Outcome, *results: Measurement, findings: tuple[FindingEntry, ...] = ()) -> Record:
    empty = unfinished(run_id="r", procedure="unbalance", rig="stand", uut={}, started="", seed=1, plan={}, versions={})
    return replace(empty, outcome=outcome, measurements=results, findings=findings)


def test_it_says_outcome_what_decided_what_was_judged_and_where_to_look(tmp_path: Path) -> None:
    (tmp_path / "report.html").touch()
    results = [result("reading", Verdict.NONE), result("d_max", Verdict.PASS, where="inboard"),
               result("d_max", Verdict.FAIL, 40e-6, "outboard")]  # fmt: skip
    note = FindingEntry("samples-lost", "3 samples were lost.", "telemetry", Effect.NOTE)
    lines = summary(record(Outcome.FAIL, *results, findings=(note,)), tmp_path).splitlines()
    assert lines == [
        "FAIL: unbalance on stand",
        "  decided  outside its limit: d_max (outboard)",
        "  results  d_max (outboard)  40.00 ± 0.40 µm  fail  at most 30 µm",
        "           d_max (inboard)   12.30 ± 0.40 µm  pass  at most 30 µm",
        "           1 more result and 1 note: -v, or the report",
        f"  see      {tmp_path / 'report.html'}",
    ]
    whole = summary(record(Outcome.FAIL, *results, findings=(note,)), tmp_path, whole=True)
    assert "reading" in whole
    assert "samples-lost (telemetry): 3 samples were lost." in whole


def test_a_run_that_was_stopped_says_why_first_and_lists_nothing_missing(tmp_path: Path) -> None:
    stop = FindingEntry("operator-stop", "the operator answered 'stop'", "acquire", Effect.ERROR)
    results = [result(f"K_{n}", Verdict.MISSING, None) for n in range(6)]
    lines = summary(record(Outcome.ABORTED, *results, findings=(stop,)), tmp_path).splitlines()
    assert lines[:3] == [
        "ABORTED: unbalance on stand",
        "  decided  operator-stop (acquire): the operator answered 'stop'",
        "  missing  nothing was measured of 6 declared quantities",
    ]


def test_many_results_are_few_lines_the_worst_first(tmp_path: Path) -> None:
    results = [result("a", Verdict.PASS, where=f"{n}") for n in range(40)] + [result("b", Verdict.INDETERMINATE)]
    lines = summary(record(Outcome.INDETERMINATE, *results), tmp_path).splitlines()
    assert len(lines) == 2 + 12 + 2
    assert lines[1] == "  decided  crosses a limit: b"
    assert lines[2].startswith("  results  b ")


def test_a_long_finding_is_broken_between_words(tmp_path: Path) -> None:
    text = "the data agree if M2 is 1.0499 kg instead of 1.0000 kg " * 3
    long = FindingEntry("load-inconsistent", text, "M2", Effect.INDETERMINATE)
    lines = summary(record(Outcome.INDETERMINATE, findings=(long,)), tmp_path).splitlines()
    assert len(lines) > 3
    assert all(len(line) <= 80 for line in lines[:-1])


def test_results_that_are_too_wide_leave_limits_that_were_met_to_the_report(tmp_path: Path) -> None:
    results = [result("d_max_share", Verdict.PASS, where="outboard, 10000 r/min, with"),
               result("d_max_share", Verdict.FAIL, 40e-6, "inboard, 10000 r/min, with")]  # fmt: skip
    lines = summary(record(Outcome.FAIL, *results), tmp_path, width=80).splitlines()
    shown = [line for line in lines if "±" in line or line.strip().startswith("at most")]
    assert max(map(len, shown)) <= 80
    assert [line.split()[-1] for line in shown] == ["fail", "µm", "pass"]


def test_vectors_that_nothing_judged_are_told_by_amount_and_angle(tmp_path: Path) -> None:
    """3 and 4 µm with 0.4 µm each: 5 µm at 53.13 degrees, with 0.4 µm and 0.4/5 rad."""
    found = [result("vector_cos", Verdict.NONE, 3e-6, "yi"), result("vector_sin", Verdict.NONE, 4e-6, "yi"),
             result("residual_cos", Verdict.PASS, 1e-6), result("residual_sin", Verdict.NONE, 1e-6)]  # fmt: skip
    told = summary(record(Outcome.PASS, *found), tmp_path, whole=True)
    assert "vector (yi)   5.00 ± 0.40 µm ∠ 53.1 ± 4.6°\n" in told
    assert "vector_cos" not in told
    assert "residual_cos  1.00 ± 0.40 µm  " in told
    assert "residual_sin  1.00 ± 0.40 µm\n" in told


def test_no_quantity_crowds_out_the_others(tmp_path: Path) -> None:
    """Twelve lines of 20 values of one quantity and 3 of another; of each the one of no particular place first."""
    found = [*(result("reading", Verdict.NONE, where=f"{k}") for k in range(20)),
             *(result("d_max", Verdict.NONE, where=w) for w in ("a", "b", ""))]  # fmt: skip
    lines = summary(record(Outcome.DONE, *found), tmp_path).splitlines()
    listed = [line for line in lines if " µm" in line]
    assert len(listed) == 12
    assert [line.split("12.30")[0].removeprefix("  results").strip() for line in listed[-4:]] == [
        "reading (8)",
        "d_max",
        "d_max (a)",
        "d_max (b)",
    ]
    assert "11 more results" in lines[-2]
