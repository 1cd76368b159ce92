"""Differences that a budget alone would tell wrongly: without a u, of zeros that wander, of runs that are in doubt."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from test_differences import GAIN, A, B, compared, difference, record, scatter, value

from bench.calibration import Used
from bench.cli.compare import lines
from bench.findings import Effect, Finding
from bench.history.compare import Side, compare
from bench.history.differ import differing
from bench.record.outcomes import Outcome
from bench.record.records import findings_of
from bench.record.sources import ContinuedRun
from bench.uncertainty import Influence


def test_what_the_budgets_do_not_say_is_a_caution() -> None:
    a, b = (record(run, value(1.0, {GAIN: 1.0})) for run in (A, B))
    assert compared(a, b).cautions == ()
    gone_on = ContinuedRun(A, "recording.mcap", "ab" * 32, 9, "2026-01-01", "killed")
    used = Used("unbalance", "unbalance-1", "2025-01-01", "2025-06-01", "ab" * 32, "expired")
    overdue = Finding("certificate-overdue", "it was due", "certificates.force")
    doubt = Finding("drift-between-halves", "it moved", "", Effect.INDETERMINATE)
    other_unit = (dataclasses.replace(b.measurements[0], unit="N/mA"), *b.measurements)
    for change, said in (
        ({"continues": (gone_on,)}, "both rest on steps of one recording"),
        (
            {"outcome": Outcome.INDETERMINATE, "findings": findings_of([doubt])},
            "B ended INDETERMINATE (drift-between-halves)",
        ),
        ({"outcome": Outcome.ABORTED}, "B ended ABORTED: its values"),
        ({"plan": {**b.plan, "angles": 1}}, "the plans differ: where a setting says what is measured"),
        ({"findings": findings_of([overdue])}, "B rests on certificates that did not hold on its day: force"),
        ({"calibrations": (used,)}, "B rests on calibrations that had expired: unbalance"),
        ({"setup": None}, "B: a record of before schema 3"),
        ({"measurements": other_unit}, "K_i: found N/mA in B; A has N/A"),
    ):
        (found,) = compared(a, dataclasses.replace(b, **change)).cautions  # type: ignore[arg-type]
        assert said in found
    assert compared(a, dataclasses.replace(b, plan={**b.plan, "rounds": None})).cautions == ()
    once = {"seed": 3, "visit": 0}
    (found,) = compared(dataclasses.replace(a, **once), dataclasses.replace(b, **once)).cautions  # type: ignore[arg-type]
    assert "both simulate visit 0 of seed 3" in found


def test_a_zero_that_wanders_does_so_another_way_in_each() -> None:
    """What stands in the rig file is how fast it may; a load cell's gain beside it is one and the same."""
    drift = Influence("capabilities/reference/x/drift", "drift", 0.03, "m/s", "B", "normal")
    gain = Influence("capabilities/load_cells/x/gain", "gain of the cell", 0.5, "1", "B", "normal")
    one = value(1.0, {drift: 1.0, gain: 1.0})
    found = difference(record(A, one), record(B, one))
    assert found.u == pytest.approx(0.03 * math.sqrt(2), rel=1e-9)
    assert found.least == found.U


def test_a_difference_without_a_standard_uncertainty_is_judged_by_its_interval() -> None:
    """Two degrees of freedom leave an interval and no u; what has an interval is not free of uncertainty."""
    own = Influence("hysteresis/i", "hysteresis", 1.0, "N/A", "B", "rectangular")
    one = value(70.0, {own: 1.0, scatter(0.3, 2): 1.0})
    for middle, beyond in ((70.5, False), (75.0, True)):
        other = value(middle, {scatter(0.2, 2): 1.0})
        anew = {Path("a"): {("K_i", ""): one}, Path("b"): {("K_i", ""): other}}
        sides = Side(Path("a"), record(A, one)), Side(Path("b"), record(B, other))
        found = compare(*sides, anew=anew.__getitem__).differences[0]
        assert (found.source, found.u) == ("recording", None)
        assert found.en == pytest.approx(found.value / (found.value - found.low), rel=1e-12)
        assert found.beyond is beyond
        assert found.removed == pytest.approx(0.0, abs=1e-12)  # they share nothing
        # By draws of numpy: a rectangle of half width sqrt(3), and t of two degrees of freedom.
        drawn = np.random.default_rng(2)
        rectangle, t = drawn.uniform(-math.sqrt(3), math.sqrt(3), 400_000), drawn.standard_t(2, (2, 400_000))
        low, high = np.quantile(rectangle + 0.3 * t[0] + 0.2 * t[1], [0.025, 0.975])
        assert pytest.approx((high - low) / 2, rel=0.02) == found.U


def test_what_an_old_record_does_not_say_is_not_said_to_be_the_same() -> None:
    a, b = (record(run, value(1.0, {GAIN: 1.0})) for run in (A, B))
    told = "\n".join(lines(compared(a, b), differing(a, b), 80))
    assert "all else is the same: plan, rig, parameters, firmware, certificates, versions" in told
    old = dataclasses.replace(b, setup=None)
    told = "\n".join(lines(compared(a, old), [], 80))
    assert "all else is the same: plan, rig, versions" in told
    assert "caution: B: a record of before schema 3" in told
