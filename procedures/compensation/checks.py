"""Reductions by the compensation, and what a record must say of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Finding
from bench.uncertainty import Estimate, coverage_factor
from bench.units import RPM
from procedures.synchronous.estimates import Result, Results

Reductions = Sequence[tuple[Result, Estimate]]


def reductions(results: Results) -> list[tuple[Result, Estimate]]:
    """Of each dwell with compensation against the one without at the same speed, the slowest first."""
    out = []
    for off in results.of("off"):
        for r in results.dwells:
            if r.dwell.wanted == off.dwell.wanted and r.dwell.variant != "off" and not r.dwell.again:
                e = 1 - r.estimates["reading", ""] / off.estimates["reading", ""]
                out.append((r, Estimate(e.value, "1", e.sensitivities)))
    return out


def describe(results: Results, found: Reductions, judged_to: float) -> Iterator[Finding]:
    """What is not judged: beyond the range, and the observer as printed; what the shaft itself still does."""
    for r, e in found:
        if r.dwell.variant == "literal" or r.dwell.speed > judged_to:
            what = "the observer as printed" if r.dwell.variant == "literal" else "beyond the range of T 3.5"
            text = f"{what}: the reduction is {e.value:.1%} ± {coverage_factor(float('inf')) * e.u:.1%}."
            yield Finding("reduction-told", text, r.dwell.where)
    corrected = results.of("corrected")
    if corrected and results.slow is not None:
        r = corrected[-1]
        size, off = np.abs(r.vectors.values), np.abs(results.runouts[1.0].values)
        read = r.estimates["reading", ""].value
        text = (f"at {r.dwell.wanted * RPM:.0f} r/min the probes read {read * 1e6:.2f} µm and the shaft "
                f"itself still moves by {size.max() * 1e6:.2f} µm: it follows the runout of up to {off.max() * 1e6:.2f} µm, "
                "which the observer cannot tell from motion.")  # fmt: skip
        yield Finding("runout-followed", text, r.dwell.where)
