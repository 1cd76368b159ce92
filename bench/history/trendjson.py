"""A trend as plain data, for programs: `bench trend --json`. Numbers are in the record's unit, times ISO 8601 UTC or visits."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

from bench.history.series import machine
from bench.history.trend import Segment, Step, Trend, reaches, steps

SCHEMA = 1


def as_data(trend: Trend) -> dict[str, Any]:
    """The trend without NaN; what is not known is None."""
    first, history = trend.history.results[0], trend.history
    return {
        "schema": SCHEMA, "quantity": trend.name, "unit": trend.unit, "procedure": first.procedure, "rig": first.rig,
        "uut": first.uut, "seed": first.seed, "machine": machine(first), "machine_kind": first.machine, "axis": history.axis,
        "lambda": trend.weight, "coverage_probability": first.p,
        "left_out": {"broken": history.broken, "repeated": history.repeated, "twins": history.twins},
        "segments": [_segment(s, trend, step) for s, step in zip(trend.segments, [None, *steps(trend)], strict=True)],
    }  # fmt: skip


def _segment(s: Segment, trend: Trend, step: Step | None) -> dict[str, Any]:
    visits = trend.history.axis == "visit"

    def when(time: float | None) -> Any:
        if time is None or visits:
            return time
        try:
            return datetime.fromtimestamp(time * 86400, UTC).isoformat(timespec="seconds")
        except (ValueError, OverflowError, OSError):
            return None

    return {
        "changed": list(s.changed),
        "against": None if s.against is None else s.against + 1,
        "step": None if step is None else {"change": step.change, "half_width": step.half},
        "runs": _runs(s),
        "chart": _chart(s),
        "signals": [
            {"chart": g.chart, "run_id": s.results[g.at].run_id, "upward": g.upward, "began": s.results[g.began].run_id}
            for g in s.signals
        ],
        "drift": None if s.drift is None else {
            "per": "visit" if visits else "day", "slope": s.drift.slope, "half_width": s.drift.half,
            "scatter": s.drift.scatter, "dof": s.drift.dof, "excess": s.excess,
        },
        "reaches": [
            {"limit": r.limit, "upward": r.upward, "time": when(r.time), "asked_until": when(r.asked)} for r in reaches(s)
        ],
    }  # fmt: skip


def _runs(s: Segment) -> list[dict[str, Any]]:
    watched = 0 if s.chart is None else s.chart.baseline
    averaged = [None] * len(s.results) if s.chart is None else [*[None] * watched, *s.chart.ewma.tolist()]
    return [
        {
            "run_id": r.run_id, "started": r.started, "visit": r.visit, "outcome": r.outcome, "verdict": r.verdict,
            "value": r.value, "u": r.u, "U": r.U, "lower": r.lower, "upper": r.upper, "ewma": averaged[k],
            "baseline": k < watched, "beyond": s.beyond[k], "ewma_beyond": s.ewma_beyond[k], "wide": s.wide[k],
            "overdue": None if r.overdue is None else r.overdue.split(", ") if r.overdue else [],
        }
        for k, r in enumerate(s.results)
    ]  # fmt: skip


def _chart(s: Segment) -> dict[str, Any] | None:
    if s.chart is None:
        return None
    limits = s.chart.limits
    found = {"centre": limits.centre, "sigma": limits.sigma, "moving_range": limits.moving_range, "lower": limits.lower,
             "upper": limits.upper, "baseline": s.chart.baseline, "ewma_lower": s.chart.ewma_lower.tolist(),
             "ewma_upper": s.chart.ewma_upper.tolist()}  # fmt: skip
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in found.items()}
