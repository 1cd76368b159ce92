"""200 histories written as records of a stated model and followed: do charts signal as often as their theory has it?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from made_histories import OWN, record

from bench.history.runlength import no_signal
from bench.history.series import one_history
from bench.history.trend import BASELINE, WEIGHT, Trend, trend
from bench.run import index

HISTORIES = 200
CHARTS = {"individuals": 1.0, "EWMA": WEIGHT}
pytestmark = [pytest.mark.long, pytest.mark.timeout(600)]


def made(folder: Path, slope: float, seed: int) -> list[Trend]:
    """Histories of 20 to 30 runs: a baseline, then a drift of `slope` own u with each run; an error that all runs share."""
    rng = np.random.default_rng(seed)
    out = []
    for h in range(HISTORIES):
        count = int(rng.integers(20, 31))
        drift = slope * OWN * np.maximum(0, np.arange(count) - BASELINE + 1)
        values = 75 + 0.12 * rng.standard_normal() + drift + OWN * rng.standard_normal(count)
        for k, v in enumerate(values):
            record(folder / f"{h}", k, float(v))
        out.append(trend(one_history(index.results(folder / f"{h}", quantity="K_i"), "K_i", list, "")))
    return out


def band(probabilities: Sequence[float]) -> tuple[int, int]:
    """The 99 % band of how many of independent events with these probabilities come."""
    law = np.ones(1)
    for p in probabilities:
        law = np.convolve(law, [1 - p, p])
    reached = np.cumsum(law)
    return int(np.argmax(reached >= 0.005)), int(np.argmax(reached >= 0.995))


def watched(found: Trend) -> int:
    return len(found.history.results) - BASELINE


def signalled(found: Trend, chart: str, within: int) -> bool:
    (segment,) = found.segments
    return any(g.chart == chart and g.at < BASELINE + within for g in segment.signals)


def test_false_alarms_are_as_many_as_limits_from_eight_runs_give(tmp_path: Path) -> None:
    still = made(tmp_path, 0.0, 1)
    for chart, weight in CHARTS.items():
        left = no_signal([0.0] * 22, weight, BASELINE)
        low, high = band([1 - left[watched(t) - 1] for t in still])
        assert low <= sum(signalled(t, chart, watched(t)) for t in still) <= high
    held = [abs(s.drift.slope) <= s.drift.half for t in still for s in t.segments if s.drift is not None]
    low, high = band([0.95] * HISTORIES)
    assert low <= sum(held) <= high


def test_a_drift_of_one_u_a_run_is_detected_as_soon_as_theory_has_it(tmp_path: Path) -> None:
    drifting = made(tmp_path, 1.0, 2)
    for chart, weight in CHARTS.items():
        left = no_signal([float(k) for k in range(1, 13)], weight, BASELINE)
        for within in (2, 3, 4, 6, 12):
            low, high = band([1 - left[within - 1]] * HISTORIES)
            assert low <= sum(signalled(t, chart, within) for t in drifting) <= high
